//! The accuracy of lines: isolated ones against closed forms, meshes against the oracle's points.
//! Each gate states the goal and, where the goal is not reached yet, today's measurement, which a
//! change may only make smaller.

use std::path::Path;
use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::plan::{DrawPlan, Edge, LinePass, Shown};

use crate::oracle::lines::{capsule, strip};
use crate::oracle::surface::visible::Segment;
use crate::support::families::lines::{CONTOURS, MESHES, MESHES_GOAL, MeshScene, plan_keys};
use crate::support::truth::{Errors, Gate, cases, drawn_ink, goal, renderers, snapped_ink, true_ink};
use crate::support::{data, scenes};

/// Goal 1.
const ISOLATED_GOAL: Gate = Gate { rmse: 0.35, max: 1.0, ink: f64::INFINITY };
/// Goal 1: how much too wide or narrow, pixels.
const WIDTH_GOAL_PX: f64 = 0.005;

/// Round ends: goal 1's RMSE is reached, its maximum is not yet (measured: 7.3 at some angles, 11.9
/// of all, of 256 points instead of an area).
const ENDS_NOW: Gate = Gate { max: 8.0, ..ISOLATED_GOAL };
const ENDS_AT_ALL_ANGLES_NOW: Gate = Gate { max: 12.0, ..ISOLATED_GOAL };

/// Meshes whose hidden parts fade: measured 1.36, 30.5 (a pixel of wavy quads) and .0005.
const FADED_NOW: Gate = Gate { rmse: 1.5, max: 32.0, ink: 0.001 };

pub const SIZE_PX: u32 = 48;
const WIDTHS_PX: [f32; 9] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0, 16.0];

/// A line pass of opaque white on nothing, so that alpha is coverage.
pub fn line_plan<'a>(positions: &'a [[f32; 3]], edges: &[[u32; 2]], width_px: f32) -> DrawPlan<'a> {
    let edges = edges.iter().map(|&vertices| Edge { vertices, faces: [Edge::NO_FACE; 2] });
    let pass = LinePass::new(Arc::new(edges.collect()), width_px);
    let plan = scenes::screen_plan([SIZE_PX; 2], 4, 1.0, positions, &[]);
    DrawPlan { surface: None, lines: vec![pass], background: [0.0; 4], ..plan }
}

/// Degrees: awkward ones first, all whole ones in the long run.
fn angles() -> Vec<f64> {
    let few = [0.0, 90.0, 45.0, 0.7, 26.565, 11.0, 63.0, 135.0, 152.3];
    let all = (0..180).map(|i| f64::from(i) + 0.3);
    cases(few.to_vec(), few.into_iter().chain(all).collect())
}

/// 64 places within a pixel.
fn offsets(count: u32) -> impl Iterator<Item = [f64; 2]> {
    let side = count.isqrt();
    (0..side * side).map(move |i| [i % side, i / side].map(|k| f64::from(k) / f64::from(side)))
}

/// A line through the picture's middle moved by `offset`, beyond its borders; the position is what
/// f32 has of it.
fn long_line(angle_deg: f64, offset: [f64; 2]) -> [[f32; 3]; 2] {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    [-1.0, 1.0].map(|s| [(offset[0] + 100.3 * s * cos) as f32, (offset[1] + 100.3 * s * sin) as f32, 0.5])
}

/// The coverage of every pixel by a line without ends.
fn strip_ink(ends: [[f32; 3]; 2], width: f32) -> Vec<f64> {
    let [a, b] = ends.map(|p| [0, 1].map(|k| f64::from(p[k]) + 0.5 * f64::from(SIZE_PX)));
    let along = [b[0] - a[0], b[1] - a[1]];
    let length = along[0].hypot(along[1]);
    let n = [-along[1] / length, along[0] / length];
    let pixel = |i: u32| [i % SIZE_PX, i / SIZE_PX].map(|v| f64::from(v) + 0.5);
    let distance = |p: [f64; 2]| (p[0] - a[0]) * n[0] + (p[1] - a[1]) * n[1];
    (0..SIZE_PX * SIZE_PX).map(|i| strip::coverage(distance(pixel(i)), n, f64::from(width))).collect()
}

#[test]
fn isolated_lines_have_their_exact_coverage() {
    let mut missed = Vec::new();
    let mut drawn = 0;
    let mut wanted = 0;
    let [mut rmse, mut max, mut bias] = [0.0_f64; 3];
    for mut renderer in renderers() {
        let count = if renderer.kind().name() == "cpu" { 64 } else { cases(4, 16) };
        for width in WIDTHS_PX {
            let mut errors = Errors::default();
            for angle in angles() {
                for offset in offsets(count) {
                    let ends = long_line(angle, offset);
                    let ink = drawn_ink(&line_plan(&ends, &[[0, 1]], width), renderer.as_mut());
                    errors.add(&Errors::of(&ink, &strip_ink(ends, width)));
                    drawn += 1;
                }
            }
            wanted += angles().len() * count as usize;
            let what = format!("1 isolated, {width} px, {}", renderer.kind().name());
            missed.extend(errors.check(&what, ISOLATED_GOAL).err());
            let bias_px = f64::from(width) * (errors.ink() - 1.0);
            println!("{:<44} {bias_px:+.5} px too wide (gate {WIDTH_GOAL_PX})", what);
            if bias_px.abs() > WIDTH_GOAL_PX {
                missed.push(format!("{what}: {bias_px} px too wide"));
            }
            (rmse, max, bias) = (rmse.max(errors.rmse()), max.max(errors.max()), bias.max(bias_px.abs()));
        }
    }
    goal(1, &format!("RMSE <= {rmse:.2}/255, largest {max:.2}/255, width within {bias:.4} px of {drawn} lines"));
    assert_eq!(drawn, wanted);
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn lines_end_in_round_caps() {
    let mut missed = Vec::new();
    let mut drawn = 0;
    let [mut rmse, mut max] = [0.0_f64; 2];
    let count = 2 * renderers().len() * WIDTHS_PX.len();
    for mut renderer in renderers() {
        for length in [9.0, 0.7] {
            for width in WIDTHS_PX {
                let mut errors = Errors::default();
                for angle in angles() {
                    for offset in offsets(cases(4, 9)) {
                        let (sin, cos) = f64::to_radians(angle).sin_cos();
                        let end = |s: f64| [(offset[0] + s * cos) as f32, (offset[1] + s * sin) as f32, 0.5];
                        let ends = [end(-0.5 * length), end(0.5 * length)];
                        let ink = drawn_ink(&line_plan(&ends, &[[0, 1]], width), renderer.as_mut());
                        errors.add(&Errors::of(&ink, &capsule_ink(ends, width)));
                    }
                }
                let what = format!("- ends, {length} px long, {width} px, {}", renderer.kind().name());
                missed.extend(errors.check(&what, cases(ENDS_NOW, ENDS_AT_ALL_ANGLES_NOW)).err());
                (rmse, max) = (rmse.max(errors.rmse()), max.max(errors.max()));
                drawn += 1;
            }
        }
    }
    goal(1, &format!("round ends: RMSE <= {rmse:.2}, largest {max:.1}"));
    assert_eq!(drawn, count);
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

fn capsule_ink(ends: [[f32; 3]; 2], width: f32) -> Vec<f64> {
    segment_ink(ends.map(|p| [0, 1].map(|k| f64::from(p[k]) + 0.5 * f64::from(SIZE_PX))), width)
}

/// The coverage of every pixel by a line with round ends.
pub fn segment_ink(segment: Segment, width: f32) -> Vec<f64> {
    let pixel = |i: u32| [i % SIZE_PX, i / SIZE_PX].map(|v| f64::from(v) + 0.5);
    (0..SIZE_PX * SIZE_PX).map(|i| capsule::coverage(pixel(i), segment, f64::from(width))).collect()
}

#[test]
fn lines_of_meshes_have_their_exact_coverage() {
    let mut missed = Vec::new();
    let (mut drawn, mut on_lattice) = (0, 0);
    let mut renderers = renderers();
    for scene in MESHES {
        for &width in cases(&[1.0, 2.5][..], &[0.5, 1.0, 1.5, 2.5, 4.0]) {
            drawn += measure(scene, width, &mut renderers, scene.now, "2 mesh", (&mut missed, &mut on_lattice));
        }
    }
    assert!(on_lattice * 20 <= drawn, "{on_lattice} of {drawn} are right only on the lattice");
    assert_eq!(drawn, MESHES.len() * cases(2, 5) * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn silhouettes_have_all_their_ink() {
    let mut missed = Vec::new();
    let (mut drawn, mut on_lattice) = (0, 0);
    let mut renderers = renderers();
    for scene in CONTOURS {
        for &width in cases(&[1.0, 8.0][..], &[0.5, 1.0, 2.0, 4.0, 8.0]) {
            drawn += measure(scene, width, &mut renderers, scene.now, "3 silhouette", (&mut missed, &mut on_lattice));
        }
    }
    assert!(on_lattice * 20 <= drawn, "{on_lattice} of {drawn} are right only on the lattice");
    assert_eq!(drawn, CONTOURS.len() * cases(2, 5) * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Hidden parts count a quarter of visible ones. Whole edges are told by points alone.
#[test]
fn hidden_parts_that_fade_have_their_exact_coverage() {
    let mut missed = Vec::new();
    let mut drawn = 0;
    let mut renderers = renderers();
    for scene in MESHES {
        let mesh = scenes::mesh(&(scene.obj)());
        let spec = scenes::spec(&plan_keys(scene, "1"));
        let mut plan = scenes::plan(&mesh, &spec);
        for pass in &mut plan.lines {
            (pass.shown, pass.unseen_side) = (Shown::Faded, None);
        }
        let truth = true_ink(&plan);
        for renderer in &mut renderers {
            let what = format!("2 faded, {}, {}", scene.name, renderer.kind().name());
            missed.extend(Errors::of(&drawn_ink(&plan, renderer.as_mut()), &truth).check(&what, FADED_NOW).err());
            drawn += 1;
        }
    }
    assert_eq!(drawn, MESHES.len() * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Draws a scene's lines on every back-end; says how many pictures there were.
fn measure(
    scene: &MeshScene,
    width: f64,
    renderers: &mut [Box<dyn Renderer>],
    now: Gate,
    goal: &str,
    (missed, on_lattice): (&mut Vec<String>, &mut usize),
) -> usize {
    let mesh = scenes::mesh(&(scene.obj)());
    let plan_spec = scenes::spec(&plan_keys(scene, &width.to_string()));
    let plan = scenes::plan(&mesh, &plan_spec);
    let truth = true_ink(&plan);
    let mut snapped = None;
    for renderer in renderers.iter_mut() {
        let drawn = drawn_ink(&plan, renderer.as_mut());
        let mut errors = Errors::of(&drawn, &truth);
        assert!(errors.pixels() > 500, "{} shows almost nothing", scene.name);
        let mut what = format!("{goal}, {}, {width} px, {}", scene.name, renderer.kind().name());
        // A face seen less than 1/256 px from edge on may hide a line or not: the snapped lattice
        // decides.
        if !errors.is_within(now) {
            let snapped = snapped.get_or_insert_with(|| snapped_ink(&plan));
            let nearer = |((t, s), d): ((&f64, &f64), &f64)| if (d - s).abs() < (d - t).abs() { *s } else { *t };
            errors = Errors::of(&drawn, &truth.iter().zip(snapped.iter()).zip(&drawn).map(nearer).collect::<Vec<_>>());
            what += ", on the lattice";
            *on_lattice += 1;
        }
        missed.extend(errors.check(&what, now).err());
    }
    renderers.len()
}

#[test]
fn lines_of_a_known_model_have_their_exact_coverage() {
    lines_are_exact(&data::folder("models"), &["spot.obj"]);
}

/// Models whose licences do not allow a copy in the repository.
#[test]
fn lines_of_large_models_have_their_exact_coverage() {
    let Some(folder) = data::large_folder("models") else { return };
    lines_are_exact(&folder, &["suzanne.obj", "stanford-bunny.obj"]);
}

fn lines_are_exact(folder: &Path, names: &[&str]) {
    let mut missed = Vec::new();
    let mut drawn = 0;
    let mut renderers = renderers();
    for name in names {
        let mesh = scenes::mesh_of(&std::fs::read(folder.join(name)).unwrap()).unwrap();
        let keys = [
            ("size", "512x512"),
            ("background", "transparent"),
            ("style", "wireframe"),
            ("wire.hidden", "hide"),
            ("wire.color", "fff"),
            ("wire.edges", "triangles"),
            ("wire.thickness", "1"),
        ];
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        let truth = true_ink(&plan);
        for renderer in &mut renderers {
            let what = format!("2 mesh, {name}, 1 px, {}", renderer.kind().name());
            missed.extend(Errors::of(&drawn_ink(&plan, renderer.as_mut()), &truth).check(&what, MESHES_GOAL).err());
            drawn += 1;
        }
    }
    assert_eq!(drawn, names.len() * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
