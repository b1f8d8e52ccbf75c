//! Tests of topology: small meshes, such as a torus and a Moebius strip, whose numbers of components,
//! edges, loops and handles are known.

use super::*;
use crate::limits::{Limits, Stopped};

fn mesh(triangles: &[[u32; 3]]) -> Mesh {
    let count = triangles.iter().flatten().max().map_or(0, |m| m + 1);
    Mesh {
        positions: vec![[0.0; 3]; count as usize],
        triangles: triangles.to_vec(),
        edge_masks: vec![7; triangles.len()],
        ..Mesh::default()
    }
}

fn topology(triangles: &[[u32; 3]]) -> Topology {
    let mesh = mesh(triangles);
    let mut budget = Budget::new(&Limits::default());
    let edges = EdgeList::of(&mesh, &mut budget).unwrap();
    Topology::of(&mesh, &edges, &mut budget, &Deadline::default()).unwrap()
}

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

/// Twelve triangles; corner `xyz` is vertex `names[x + 2y + 4z]`.
fn cube(names: [u32; 8]) -> Vec<[u32; 3]> {
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    halves.map(|t| t.map(|v: usize| names[v])).collect()
}

/// A grid of quads, halved, whose right side meets its left and whose upper side its lower, turned
/// over or not.
fn closed_grid(n: [u32; 2], wraps: [bool; 2], is_flipped: bool) -> Vec<[u32; 3]> {
    let points = [n[0] + u32::from(!wraps[0]), n[1] + u32::from(!wraps[1])];
    let at = |x: u32, y: u32| {
        let y = if is_flipped && x == n[0] { n[1] - y } else { y };
        (x % points[0]) * points[1] + y % points[1]
    };
    let mut triangles = Vec::new();
    for x in 0..n[0] {
        for y in 0..n[1] {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

#[test]
fn two_tetrahedra_are_two_watertight_spheres() {
    let two = TETRAHEDRON.map(|t| t.map(|v| v + 4));
    let t = topology(&[TETRAHEDRON, two].concat());
    assert_eq!((t.components, t.edges, t.euler_characteristic, t.is_watertight), (2, 12, 4, true));
    assert_eq!((t.open_edges, t.nonmanifold_edges, t.inconsistent_edges), (0, 0, 0));
    assert_eq!((t.boundary_loops, t.nonmanifold_vertices, t.duplicate_faces), (0, 0, 0));
    assert_eq!((t.is_orientable, t.genus, t.closed_surfaces), (true, Some(0), vec![(0, 2)]));
}

#[test]
fn faults_are_told_apart() {
    let t = topology(&[[0, 1, 2], [0, 1, 3], [4, 5, 6], [5, 4, 7], [4, 5, 8]]);
    assert_eq!((t.components, t.open_edges, t.nonmanifold_edges, t.inconsistent_edges), (2, 10, 1, 1));
    assert_eq!((t.is_watertight, t.is_orientable, t.genus), (false, true, None));
    // Through the hinge all three wings hang together, and so does their rim.
    assert_eq!((t.boundary_loops, t.nonmanifold_vertices), (2, 0));
}

#[test]
fn a_bow_tie_has_a_knot() {
    // Flat: two triangles that share a vertex have a rim each.
    let t = topology(&[[0, 1, 2], [0, 3, 4]]);
    assert_eq!((t.components, t.nonmanifold_vertices, t.boundary_loops, t.open_edges), (1, 1, 2, 6));
    // Solid: two tetrahedra that share one.
    let two = TETRAHEDRON.map(|t| t.map(|v| if v == 0 { 0 } else { v + 3 }));
    let t = topology(&[TETRAHEDRON, two].concat());
    assert_eq!((t.components, t.nonmanifold_vertices, t.boundary_loops), (1, 1, 0));
    assert_eq!((t.euler_characteristic, t.is_watertight, t.genus), (3, true, None));
    assert_eq!(t.closed_surfaces, [(0, 2)]);
}

#[test]
fn a_torus_has_a_handle_and_three_have_three() {
    let torus = closed_grid([5, 4], [true, true], false);
    let t = topology(&torus);
    assert_eq!((t.euler_characteristic, t.genus, t.is_watertight), (0, Some(1), true));
    let more = |by: u32| torus.iter().map(move |t| t.map(|v| v + by));
    let ball = TETRAHEDRON.map(|t| t.map(|v| v + 60));
    let t = topology(&torus.iter().copied().chain(more(20)).chain(more(40)).chain(ball).collect::<Vec<_>>());
    assert_eq!((t.components, t.euler_characteristic, t.genus), (4, 2, Some(3)));
    assert_eq!(t.closed_surfaces, [(0, 1), (1, 3)]);
}

#[test]
fn two_holes_through_one_block_are_genus_two() {
    // Two tori, each without one triangle, sewn together along the gap.
    let torus = closed_grid([5, 5], [true, true], false);
    let seam = torus[0];
    let others: Vec<u32> = (0..25).filter(|v| !seam.contains(v)).collect();
    let renamed = |v: u32| others.iter().position(|o| *o == v).map_or(v, |place| 25 + place as u32);
    // The second one is inside out, so that both agree along the seam.
    let second = torus.iter().skip(1).map(|t| [t[0], t[2], t[1]].map(renamed));
    let t = topology(&torus.iter().skip(1).copied().chain(second).collect::<Vec<_>>());
    assert_eq!((t.components, t.euler_characteristic, t.is_watertight), (1, -2, true));
    assert_eq!((t.genus, t.closed_surfaces), (Some(2), vec![(2, 1)]));
}

#[test]
fn a_moebius_strip_has_one_rim_and_one_side() {
    let t = topology(&closed_grid([7, 2], [true, false], true));
    assert_eq!((t.components, t.boundary_loops, t.euler_characteristic), (1, 1, 0));
    assert_eq!((t.is_orientable, t.genus, t.open_edges, t.inconsistent_edges), (false, None, 14, 2));
    let band = topology(&closed_grid([7, 2], [true, false], false));
    assert_eq!((band.boundary_loops, band.is_orientable, band.open_edges), (2, true, 14));
}

#[test]
fn a_klein_bottle_is_closed_and_has_one_side() {
    let t = topology(&closed_grid([7, 5], [true, true], true));
    assert_eq!((t.components, t.open_edges, t.boundary_loops, t.nonmanifold_edges), (1, 0, 0, 0));
    assert_eq!((t.euler_characteristic, t.is_orientable, t.genus), (0, false, None));
    assert_eq!((t.is_watertight, t.inconsistent_edges, t.nonmanifold_vertices), (false, 5, 0));
    assert!(t.closed_surfaces.is_empty());
}

#[test]
fn cubes_that_share_an_edge_or_a_vertex_or_a_face() {
    let first = cube([0, 1, 2, 3, 4, 5, 6, 7]);
    let with = |names| topology(&[first.clone(), cube(names)].concat());
    let edge = with([1, 8, 3, 9, 10, 11, 12, 13]);
    assert_eq!((edge.components, edge.edges, edge.nonmanifold_edges), (1, 35, 1));
    assert_eq!((edge.nonmanifold_vertices, edge.boundary_loops, edge.open_edges), (0, 0, 0));
    assert_eq!((edge.is_watertight, edge.genus, edge.closed_surfaces.len()), (false, None, 0));
    let vertex = with([7, 8, 9, 10, 11, 12, 13, 14]);
    assert_eq!((vertex.nonmanifold_edges, vertex.nonmanifold_vertices, vertex.components), (0, 1, 1));
    assert_eq!((vertex.genus, vertex.closed_surfaces), (None, vec![(0, 2)]));
    // The face x = 1 of the first is the face x = 0 of the second: its triangles are there twice,
    // with four faces at each edge.
    let face = with([1, 8, 3, 9, 5, 10, 7, 11]);
    assert_eq!((face.nonmanifold_edges, face.duplicate_faces, face.edges), (5, 2, 31));
    assert_eq!((face.components, face.genus), (1, None));
}

#[test]
fn a_ball_with_holes_has_a_rim_for_each() {
    // A torus grid without wrapping in y, closed by a pole at each end, is a ball.
    let n = [12, 9];
    let mut ball = closed_grid(n, [true, false], false);
    let poles = [n[0] * (n[1] + 1), n[0] * (n[1] + 1) + 1];
    for x in 0..n[0] {
        let next = (x + 1) % n[0];
        let row = |x: u32, y: u32| x * (n[1] + 1) + y;
        ball.push([poles[0], row(next, 0), row(x, 0)]);
        ball.push([poles[1], row(x, n[1]), row(next, n[1])]);
    }
    let whole = topology(&ball);
    assert_eq!((whole.is_watertight, whole.genus, whole.euler_characteristic), (true, Some(0), 2));
    let quad = |x: u32, y: u32| ((x * n[1] + y) * 2) as usize;
    // Four holes: three quads that touch nowhere, and a triangle.
    let gone = [quad(1, 1), quad(1, 1) + 1, quad(5, 5), quad(5, 5) + 1, quad(9, 2), quad(9, 2) + 1, quad(3, 6)];
    let without = |gone: &[usize]| {
        let left: Vec<[u32; 3]> = ball.iter().enumerate().filter(|(i, _)| !gone.contains(i)).map(|(_, t)| *t).collect();
        topology(&left)
    };
    let t = without(&gone);
    assert_eq!((t.boundary_loops, t.open_edges, t.components, t.nonmanifold_vertices), (4, 15, 1, 0));
    assert_eq!((t.euler_characteristic, t.genus, t.is_orientable), (2 - 4, None, true));
    // Two holes that touch in a vertex leave it with two fans.
    let t = without(&[quad(1, 1), quad(1, 1) + 1, quad(2, 2), quad(2, 2) + 1]);
    assert_eq!((t.open_edges, t.nonmanifold_vertices, t.boundary_loops), (8, 1, 1));
}

#[test]
fn duplicates_count_beyond_the_first_in_any_order() {
    let t = topology(&[[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 1, 3], [3, 1, 0]]);
    assert_eq!((t.duplicate_faces, t.nonmanifold_edges), (3, 3));
    // Two faces back to back are a closed surface, and duplicates.
    let pillow = topology(&[[0, 1, 2], [0, 2, 1]]);
    assert_eq!((pillow.duplicate_faces, pillow.is_watertight, pillow.genus), (1, true, Some(0)));
}

#[test]
fn memory_and_time_are_limited() {
    let mesh = mesh(&TETRAHEDRON);
    let edges = EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap();
    let poor = Limits { memory_bytes: 4 * 24 + 4 * 5 - 1, ..Limits::default() };
    let error = Topology::of(&mesh, &edges, &mut Budget::new(&poor), &Deadline::default()).unwrap_err();
    assert!(matches!(error, Exhausted::Limit(_)), "{error}");
    let stopped = Deadline::default();
    stopped.stop();
    let error = Topology::of(&mesh, &edges, &mut Budget::new(&Limits::default()), &stopped).unwrap_err();
    assert_eq!(error, Exhausted::Stopped(Stopped));
}
