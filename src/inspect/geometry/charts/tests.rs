//! Tests of charts, stretch and overlaps against closed forms. Areas of overlaps are also compared with an
//! integration by strips that shares no code with them.

use std::f64::consts::{PI, TAU};

use super::*;
use meshsnap_render::limits::Limits;

/// A grid of n x m quads over the unit square, by the position and the texture coordinates of its points.
fn grid(n: u32, m: u32, at: impl Fn(f64, f64) -> ([f64; 3], [f64; 2])) -> Mesh {
    let mut mesh = Mesh::default();
    for (i, j) in (0..=n).flat_map(|i| (0..=m).map(move |j| (i, j))) {
        let (position, uv) = at(f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
        mesh.positions.push(position.map(|c| c as f32));
        mesh.uvs.push(uv.map(|c| c as f32));
    }
    let point = |i: u32, j: u32| i * (m + 1) + j;
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh.attribute_triangles = mesh.triangles.clone();
    mesh
}

/// Faces in the texture alone, each at corners of its own.
fn flat(faces: &[[[f32; 2]; 3]]) -> Mesh {
    let mut mesh = Mesh::default();
    for (face, corners) in (0_u32..).zip(faces) {
        mesh.positions.extend(corners.map(|[u, v]| [u, v, 0.0]));
        mesh.uvs.extend(corners);
        mesh.triangles.push([0, 1, 2].map(|k| 3 * face + k));
    }
    mesh.attribute_triangles = mesh.triangles.clone();
    mesh
}

fn charts(mesh: &Mesh) -> Charts {
    Charts::of(mesh, &Budget::new(&Limits::default()), &Deadline::default()).unwrap()
}

fn found(mesh: &Mesh) -> Overlaps {
    overlaps(mesh, &Budget::new(&Limits::default()), &Deadline::default()).unwrap().unwrap()
}

#[track_caller]
fn near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value}, and {expected} expected");
}

#[test]
fn a_plane_is_stretched_by_the_ratio_of_its_sides() {
    let mut cases = 0;
    for [width, height] in [[1.0, 1.0], [1.0, 0.25], [0.125, 0.5]] {
        let found = charts(&grid(4, 4, |u, v| ([u * width, v * height, 0.0], [u, 1.0 - v])));
        assert_eq!((found.all.len(), found.faces_without_area), (1, 0));
        let Stretch { l2, linf } = found.all[0].stretch().unwrap();
        near(l2, ((width * width + height * height) / (2.0 * width * height)).sqrt(), 1e-12);
        near(linf, width.max(height) / (width * height).sqrt(), 1e-12);
        near(found.all[0].texture_area, 1.0, 1e-12);
        near(found.all[0].surface_area, width * height, 1e-12);
        assert_eq!((found.all[0].faces, found.all[0].flipped), (32, 0));
        cases += 1;
    }
    assert_eq!(cases, 3);
    let mirrored = charts(&grid(2, 2, |u, v| ([u, v, 0.0], [u, v])));
    assert_eq!((mirrored.all[0].faces, mirrored.all[0].flipped), (8, 8));
}

#[test]
fn an_unrolled_cylinder_is_not_stretched_and_one_that_shrinks_is() {
    let (n, radius) = (96, 0.25);
    // The flat sides of the cylinder are narrower than its arcs.
    let side = 2.0 * radius * libm::sin(PI / f64::from(n));
    let at = |u: f64, v: f64| [radius * libm::cos(TAU * u), v * 0.5, radius * libm::sin(TAU * u)];
    let unrolled = charts(&grid(n, 8, |u, v| (at(u, v), [u * side * f64::from(n), v * 0.5])));
    assert_eq!(unrolled.all.len(), 1);
    let Stretch { l2, linf } = unrolled.all[0].stretch().unwrap();
    near(l2, 1.0, 1e-5);
    near(linf, 1.0, 1e-4);
    // The lower half takes half of the texture's width: areas of 1 and 1/2 for equal surfaces.
    let halves = grid(n, 8, |u, v| (at(u, v), [u * side * f64::from(n) * if v < 0.5 { 0.5 } else { 1.0 }, v * 0.5]));
    assert!(charts(&halves).all[0].stretch().unwrap().l2 > 1.1);
}

#[test]
fn a_sphere_by_latitude_and_longitude_has_the_stretch_of_the_integral() {
    let (radius, top) = (0.5, PI / 3.0);
    let at = |u: f64, v: f64| {
        let latitude = (2.0 * v - 1.0) * top;
        let around = radius * libm::cos(latitude);
        ([around * libm::cos(TAU * u), radius * libm::sin(latitude), around * libm::sin(TAU * u)], [u, v])
    };
    let Stretch { l2, linf } = charts(&grid(384, 192, at)).all[0].stretch().unwrap();
    // Per unit of u: TAU cos(latitude), per unit of v: 2 top; averages are over the surface, whose area is 4 PI sin(top).
    let mean_square = TAU * TAU * (1.0 - libm::sin(top) * libm::sin(top) / 3.0);
    let area = 4.0 * PI * libm::sin(top);
    near(l2, ((mean_square + 4.0 * top * top) / 2.0 / area).sqrt(), 1e-3);
    near(linf, TAU / area.sqrt(), 1e-3);
}

#[test]
fn charts_end_where_texture_coordinates_do() {
    // A strip of 4 quads. Each quad has its own place in the texture, the second and the third next to each other.
    let mut mesh = grid(4, 1, |u, v| ([u, v, 0.0], [u, v]));
    let offsets = [[0.0, 0.0], [0.0, 2.0], [0.0, 2.0], [5.0, 5.0]];
    let old = std::mem::take(&mut mesh.uvs);
    for (face, attributes) in mesh.attribute_triangles.iter_mut().enumerate() {
        for attribute in attributes {
            let [u, v] = old[*attribute as usize];
            *attribute = mesh.uvs.len() as u32;
            let [du, dv] = offsets[face / 2];
            mesh.uvs.push([u + du, v + dv]);
        }
    }
    let found = charts(&mesh);
    assert_eq!(found.all.iter().map(|chart| chart.faces).collect::<Vec<_>>(), [2, 4, 2]);
    assert_eq!(found.whole().faces, 8);
    // Charts that touch in the texture's plane, but not on the surface, are two.
    let two = flat(&[[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]]);
    assert_eq!(charts(&two).all.len(), 2);
    let thin = flat(&[[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[f32::NAN, 0.0], [1.0, 1.0], [0.0, 1.0]]]);
    assert_eq!((charts(&thin).all.len(), charts(&thin).faces_without_area), (0, 2));
    assert_eq!(found_none(&thin), Overlaps::default());
    assert_eq!(charts(&Mesh::default()).all.len(), 0);
}

fn found_none(mesh: &Mesh) -> Overlaps {
    let found = found(mesh);
    assert_eq!((found.faces, found.overlapping), (0, 0.0));
    found
}

#[test]
fn overlaps_have_the_areas_of_squares() {
    let quad = |[x0, y0, x1, y1]: [f32; 4]| [[[x0, y0], [x1, y0], [x1, y1]], [[x0, y0], [x1, y1], [x0, y1]]];
    let squares = |all: &[[f32; 4]]| flat(&all.iter().flat_map(|one| quad(*one)).collect::<Vec<_>>());
    let apart = found_none(&squares(&[[0.0, 0.0, 0.5, 0.5], [0.5, 0.0, 1.0, 0.5], [0.5, 0.5, 1.0, 1.0]]));
    near(apart.covered, 0.75, apart.error);
    let crossing = found(&squares(&[[0.0, 0.0, 0.5, 0.5], [0.25, 0.25, 1.0, 1.0]]));
    near(crossing.covered, 0.25 + 0.5625 - 0.0625, crossing.error);
    near(crossing.overlapping, 0.0625, crossing.error);
    assert!(crossing.error < 1e-12, "{crossing:?}");
    // Three layers count once, and so does each face.
    let layers = found(&squares(&[[0.0, 0.0, 1.0, 1.0]; 3]));
    near(layers.covered, 1.0, layers.error);
    near(layers.overlapping, 1.0, layers.error);
    assert_eq!(layers.faces, 6);
    // A grid's faces share edges and corners, and overlap nowhere.
    let grid = grid(50, 50, |u, v| ([u, v, 0.0], [u * 0.7 + v * 0.1, v * 0.9 - u * 0.2]));
    let covered = found_none(&grid).covered;
    near(covered, 0.7 * 0.9 + 0.1 * 0.2, 1e-5);
}

/// The areas that are covered once and twice or more: exact but for rounding, as all lengths change linearly
/// between the heights of corners and crossings.
fn by_strips(faces: &[[[f32; 2]; 3]]) -> [f64; 2] {
    let faces: Vec<[[f64; 2]; 3]> = faces.iter().map(|face| face.map(|at| at.map(f64::from))).collect();
    let edges: Vec<[[f64; 2]; 2]> = faces.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
    let mut heights: Vec<f64> = faces.iter().flatten().map(|at| at[1]).collect();
    for (i, [a, b]) in edges.iter().enumerate() {
        for [c, d] in &edges[i + 1..] {
            let [r, s] = [[b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]];
            let across = r[0] * s[1] - r[1] * s[0];
            let t = ((c[0] - a[0]) * s[1] - (c[1] - a[1]) * s[0]) / across;
            if (0.0..=1.0).contains(&t) {
                heights.push(a[1] + t * r[1]);
            }
        }
    }
    heights.sort_by(f64::total_cmp);
    let mut sums = [0.0; 2];
    for pair in heights.windows(2) {
        let (middle, height) = ((pair[0] + pair[1]) / 2.0, pair[1] - pair[0]);
        // The spans of all faces at this height: where each begins and ends.
        let mut ends: Vec<(f64, i32)> = Vec::new();
        for [a, b, c] in &faces {
            let crossings: Vec<f64> = [[a, b], [b, c], [c, a]]
                .iter()
                .filter(|[p, q]| (p[1] - middle) * (q[1] - middle) < 0.0)
                .map(|[p, q]| p[0] + (q[0] - p[0]) * (middle - p[1]) / (q[1] - p[1]))
                .collect();
            if let [one, other] = crossings[..] {
                ends.extend([(one.min(other), 1), (one.max(other), -1)]);
            }
        }
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut depth = 0;
        for pair in ends.windows(2) {
            depth += pair[0].1;
            let area = (pair[1].0 - pair[0].0) * height;
            sums[0] += if depth >= 1 { area } else { 0.0 };
            sums[1] += if depth >= 2 { area } else { 0.0 };
        }
    }
    sums
}

#[test]
fn overlaps_of_random_faces_are_those_of_a_brute_force() {
    let mut state = 7_u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let (mut cases, mut overlapping, mut apart) = (0, 0, 0);
    for case in 0..400 {
        // By turns on a coarse grid, where much coincides, and anywhere.
        let cells = if case % 2 == 0 { 8 } else { 1 << 20 };
        let count = 2 + random(12);
        let mut corner = || [0, 1].map(|_| random(cells) as f32 / cells as f32 * 4.0 - 1.0);
        let faces: Vec<[[f32; 2]; 3]> = (0..count).map(|_| [0, 1, 2].map(|_| corner())).collect();
        let mesh = flat(&faces);
        let found = found(&mesh);
        let [covered, twice] = by_strips(&faces);
        near(found.covered, covered, found.error + 1e-9);
        near(found.overlapping, twice, found.error + 1e-9);
        assert!(found.error < 1e-9, "{}", found.error);
        let has_area = |face: &&[[f32; 2]; 3]| by_strips(&[**face])[0] > 1e-12;
        let faces: Vec<_> = faces.iter().filter(has_area).collect();
        let others = |i: usize| faces.iter().enumerate().filter(move |(j, _)| *j != i);
        let meets = |i: &usize| others(*i).any(|(_, other)| by_strips(&[*faces[*i], **other])[1] > 1e-9);
        let expected = (0..faces.len()).filter(meets).count() as u64;
        assert_eq!(found.faces, expected, "{faces:?}");
        overlapping += expected;
        apart += faces.len() as u64 - expected;
        cases += 1;
    }
    assert!(cases == 400 && overlapping > 1500 && apart > 20, "{overlapping} faces overlap, {apart} do not");
}

#[test]
fn threads_change_nothing_and_too_much_is_told() {
    let mesh = grid(60, 60, |u, v| ([u, v, 0.0], [libm::sin(7.0 * u) * 0.4, v + 0.3 * libm::sin(9.0 * u)]));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&mesh))
    };
    let one = with(1);
    assert!(one.faces > 1000 && one.overlapping > 0.1, "{one:?}");
    assert_eq!(one, with(3));
    let same = flat(&vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]; 3_000]);
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    assert!(overlaps(&same, &budget, &deadline).unwrap().is_none());
    assert!(matches!(overlaps(&mesh, &budget, &Deadline::after_polls(9)), Err(Exhausted::Stopped(_))));
    let small = Budget::new(&Limits::default().with(|limits| limits.memory_bytes = 1000));
    assert!(matches!(overlaps(&mesh, &small, &deadline), Err(Exhausted::Limit(_))));
    assert!(matches!(Charts::of(&mesh, &small, &deadline), Err(Exhausted::Limit(_))));
}
