//! Tests of the list of edges: the edges of small meshes, their faces and their kinds, and larger ones
//! compared with a map of edges.

use super::*;
use crate::limits::Limits;

fn edges(triangles: &[[u32; 3]], masks: &[u8]) -> EdgeList {
    let count = triangles.iter().flatten().max().map_or(0, |m| m + 1);
    let mesh = Mesh {
        positions: vec![[0.0; 3]; count as usize],
        triangles: triangles.to_vec(),
        edge_masks: masks.to_vec(),
        ..Mesh::default()
    };
    EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap()
}

#[test]
fn a_tetrahedron_is_closed_and_has_six_edges() {
    let list = edges(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], &[7; 4]);
    assert_eq!(list.len(), 6);
    assert!(list.is_closed());
    assert_eq!(list.edges[0].vertices, [0, 2]);
    assert_eq!(list.edges[0].faces, [0, 3]);
    let flipped = edges(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 2, 3]], &[7; 4]);
    assert!(!flipped.is_closed());
    assert_eq!(flipped.iter().filter(|e| e.has_inconsistent_winding).count(), 3);
}

#[test]
fn a_quad_has_one_diagonal_and_four_open_edges() {
    let list = edges(&[[0, 1, 2], [0, 2, 3]], &[0b011, 0b110]);
    assert_eq!(list.len(), 5);
    assert_eq!(list.iter().filter(|e| !e.is_polygon_edge).count(), 1);
    assert_eq!(list.iter().filter(|e| e.face_count == 1).count(), 4);
    assert!(!list.is_closed());
}

#[test]
fn three_faces_at_an_edge_are_counted() {
    let list = edges(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], &[7; 3]);
    let hinge = list.get(0);
    assert_eq!((hinge.face_count, hinge.faces), (3, [0, 1]));
    assert!(hinge.has_inconsistent_winding);
    assert_eq!(list.further_faces, [[0, 2]]);
}

#[test]
fn agrees_with_a_map_on_a_large_grid() {
    let n = 200_u32;
    let mut triangles = Vec::new();
    for y in 0..n {
        for x in 0..n {
            let v = y * (n + 1) + x;
            triangles.push([v, v + 1, v + n + 2]);
            triangles.push([v, v + n + 2, v + n + 1]);
        }
    }
    let masks = vec![0b011; triangles.len()];
    let list = edges(&triangles, &masks);
    let mut map = std::collections::BTreeMap::new();
    for t in &triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *map.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
        }
    }
    assert_eq!(list.len(), map.len());
    for e in list.iter() {
        let key = [e.vertices[0].min(e.vertices[1]), e.vertices[0].max(e.vertices[1])];
        assert_eq!(map[&key], e.face_count);
    }
    assert!(list.edges.windows(2).all(|w| w[0].faces[0] <= w[1].faces[0]));
}

/// The edges by a map, one side after the other.
fn by_map(triangles: &[[u32; 3]], masks: &[u8]) -> (Vec<MeshEdge>, Vec<[u32; 2]>) {
    let mut numbers = std::collections::BTreeMap::new();
    let (mut edges, mut further_faces) = (Vec::<(MeshEdge, u32)>::new(), Vec::new());
    for ((t, mask), face) in triangles.iter().zip(masks).zip(0_u32..) {
        for (corner, [a, b]) in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].into_iter().enumerate() {
            let is_polygon_edge = mask >> corner & 1 != 0;
            let number = *numbers.entry([a.min(b), a.max(b)]).or_insert(edges.len());
            let Some((edge, start)) = edges.get_mut(number) else {
                let (vertices, faces) = ([a, b], [face, Edge::NO_FACE]);
                let has_inconsistent_winding = false;
                edges.push((MeshEdge { vertices, faces, face_count: 1, is_polygon_edge, has_inconsistent_winding }, a));
                continue;
            };
            if edge.face_count == 1 {
                edge.faces[1] = face;
            } else {
                further_faces.push([number as u32, face]);
            }
            edge.face_count = (edge.face_count + 1).min(3);
            edge.is_polygon_edge |= is_polygon_edge;
            edge.has_inconsistent_winding |= *start == a;
        }
    }
    (edges.into_iter().map(|(edge, _)| edge).collect(), further_faces)
}

#[test]
fn buckets_of_every_length_agree_with_a_map() {
    let mut state = 1_u32;
    let mut random = |n: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    };
    // From no two triangles at an edge to many at each, from short buckets to very long ones, on one
    // thread and on several.
    for (triangle_count, vertex_count) in [(1, 3), (500, 2000), (500, 60), (500, 12), (20_000, 9000), (40_000, 150)] {
        let triangle = |i: u32, random: &mut dyn FnMut(u32) -> u32| {
            let near = |v: u32, random: &mut dyn FnMut(u32) -> u32| (v + 1 + random(9)) % vertex_count;
            let a = if i.is_multiple_of(3) { random(vertex_count) } else { i % vertex_count };
            let (b, c) = (near(a, random), near(a, random));
            if vertex_count == 3 || a == b || b == c || c == a { [0, 1, 2] } else { [a, b, c] }
        };
        let mut triangles: Vec<[u32; 3]> = (0..triangle_count).map(|i| triangle(i, &mut random)).collect();
        // A fan around vertex 0.
        triangles.extend((1..vertex_count.min(100) - 1).map(|v| [0, v, v + 1]));
        let masks: Vec<u8> = triangles.iter().map(|_| random(8) as u8).collect();
        let list = edges(&triangles, &masks);
        let (by_map, further_faces) = by_map(&triangles, &masks);
        let found: Vec<MeshEdge> = list.iter().collect();
        assert!(found == by_map, "{triangle_count} triangles, {vertex_count} vertices");
        assert!(list.further_faces == further_faces, "{triangle_count} triangles, {vertex_count} vertices");
        assert_eq!(list.has_polygon_edges_alone(), by_map.iter().all(|edge| edge.is_polygon_edge));
    }
}

#[test]
fn an_edge_runs_from_the_smaller_position_to_the_larger() {
    let mesh = Mesh {
        positions: vec![[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]],
        triangles: vec![[0, 1, 2]],
        edge_masks: vec![0b111],
        ..Mesh::default()
    };
    let list = EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap();
    let vertices: Vec<[u32; 2]> = list.iter().map(|edge| edge.vertices).collect();
    assert_eq!(vertices, [[1, 0], [2, 1], [2, 0]]);
}

#[test]
fn too_small_a_budget_is_refused_at_every_step() {
    // A hub with a long bucket, and an edge of three faces.
    let mut triangles: Vec<[u32; 3]> = (1..100).map(|v| [0, v, v + 1]).collect();
    triangles.push([0, 1, 101]);
    triangles.push([1, 0, 102]);
    let mesh =
        Mesh { positions: vec![[0.0; 3]; 103], edge_masks: vec![7; triangles.len()], triangles, ..Mesh::default() };
    let of = |memory_bytes: u64| {
        let mut budget = Budget::new(&Limits { memory_bytes, ..Limits::default() });
        EdgeList::of(&mesh, &mut budget).map(|list| (list, budget.spent_bytes()))
    };
    let (list, spent_bytes) = of(1 << 30).unwrap();
    assert_eq!(list.further_faces.len(), 1);
    let refused = (0..spent_bytes).filter(|&bytes| of(bytes).is_err()).count();
    assert_eq!(refused as u64, spent_bytes);
    assert!(of(spent_bytes).is_ok());
}
