//! Tests of the comparison of meshes, on meshes whose differences are known: made on purpose, given by a formula, or
//! found by a brute-force search.

use super::*;
use crate::made_obj::Obj;
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::vector::{cross, dot, sub};

fn open(text: &str) -> Model {
    let bundle = Bundle::of_one(text.as_bytes().to_vec());
    let limits = Limits::default();
    crate::read(&bundle, None, &limits, Budget::new(&limits), &Deadline::default()).unwrap()
}

fn texts(a: &str, b: &str, max_distance: Option<f64>) -> Difference {
    compare(&open(a), &open(b), max_distance, &Deadline::default()).unwrap().difference
}

fn diff(a: &Obj, b: &Obj) -> Difference {
    texts(&a.text(), &b.text(), None)
}

#[track_caller]
fn says(a: &Obj, b: &Obj, expected: &[&str]) -> Difference {
    let difference = diff(a, b);
    assert_eq!(difference.summary, expected, "{difference:#?}");
    difference
}

/// Three cubes of different sizes.
fn three() -> Obj {
    Obj::default()
        .cube([0.0; 3], [1.0; 3])
        .cube([5.0, 0.0, 0.0], [1.0, 0.5, 1.5])
        .cube([0.0, 6.0, 0.0], [0.25, 1.0, 0.5])
}

#[test]
fn another_order_is_no_difference() {
    for obj in [three(), Obj::sphere(12, 3.0), Obj::plane(5, [10.0, 0.0, 0.1])] {
        assert!(says(&obj, &obj, &["the geometry is unchanged"]).same);
        let shuffled = obj.shuffled();
        let unchanged = says(&obj, &shuffled, &["the geometry is unchanged, with vertices or faces in another order"]);
        assert!(unchanged.same);
        let geometry = &unchanged.geometry;
        assert_eq!((geometry.hausdorff, geometry.mean, geometry.stated_error), (Some(0.0), Some(0.0), Some(0.0)));
    }
}

#[test]
fn an_encoding_with_fewer_digits_is_no_difference() {
    let sphere = Obj::sphere(20, 3.0).map(|v| v.map(|x| x + 0.3));
    let rounded = sphere.clone().map(|v| v.map(|x| (x * 1e6).round() / 1e6));
    assert!(
        says(&sphere, &rounded.shuffled(), &["the geometry is unchanged, with vertices or faces in another order"])
            .same
    );
    // Nor are other unit boxes, where something far away came or went; here, seen from what stayed.
    let far = three().cube([1000.0, 3.0, 0.0], [1.0; 3]);
    let parts = diff(&three(), &far).parts;
    assert_eq!(parts, PartCounts { unchanged: 3, added: 1, ..PartCounts::default() });
}

#[test]
fn parts_that_moved_came_or_went_are_named() {
    let other = Obj::default()
        .cube([0.0; 3], [1.0; 3])
        .cube([5.0, 0.0, 1.5], [1.0, 0.5, 1.5])
        .cube([0.0, 6.0, 0.0], [0.25, 1.0, 0.5]);
    let moved = says(&three(), &other.shuffled(), &["one part moved by (0, 0, 1.5)"]);
    assert!(!moved.same && !moved.geometry.same && moved.topology.same);
    assert_eq!(moved.parts, PartCounts { unchanged: 2, moved: 1, ..PartCounts::default() });
    let two = Obj::default().cube([0.0; 3], [1.0; 3]).cube([5.0, 0.0, 0.0], [1.0, 0.5, 1.5]);
    let parts = "connected parts: 2, before 3";
    says(&three(), &two, &["one part with 12 triangles was removed near (0, 6, 0)", parts]);
    says(&two, &three(), &["one part with 12 triangles was added near (0, 6, 0)", "connected parts: 3, before 2"]);
    // Turned by a quarter about z, and elsewhere.
    let turned = Obj::default().cube([0.0; 3], [1.0; 3]).cube([9.0, 0.0, 0.0], [0.5, 1.0, 1.5]);
    says(&two, &turned, &["one part with 12 triangles was turned near (9, 0, 0)"]);
    let taller = Obj::default().cube([0.0; 3], [1.0; 3]).cube([5.0, 0.0, 0.25], [1.0, 0.5, 1.75]);
    says(&two, &taller, &["one part changed its shape by up to 0.5 near (4, -0.5, 2)"]);
}

#[test]
fn the_same_shift_of_many_parts_is_one_sentence() {
    let row = |shift: f64| {
        (0..30).fold(Obj::default().cube([-9.0; 3], [2.0; 3]), |obj, i| {
            obj.cube([4.0 * f64::from(i), 0.0, shift], [1.0; 3])
        })
    };
    says(&row(0.0), &row(0.25), &["30 parts moved by (0, 0, 0.25)"]);
}

#[test]
fn a_whole_mesh_moved_or_in_another_unit_is_one_sentence() {
    says(&three(), &three().map(|[x, y, z]| [x + 1e3, y, z - 2.0]), &["the whole mesh moved by (1000, 0, -2)"]);
    says(&three(), &three().shuffled().map(|v| v.map(|x| 25.4 * x)), &["the whole mesh is 25.4 times as large"]);
    says(&Obj::sphere(10, 1.0), &Obj::sphere(10, 0.001), &["the whole mesh is 0.001 times as large"]);
}

#[test]
fn holes_and_turned_faces_are_named() {
    let sphere = Obj::sphere(16, 2.0);
    let mut open = sphere.clone();
    // A triangle away from the poles.
    let gone = open.faces.remove(16 * 16 + 1);
    let at: [f64; 3] = std::array::from_fn(|k| gone.iter().map(|v| sphere.vertices[*v][k]).sum::<f64>() / 3.0);
    let hole = diff(&sphere, &open.shuffled()).summary;
    let near = words::place(at, 2.0 * 12.0_f64.sqrt());
    assert_eq!(hole[0], format!("a hole with 3 edges near {near}"), "{hole:?}");
    assert_eq!(hole[1..], ["it is no longer watertight"]);
    let closed = diff(&open, &sphere).summary;
    assert_eq!(closed[0], format!("the hole with 3 edges near {near} is closed"), "{closed:?}");
    let mut turned = sphere.clone();
    turned.faces[16 * 16 + 1].reverse();
    let difference = diff(&sphere, &turned);
    assert_eq!(
        difference.summary,
        [&format!("one face looks to the other side near {near}"), "it is no longer watertight"]
    );
    assert!(!difference.same && !difference.geometry.same && difference.faces.turned == 1);
    turned = sphere.clone();
    turned.faces.iter_mut().for_each(|face| face.reverse());
    says(&sphere, &turned, &["all faces look to the other side"]);
}

#[test]
fn a_surface_that_is_divided_otherwise_is_the_same_surface() {
    let other_diagonals = {
        let mut obj = three();
        obj.faces.iter_mut().for_each(|face| face.rotate_left(1));
        diff(&three(), &obj)
    };
    assert_eq!(other_diagonals.summary, ["the surface is unchanged and divided otherwise: 36 triangles, before 36"]);
    assert!(other_diagonals.same && other_diagonals.parts.unchanged == 3);
    let difference = diff(&Obj::plane(1, [0.0; 3]), &Obj::plane(3, [0.0; 3]));
    assert_eq!(difference.summary, ["the surface is unchanged and divided otherwise: 18 triangles, before 2"]);
    assert!(difference.same && difference.geometry.same && difference.geometry.hausdorff.unwrap() < 1e-7);
}

#[test]
fn distances_of_planes_are_those_of_closed_forms() {
    let plane = Obj::plane(8, [0.0; 3]);
    let raised = diff(&plane, &Obj::plane(5, [0.0, 0.0, 0.125]));
    let geometry = raised.geometry;
    assert_eq!((geometry.hausdorff, geometry.mean), (Some(0.125), Some(0.125)), "{geometry:?}");
    assert!(geometry.stated_error.unwrap() <= 1.5e-4, "{geometry:?}");
    // Along itself: what sticks out is from 0 to a quarter away.
    let aside = diff(&plane, &Obj::plane(7, [0.25, 0.0, 0.0])).geometry;
    assert_eq!(aside.hausdorff, Some(0.25));
    let (mean, error) = (aside.mean.unwrap(), aside.mean_error.unwrap());
    assert!(
        (mean - 0.25 * 0.125).abs() < 1e-4 && (mean - 0.25 * 0.125).abs() <= error && error < 0.02,
        "{mean} {error}"
    );
    let [there, back] = [aside.a_to_b.unwrap(), aside.b_to_a.unwrap()];
    assert_eq!((there.at[0], back.at[0]), (0.0, 1.25));
    assert!(texts(&plane.text(), &Obj::plane(5, [0.0, 0.0, 0.125]).text(), Some(0.13)).geometry.same);
    assert!(!texts(&plane.text(), &Obj::plane(5, [0.0, 0.0, 0.125]).text(), Some(0.12)).geometry.same);
}

#[test]
fn distances_of_spheres_are_those_of_closed_forms() {
    let (small, large) = (Obj::sphere(24, 2.0), Obj::sphere(24, 2.5).map(|[x, y, z]| [-x, y, z]));
    let geometry = diff(&small, &large).geometry;
    // Corners lie on spheres, and faces below them by at most the height of a cap.
    let cap = 2.5 * (1.0 - (std::f64::consts::PI / 24.0).cos());
    let (max, mean) = (geometry.hausdorff.unwrap(), geometry.mean.unwrap());
    assert!((max - 0.5).abs() < 1e-5, "{geometry:?}");
    assert!(mean < 0.5 && mean > 0.5 - cap, "{mean}");
    assert!(geometry.stated_error.unwrap() <= 1e-3, "{geometry:?}");
    // The farthest point lies within a face: a plane above a pit that no vertex of the plane faces.
    let pit = |depth: f64| {
        let mut obj = Obj::plane(2, [0.0; 3]);
        obj.vertices[4][2] = -depth;
        obj
    };
    let geometry = diff(&Obj::plane(1, [0.0; 3]), &pit(0.25)).geometry;
    let there = geometry.a_to_b.unwrap();
    let truth = 0.25 * libm::cos(libm::atan2(0.25, 0.5));
    assert!(there.max > 0.1 && there.max <= truth + 1e-6, "{there:?} {truth}");
    assert_eq!(geometry.b_to_a.unwrap().max, 0.25);
}

/// Numbers from 0 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 31)
}

/// The largest distance of many points of `from` to `to`, by looking at every face. Shares no code with the tree.
fn by_force(from: &Obj, to: &Obj) -> f64 {
    let corners = |obj: &Obj| -> Vec<[[f64; 3]; 3]> {
        obj.faces.iter().map(|face| [face[0], face[1], face[2]].map(|v| obj.vertices[v])).collect()
    };
    const PARTS: usize = 16;
    let mut largest: f64 = 0.0;
    for [a, b, c] in corners(from) {
        for (i, j) in
            (0..=PARTS).flat_map(|i| (0..=PARTS - i).map(move |j| (i as f64 / PARTS as f64, j as f64 / PARTS as f64)))
        {
            let point: [f64; 3] = std::array::from_fn(|k| a[k] + i * (b[k] - a[k]) + j * (c[k] - a[k]));
            let nearest = corners(to).into_iter().map(|face| to_face(point, face)).fold(f64::INFINITY, f64::min);
            largest = largest.max(nearest);
        }
    }
    largest
}

/// The distance to a face by its barycentric coordinates.
fn to_face(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let length = |v: [f64; 3]| dot(v, v).sqrt();
    let n = cross(sub(b, a), sub(c, a));
    let weight = |from: [f64; 3], to: [f64; 3]| dot(cross(sub(to, from), sub(p, from)), n) / dot(n, n);
    if weight(a, b) > 0.0 && weight(b, c) > 0.0 && weight(c, a) > 0.0 {
        return (dot(sub(p, a), n) / length(n)).abs();
    }
    let to_line = |from: [f64; 3], to: [f64; 3]| {
        let way = sub(to, from);
        let t = (dot(sub(p, from), way) / dot(way, way)).clamp(0.0, 1.0);
        length(std::array::from_fn(|k| p[k] - from[k] - t * way[k]))
    };
    to_line(a, b).min(to_line(b, c)).min(to_line(c, a))
}

#[test]
fn distances_of_random_meshes_are_those_of_a_brute_force() {
    let mut state = 7;
    for n in 1..8 {
        let mut soup = || {
            let vertices: Vec<[f64; 3]> = (0..3 * n).map(|_| [(); 3].map(|()| random(&mut state))).collect();
            let faces = (0..n).map(|face| vec![3 * face, 3 * face + 1, 3 * face + 2]).collect();
            Obj { vertices, faces, more: String::new() }
        };
        let (a, b) = (soup(), soup());
        let geometry = diff(&a, &b).geometry;
        let error = geometry.stated_error.unwrap();
        for (way, expected) in [(geometry.a_to_b, by_force(&a, &b)), (geometry.b_to_a, by_force(&b, &a))] {
            let found = way.unwrap().max;
            // The brute force sees points of a grid, the search promises an error.
            assert!(found + error + 1e-6 >= expected && found <= expected + 0.1, "{n}: {found} {expected}");
        }
        assert!(error <= 3e-4, "{error}");
    }
}

#[test]
fn materials_and_what_faces_have_of_them_are_compared() {
    let obj = |extra: &str| format!("{extra}{}", three().text());
    let with_uvs = |shift: f64| {
        let cube = Obj::plane(1, [0.0; 3]);
        let vertices: String = cube.vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        format!("{vertices}vt 0 0\nvt 1 0\nvt 1 1\nvt {shift} 1\nf 1/1 2/2 4/3 3/4\n")
    };
    assert!(texts(&with_uvs(0.0), &with_uvs(0.0), None).same);
    let moved = texts(&with_uvs(0.0), &with_uvs(0.5), None);
    assert!(!moved.same && moved.geometry.same, "{moved:#?}");
    assert_eq!(moved.summary[1..], ["1 face has other texture coordinates"]);
    let lost = texts(&with_uvs(0.0), &Obj::plane(1, [0.0; 3]).text(), None);
    assert_eq!((lost.same, lost.summary.last().map(String::as_str)), (false, Some("texture coordinates are gone")));
    let named = texts(&obj("usemtl oak\n"), &obj("usemtl elm\n"), None);
    assert_eq!(named.summary[1..], ["the material \"elm\" is new", "the material \"oak\" is gone"]);
    assert!(!named.materials.same && !named.same && named.geometry.same);
}

#[test]
fn extreme_sizes_and_places_have_an_answer() {
    let cube = Obj::default().cube([0.0; 3], [1.0; 3]);
    let tiny = Obj::default().cube([0.0; 3], [1e-30; 3]);
    let huge = Obj::default().cube([1e30; 3], [1e29; 3]);
    let point = "v 0 0 0\np 1\n";
    for (a, b) in [(&cube, &tiny), (&tiny, &huge), (&huge, &cube)] {
        let difference = diff(a, b);
        assert!(!difference.same && !difference.summary.is_empty(), "{difference:?}");
        assert!(!serde_json::to_string(&difference).unwrap().contains("e999"));
    }
    let difference = texts(point, &cube.text(), None);
    assert!(!difference.same && !difference.summary.is_empty());
    assert!(texts(point, point, None).same);
    // Time is looked at.
    let stopped = compare(&open(&three().text()), &open(&tiny.text()), None, &Deadline::after_polls(2));
    assert!(stopped.is_err());
}

#[test]
fn a_part_that_touches_another_in_one_vertex_is_a_part_of_its_own() {
    // The small cube's lower corner is the large one's upper one, until it moves.
    let text = |by: f64| {
        let obj = Obj::default().cube([0.0; 3], [1.0; 3]).cube([1.5 + by, 1.5, 1.5], [0.5; 3]);
        obj.text()
    };
    let difference = texts(&text(0.0), &text(0.25), None);
    assert_eq!(difference.topology.a.components, 1);
    assert_eq!(difference.summary[0], "one part moved by (0.25, 0, 0)", "{:?}", difference.summary);
    assert_eq!((difference.parts.moved, difference.parts.unchanged), (1, 1), "{:?}", difference.parts);
    assert_eq!(difference.parts.changed + difference.parts.added + difference.parts.removed, 0);
}

#[test]
fn vertices_on_edges_of_others_are_counted_on_both_sides() {
    // A square beside two halves of one: their common corner lies on its edge.
    let plane =
        |text: &str| format!("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nv 1 0.5 0\nv 2 0.5 0\n{text}");
    let square = "f 1 2 3 4\n";
    let (whole, halves) = (plane(&format!("{square}f 2 5 6 3\n")), plane(&format!("{square}f 2 5 8 7\nf 7 8 6 3\n")));
    let difference = texts(&whole, &halves, None);
    let counts = [&difference.topology.a, &difference.topology.b].map(|side| side.t_junctions);
    assert_eq!(counts, [Some(0), Some(1)]);
}
