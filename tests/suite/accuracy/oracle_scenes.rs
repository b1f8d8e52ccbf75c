//! Tests of the oracle's scenes and light: visible parts of edges against its rays; contours,
//! normals and light against known values.

use std::f64::consts::{PI, TAU};

use crate::oracle::camera::{Camera, project};
use crate::oracle::lines::coverage::ink;
use crate::oracle::obj::Shape;
use crate::oracle::screen::{Scene, Screen, Sides};
use crate::oracle::surface::light::{Lamp, Lights, Material, face_normal, lit, smooth_normals, weights};
use crate::oracle::surface::visible::{contour, on_screen, visible, visible_parts};
use crate::oracle::surface::{rays, srgb};
use crate::oracle::vector::{dot, length, mix, sub, unit};
use crate::support::shapes::Random;

#[test]
fn visible_parts_of_edges_are_what_rays_see() {
    let mut random = Random(5);
    let (mut checked, mut hidden) = (0, 0);
    for perspective in [false, true] {
        for _ in 0..30 {
            let scene = soup(perspective, &mut random);
            let screen = Screen::new(&scene);
            for &edge in &scene.edges {
                let Some([a, b]) = on_screen(&scene, edge) else { continue };
                let parts = visible_parts(&screen, edge, [a, b]);
                for i in 0..40 {
                    let t = (f64::from(i) + 0.5) / 40.0;
                    // Rays cannot tell what is within rounding of an end.
                    if parts.iter().flatten().any(|end| (end - t).abs() < 1e-6) {
                        continue;
                    }
                    let p = mix(a, b, t);
                    let at = [p[0], p[1]];
                    let others: Vec<_> =
                        screen.pieces.iter().filter(|piece| !edge.iter().all(|v| piece.vertices.contains(v))).collect();
                    let is_hidden = rays::nearest(&others, at).is_some_and(|(_, depth)| depth > p[2]);
                    let is_visible = parts.iter().any(|[from, to]| (*from..*to).contains(&t));
                    assert_eq!(is_visible, !is_hidden, "edge {edge:?} at {t}: {parts:?}");
                    hidden += usize::from(is_hidden);
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 20_000 && hidden > checked / 10 && hidden < checked * 9 / 10, "{hidden} of {checked} hidden");
}

/// Triangles at random, some reaching behind the eye; their edges.
fn soup(perspective: bool, random: &mut Random) -> Scene {
    let mut camera = Camera::of_pixels([64, 48]);
    if perspective {
        camera.x = [40.0, 0.0, 0.0, 0.0];
        camera.y = [0.0, 40.0, 0.0, 0.0];
        camera.z = [0.0, 0.0, 0.0, 0.05];
        camera.w = [0.0, 0.0, 1.0, 0.0];
        camera.near_w = 0.05;
    }
    let mut corner = |_| {
        if perspective {
            [random.range(-2.0, 2.0), random.range(-2.0, 2.0), random.range(-0.3, 3.0)]
        } else {
            [random.range(-5.0, 70.0), random.range(-5.0, 50.0), random.range(0.1, 0.9)]
        }
    };
    let positions: Vec<_> = (0..36).map(&mut corner).collect();
    let triangles: Vec<[u32; 3]> = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let edges = triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
    Scene { camera, positions, triangles, sides: Sides::Both, edges }
}

#[test]
fn a_cube_shows_nine_edges_and_six_of_them_are_its_contour() {
    let mut positions = Vec::new();
    for i in 0..8 {
        let p = unit([1.0, 0.3, -0.2]).map(|v| v * 20.0);
        let (q, r) = ([-0.2 * 20.0, 0.9 * 20.0, 0.3 * 20.0], [0.1 * 20.0, -0.2 * 20.0, 0.95 * 20.0]);
        let s = [0, 1, 2].map(|k| f64::from(i >> k & 1) - 0.5);
        let at = |k: usize| s[0] * p[k] + s[1] * q[k] + s[2] * r[k];
        positions.push([32.0 + at(0), 24.0 + at(1), 0.5 + 0.01 * at(2)]);
    }
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    let edges: Vec<[u32; 2]> =
        (0..8_u32).flat_map(|i| [1, 2, 4].map(|bit| [i, i | bit])).filter(|e| e[0] != e[1]).collect();
    let scene =
        Scene { camera: Camera::of_pixels([64, 48]), positions, triangles, sides: Sides::Both, edges: edges.clone() };
    let total = |segments: &[[[f64; 2]; 2]]| segments.iter().map(|[a, b]| length(sub(*b, *a))).sum::<f64>();
    assert_eq!(edges.len(), 12);
    let lengths = |of: &[[u32; 2]]| -> Vec<f64> {
        of.iter()
            .map(|&edge| {
                let one = Scene { edges: vec![edge], ..scene.clone() };
                total(&visible(&one, &Screen::new(&one)))
            })
            .collect()
    };
    assert_eq!(lengths(&edges).iter().filter(|&&l| l > 1e-6).count(), 9);
    let contour = contour(&scene);
    assert_eq!(contour.len(), 6);
    assert!(lengths(&contour).iter().all(|&l| l > 1.0));
}

#[test]
fn normals_weights_and_light_are_what_is_known() {
    // A fine sphere's smooth normals point where its vertices do.
    let shape = Shape::net([96, 48], |i, j| {
        let (a, b) = (i as f64 / 96.0 * TAU, (j as f64 / 48.0 - 0.5) * 0.9 * PI);
        [b.cos() * a.cos(), b.cos() * a.sin(), b.sin()]
    });
    let triangles: Vec<[u32; 3]> =
        shape.triangulated().polygons.iter().map(|p| [p[0] as u32, p[1] as u32, p[2] as u32]).collect();
    let normals = smooth_normals(&shape.vertices, &triangles, 30.0);
    let corners = triangles.iter().flatten().map(|&v| v as usize).zip(normals.into_iter().flatten());
    let inner: Vec<(usize, [f64; 3])> =
        corners.filter(|(v, _)| v % 97 > 0 && v % 97 < 96 && (97..97 * 48).contains(v)).collect();
    assert!(inner.iter().all(|(v, normal)| dot(*normal, shape.vertices[*v]) > 0.9999));
    assert!(inner.len() > 6 * 4000);
    // Without creases a cube's corner points along its diagonal, with creases along its faces.
    let vertices: Vec<[f64; 3]> = (0..8).map(|i| [0, 1, 2].map(|k| f64::from(i >> k & 1) - 0.5)).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5_u32]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    for (crease_deg, share) in [(180.0, 3.0_f64.sqrt().recip()), (89.0, 1.0)] {
        let normals = smooth_normals(&vertices, &faces, crease_deg);
        assert!(normals.iter().flatten().flatten().all(|n| n.abs() < 1e-9 || (n.abs() - share).abs() < 1e-9));
    }
    assert_eq!(face_normal([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), Some([0.0, 0.0, 1.0]));

    // Perspective weights: project a known mixture of corners, and find the mixture again.
    let camera = Camera {
        w: [0.0, 0.0, 1.0, 0.0],
        x: [40.0, 0.0, 0.0, 0.0],
        y: [0.0, 40.0, 0.0, 0.0],
        ..Camera::of_pixels([64, 48])
    };
    let mut random = Random(6);
    let mut cases = 0;
    for _ in 0..1000 {
        let corners = [0; 3].map(|_| [random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(1.0, 9.0)]);
        let (u, v) = (random.range(0.1, 0.4), random.range(0.1, 0.4));
        let want = [1.0 - u - v, u, v];
        let point: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| want[i] * corners[i][k]).sum());
        let on = project(camera.homogeneous(point));
        let found = weights(corners.map(|c| camera.homogeneous(c)), [on[0], on[1]]);
        assert!(length(sub(found, want)) < 1e-6, "{found:?}, not {want:?}");
        cases += 1;
    }
    assert_eq!(cases, 1000);

    // Lambert: a lamp at 60 degrees gives half; at roughness 1 the highlight is 0.04 / 6 of that at
    // l.h = 1.
    let lamp = Lamp { to_light: [0.0, 0.0, 1.0], halfway: [0.0, 0.0, 1.0], strength: 1.0 };
    let lights = Lights { lamps: vec![lamp], ambient: 0.0, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
    let tilted = [0.0, (3.0_f64).sqrt() / 2.0, 0.5];
    let color = lit(&Material { base: [0.5; 3], metallic: 0.0, roughness: 1.0 }, &lights, tilted);
    assert!((color[0] - (0.25 + 0.04 / 6.0 * 0.5)).abs() < 1e-12, "{color:?}");
    let dark = lit(&Material { base: [0.5; 3], metallic: 0.0, roughness: 1.0 }, &lights, [0.0, 0.0, -1.0]);
    assert_eq!(dark, [0.0; 3]);
    let ambient = lit(
        &Material { base: [0.5; 3], metallic: 0.0, roughness: 0.6 },
        &Lights { ambient: 0.4, ..lights },
        [0.0, 1.0, 0.0],
    );
    assert!((ambient[0] - 0.2).abs() < 1e-12, "{ambient:?}");

    assert!(
        (0..=1000)
            .all(|i| (srgb::from_linear(srgb::to_linear(f64::from(i) / 1000.0)) * 1000.0 - f64::from(i)).abs() < 1e-6)
    );
}

#[test]
fn pictures_are_their_surface_and_their_ink() {
    let scene = soup(true, &mut Random(7));
    let screen = Screen::new(&scene);
    let segments = visible(&scene, &screen);
    let ink = ink([64, 48], &segments, 2.0, 16);
    let pen = rays::Pen { segments: &segments, width: 2.0, color: [1.0, 0.0, 0.0] };
    let picture = rays::picture(&screen, &pen, [0.0; 3], 16, |_, _| [0.0, 1.0, 0.0]);
    let bare = rays::Pen { segments: &[], ..pen };
    let surface = rays::picture(&screen, &bare, [0.0; 3], 16, |_, _| [0.0, 1.0, 0.0]);
    let mut mixed = 0;
    for (i, pixel) in picture.iter().enumerate() {
        let shares: f64 = rays::shares(&screen, [i as u32 % 64, i as u32 / 64], 16).iter().map(|(_, s)| s).sum();
        assert_eq!(pixel[0], ink[i], "pixel {i}");
        assert!((surface[i][1] - shares).abs() < 1e-9, "pixel {i}");
        assert!(pixel[1] <= surface[i][1] && pixel[0] + pixel[1] >= surface[i][1] - 1e-9, "pixel {i}");
        mixed += usize::from(pixel[0] > 0.0 && pixel[1] > 0.0);
    }
    assert_eq!(picture.len(), 64 * 48);
    assert!(mixed > 200, "{mixed}");
}
