//! Tests that the gates can fail: they refuse what is wrong in the way of a known technique, such
//! as normals in f32, and let pass what is right and made by the same means.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::accuracy::behind_eye::eye_plan;
use crate::accuracy::geometry::{Ownership, jittered_net};
use crate::accuracy::shading::{COLOR_GOAL, FLAT_NOW, NORMAL_GOAL_RAD, color_errors, normal_error, slivers};
use crate::oracle::camera::{Homogeneous, project};
use crate::oracle::screen::Screen;
use crate::oracle::surface::light::{face_normal, weights};
use crate::oracle::vector::{V2, V3, cross2, distance_to_segment, length, sub};
use crate::oracle::{lines::strip, surface::srgb};
use crate::support::families::lines::{MESHES, MESHES_GOAL, plan_keys};
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{Errors, scene, true_ink};

/// Every triangle with vertices of its own, moved away from its middle by `grow` pixels.
fn apart(positions: &[[f32; 3]], triangles: &[[u32; 3]], grow: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut own = Vec::new();
    for triangle in triangles {
        let corners = triangle.map(|v| positions[v as usize]);
        let middle = [0, 1].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
        for p in corners {
            let way = [p[0] - middle[0], p[1] - middle[1]];
            let scale = grow / way[0].hypot(way[1]);
            own.push([p[0] + scale * way[0], p[1] + scale * way[1], p[2]]);
        }
    }
    let triangles = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (own, triangles)
}

/// Without the rule that gives a shared edge's samples to one side, both sides take them, or
/// neither does: as if each triangle were a hair larger or smaller.
#[test]
fn a_missing_fill_rule_is_found() {
    let (positions, triangles) = jittered_net(100, [256; 2], &mut Random(41));
    let found = |grow: f32| {
        let (positions, triangles) = apart(&positions, &triangles, grow);
        let plan = scenes::screen_plan([256; 2], 4, 1.0, &positions, &triangles);
        Ownership::of(&plan, &mut CpuRenderer::new(2))
    };
    let (right, both, neither) = (found(0.0), found(1.0 / 128.0), found(-1.0 / 128.0));
    right.check("the rule").unwrap();
    assert!(both.check("both sides").is_err() && both.double > 100, "{both:?}");
    assert!(neither.check("neither side").is_err() && neither.missing > 100, "{neither:?}");
}

/// White lines on a black surface on nothing, read back from sRGB.
fn ink_on_surface(scene: usize, method: &str, thickness: &str) -> Vec<f64> {
    let mesh = scenes::mesh(&(MESHES[scene].obj)());
    let mut keys = plan_keys(&MESHES[scene], thickness);
    keys.extend([("surface.shading", "unlit"), ("surface.color", "000"), ("wire.method", method)]);
    let spec = scenes::spec(&keys);
    let image = CpuRenderer::new(2).draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap();
    image.rgba.chunks(4).map(|p| srgb::to_linear(f64::from(p[0]) / 255.0) * f64::from(p[3]) / 255.0).collect()
}

#[test]
fn fwidth_in_place_of_exact_distances_is_found() {
    let mut found = 0;
    for (i, mesh_scene) in MESHES.iter().enumerate().filter(|(_, s)| ["12 px grid", "48-fan", "cube"].contains(&s.name))
    {
        let mesh = scenes::mesh(&(mesh_scene.obj)());
        let exact_spec = scenes::spec(&plan_keys(mesh_scene, "1"));
        let truth = true_ink(&scenes::plan(&mesh, &exact_spec));
        let check = |method: &str, thickness: &str| {
            let what = format!("{}, {method}", mesh_scene.name);
            Errors::of(&ink_on_surface(i, method, thickness), &truth).check(&what, mesh_scene.now)
        };
        check("exact", "1").unwrap();
        // Half a pixel on each side, and a pixel's ramp: what fwidth has to offer for a line of one
        // pixel.
        assert!(check("fwidth", "0.5").is_err() && check("fwidth", "0").is_err());
        found += 1;
    }
    assert_eq!(found, 3);
}

#[test]
fn f32_face_normals_are_found() {
    let mut random = Random(42);
    let shape = slivers(1e5, 1e3, &mut random);
    let mesh = scenes::mesh(&shape.text());
    let spec = scenes::spec(&[("style", "flat"), ("size", "64x64")]);
    let plan = scenes::plan(&mesh, &spec);
    let right = &plan.surface.as_ref().unwrap().face_normals;
    let wrong: Vec<[f32; 3]> =
        shape.polygons.iter().map(|p| f32_normal([0, 1, 2].map(|k| shape.vertices[p[k]]))).collect();
    assert!(normal_error(&shape, right) <= NORMAL_GOAL_RAD);
    assert!(normal_error(&shape, &wrong) > NORMAL_GOAL_RAD);
}

/// As a renderer does that reads positions as f32 and multiplies in f32.
fn f32_normal(corners: [V3; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(|p| p.map(|v| v as f32));
    let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|v| v / length) } else { [0.0, 0.0, 1.0] }
}

#[test]
fn f32_face_normals_are_seen_in_the_picture() {
    // A hill far from the origin, as a map's coordinates are: f32 has a sixteenth of a unit there.
    let far = |p: V3| [p[0] + 500_000.0, p[1] + 20.0, p[2] + 700_000.0];
    let hill = crate::oracle::obj::Shape::net([6, 6], |i, j| {
        let (x, z) = (i as f64 / 3.0 - 1.0, j as f64 / 3.0 - 1.0);
        [x, 0.4 * (3.0 * x).sin() * (2.0 * z).cos(), -z]
    });
    let hill = hill.triangulated().map(far);
    let mesh = scenes::mesh(&hill.text());
    let spec = scenes::spec(&[("style", "flat"), ("size", "200x160"), ("surface.metallic", "0")]);
    let mut plan = scenes::plan(&mesh, &spec);
    let corners = |p: &Vec<usize>| [0, 1, 2].map(|k| hill.vertices[p[k]]);
    let truth: Vec<[V3; 3]> = hill.polygons.iter().map(|p| [face_normal(corners(p)).unwrap(); 3]).collect();
    let wrong: Vec<[f32; 3]> = hill.polygons.iter().map(|p| f32_normal(corners(p))).collect();
    let measure = |plan: &DrawPlan<'_>| {
        let errors = color_errors(plan, &CpuRenderer::new(2).draw(plan, &Deadline::default()).unwrap(), &truth);
        println!("{} pixels, off by {:.2}", errors.pixels, errors.max);
        assert!(errors.pixels > 3000);
        errors.max
    };
    assert!(measure(&plan) <= FLAT_NOW);
    plan.surface.as_mut().unwrap().face_normals = (&wrong).into();
    assert!(measure(&plan) > COLOR_GOAL);
}

/// Distances to a triangle's sides as its corners have them, interpolated: affinely on screen,
/// which is right, or along the surface, as attributes of a vertex are. Compared deep inside of
/// each side's line, where no other is near.
#[test]
fn perspective_interpolated_edge_distances_are_found() {
    let positions = [[-0.9, 0.5, 1.0], [0.8, 0.6, 1.2], [0.1, -2.5, 6.0]];
    let plan = eye_plan([96, 64], &positions, &[[0, 1, 2]], 0.05);
    let scene = scene(&plan);
    let corners = [0, 1, 2].map(|v: usize| scene.camera.homogeneous(scene.positions[v]));
    let at = corners.map(project).map(|p| [p[0], p[1]]);
    // Of corner k from the side opposite to it.
    let height = |k: usize| {
        let (b, c) = (at[(k + 1) % 3], at[(k + 2) % 3]);
        cross2(sub(c, b), sub(at[k], b)).abs() / length(sub(c, b))
    };
    let heights = [height(0), height(1), height(2)];
    let screen = Screen::new(&scene);
    let flat = corners.map(|h| [h[0] / h[3], h[1] / h[3], 0.0, 1.0]);
    let width = 3.0;
    let (mut truth, mut affine, mut perspective) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..96 * 64 {
        let p = [f64::from(i % 96) + 0.5, f64::from(i / 96) + 0.5];
        let Some(k) = side_alone(at, p).filter(|_| screen.pieces[0].depth(p).is_some()) else { continue };
        let (b, c) = (at[(k + 1) % 3], at[(k + 2) % 3]);
        let along = sub(c, b);
        let n = [-along[1] / length(along), along[0] / length(along)];
        let ink = |distance: f64| strip::coverage(distance, n, width);
        truth.push(ink(distance_to_segment(p, b, c)));
        let interpolated = |corners: [Homogeneous; 3]| ink(weights(corners, p)[k] * heights[k]);
        affine.push(interpolated(flat));
        perspective.push(interpolated(corners));
    }
    assert!(truth.iter().filter(|&&t| t > 0.0).count() > 100);
    Errors::of(&affine, &truth).check("interpolated on screen", MESHES_GOAL).unwrap();
    let wrong = Errors::of(&perspective, &truth);
    assert!(wrong.check("interpolated in perspective", MESHES_GOAL).is_err());
    // And so far off that the gates let none of it pass as they stand today.
    assert!(MESHES.iter().filter(|s| s.name == "triangle").all(|s| wrong.rmse() > s.now.rmse));
}

/// The side that a point is near to, if it is far from the other two.
fn side_alone(at: [V2; 3], p: V2) -> Option<usize> {
    let distance = |k: usize| distance_to_segment(p, at[(k + 1) % 3], at[(k + 2) % 3]);
    (0..3).find(|&k| distance(k) < 5.0 && distance((k + 1) % 3) > 8.0 && distance((k + 2) % 3) > 8.0)
}
