//! Turns plans into what the oracle takes, in f64: scene, visible segments, material, lights and
//! normals.

use meshsnap_render::plan::{DrawPlan, Faces, Shown, SurfacePass};

use crate::oracle::camera::{Camera, project};
use crate::oracle::coverage::{Coverage, classify, snap};
use crate::oracle::screen::{Scene, Screen, Sides};
use crate::oracle::surface::light::{Lamp, Lights, Material, face_normal, lit, smooth_normals, weights};
use crate::oracle::surface::rays::{Pen, nearest, picture};
use crate::oracle::surface::visible::{self, Segment};
use crate::oracle::vector::{V2, V3, cross, dot, unit};

/// The plan's numbers and nothing else: its geometry, and the edges of its first line pass.
pub fn scene(plan: &DrawPlan<'_>) -> Scene {
    assert!(
        plan.pass_masks.is_empty() && plan.peeling.is_none() && plan.hull.is_none(),
        "the oracle draws one surface"
    );
    let row = |r: [f32; 4], scale: f64| r.map(|v| f64::from(v) * scale);
    let p = &plan.projection;
    let sides = plan.surface.as_ref().map_or(Sides::Neither, |surface| match surface.faces {
        Faces::Both => Sides::Both,
        Faces::Front => Sides::Front,
        Faces::Back => Sides::Back,
    });
    Scene {
        camera: Camera {
            size_px: [plan.width_px, plan.height_px],
            x: row(p.x, 1.0 / 256.0),
            y: row(p.y, 1.0 / 256.0),
            z: row(p.z, 1.0),
            w: row(p.w, 1.0),
            near_w: f64::from(p.near_w),
        },
        positions: plan.positions.iter().map(|v| v.map(f64::from)).collect(),
        triangles: plan.triangles.to_vec(),
        sides,
        edges: plan.lines.first().map_or_else(Vec::new, |pass| pass.edges.iter().map(|edge| edge.vertices).collect()),
    }
}

/// The segments of the plan's only line pass that are drawn in full colour.
pub fn segments(plan: &DrawPlan<'_>) -> Vec<Segment> {
    segments_of(plan, scene(plan))
}

/// The scene with its vertices on the lattice of 1/256 px on which triangles are drawn; all must be in
/// front of the eye. Depth is affine on screen, so that what hides what stays the same but for what
/// is seen nearly edge on.
pub fn snapped_scene(plan: &DrawPlan<'_>) -> Scene {
    let mut scene = scene(plan);
    for position in &mut scene.positions {
        let [x, y, depth] = project(scene.camera.homogeneous(*position));
        *position = [(x * 256.0).round() / 256.0, (y * 256.0).round() / 256.0, depth];
    }
    scene.camera = Camera::of_pixels(scene.camera.size_px);
    scene
}

/// As [`segments`], of a scene of the plan's.
pub fn segments_of(plan: &DrawPlan<'_>, mut scene: Scene) -> Vec<Segment> {
    let [pass] = &plan.lines[..] else { panic!("{} line passes", plan.lines.len()) };
    if pass.contour {
        scene.edges = visible::contour(&scene);
    }
    match pass.shown {
        Shown::All => visible::all(&scene),
        Shown::Visible | Shown::Faded => visible::visible(&scene, &Screen::new(&scene)),
    }
}

/// The triangle that is all that is seen in a pixel.
pub fn only_triangle(screen: &Screen, pixel: [u32; 2]) -> Option<u32> {
    let corner = pixel.map(f64::from);
    let pieces = screen.near(&[corner, [corner[0] + 1.0, corner[1] + 1.0]]);
    let places = [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let mut seen = places.iter().map(|p| nearest(&pieces, [corner[0] + p[0], corner[1] + p[1]]));
    let (piece, _) = seen.next()??;
    let snapped = piece.corners.map(|c| snap([c[0], c[1]]));
    let is_full = classify(snapped, pixel.map(i64::from)) == Coverage::Full;
    (is_full && seen.all(|s| s.is_some_and(|(other, _)| other.triangle == piece.triangle))).then_some(piece.triangle)
}

/// The one material of a surface.
pub fn material(surface: &SurfacePass<'_>) -> Material {
    let [look] = &surface.materials[..] else { panic!("{} materials", surface.materials.len()) };
    let [r, g, b, _] = look.base_color.map(f64::from);
    Material { base: [r, g, b], metallic: f64::from(look.metallic), roughness: f64::from(look.roughness) }
}

/// The lights on a plan's surface.
pub fn lights(plan: &DrawPlan<'_>) -> Lights {
    let lights = &plan.surface.as_ref().unwrap().lights;
    let wide = |v: [f32; 3]| v.map(f64::from);
    let lamps = lights.lamps.iter().map(|lamp| Lamp {
        to_light: wide(lamp.to_light),
        halfway: wide(lamp.halfway),
        strength: f64::from(lamp.strength),
    });
    let axes = [plan.projection.screen_right, plan.projection.screen_up, plan.projection.to_viewer].map(wide);
    Lights { lamps: lamps.collect(), ambient: f64::from(lights.ambient), axes }
}

/// Exact normals by corner of each triangle.
pub fn corner_normals(scene: &Scene, is_smooth: bool) -> Vec<[V3; 3]> {
    if is_smooth {
        return smooth_normals(&scene.positions, &scene.triangles, 30.0);
    }
    let flat = |t: &[u32; 3]| [face_normal(t.map(|v| scene.positions[v as usize])).unwrap_or([0.0, 0.0, 1.0]); 3];
    scene.triangles.iter().map(flat).collect()
}

/// The exact unit normal on the viewer's side at a point of a triangle, from those at the triangles' corners.
pub fn normal_at(scene: &Scene, normals: &[[V3; 3]], triangle: u32, p: V2) -> V3 {
    let corners = scene.triangles[triangle as usize].map(|v| scene.camera.homogeneous(scene.positions[v as usize]));
    let [a, b, c] = corners.map(|h| [h[0], h[1], h[3]]);
    let side = if dot(a, cross(b, c)) < 0.0 { 1.0 } else { -1.0 };
    let share = weights(corners, p);
    let of = |k: usize| side * (0..3).map(|i| share[i] * normals[triangle as usize][i][k]).sum::<f64>();
    unit([of(0), of(1), of(2)])
}

/// The exact linear colours of a plan's faces and of the lines over them, from `side` squared points in each pixel.
pub fn whole_picture(plan: &DrawPlan<'_>, is_smooth: bool, side: u32) -> Vec<V3> {
    let scene = scene(plan);
    let normals = corner_normals(&scene, is_smooth);
    let (material, lights) = (material(plan.surface.as_ref().unwrap()), lights(plan));
    let shade = |triangle: u32, p: V2| lit(&material, &lights, normal_at(&scene, &normals, triangle, p));
    let background = [0, 1, 2].map(|k| f64::from(plan.background[k]));
    let pass = plan.lines.first();
    let segments = pass.map_or_else(Vec::new, |_| segments(plan));
    let color = pass.map_or([0.0; 3], |pass| [0, 1, 2].map(|k| f64::from(pass.color[k])));
    let pen = Pen { segments: &segments, width: pass.map_or(0.0, |pass| f64::from(pass.width_px)), color };
    picture(&Screen::new(&scene), &pen, background, side, shade)
}
