//! Lines behind what is transparent take its tint; lines before it, and those that run along it, do not.

use std::borrow::Cow;
use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::{Image, srgb8_thresholds};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{
    DrawPlan, Edge, Faces, LinePass, PeelingPass, ShadedMaterial, Shown, SurfacePass, flags, pass_mask,
};

use crate::render::adaptive::last_of_each;
use crate::support::gpus::{gpus, gpus_of_case};
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes::{self, Obj};

const SIZE_PX: [u32; 2] = [120, 128];
const PANES: usize = 7;
/// Layers that are told apart; those from the last of them on count as one.
const TOLD_APART: usize = 4;
/// Pixels from one line to the next.
const PITCH_PX: usize = 14;
const LINE: [f32; 4] = [0.72, 0.09, 0.03, 0.9];

/// Premultiplied linear RGBA, nearest first.
fn pane(k: usize) -> [f32; 4] {
    let [r, g, b] = [[0.9, 0.3, 0.1], [0.1, 0.5, 0.9], [0.3, 0.8, 0.2]][k % 3];
    let alpha = 0.2 + 0.05 * k as f32;
    [r * alpha, g * alpha, b * alpha, alpha]
}

fn depth_of_pane(k: usize) -> f32 {
    0.9 - 0.1 * k as f32
}

/// Height of the line with `front` panes before it, pixels from the picture's centre.
fn height_of_line(front: usize) -> f32 {
    (front * PITCH_PX + PITCH_PX / 2) as f32 - SIZE_PX[1] as f32 / 2.0
}

/// Panes one behind the other, each as large as the picture; `tilt` is the change of the nearest one's depth per pixel to
/// the right, from the middle.
fn panes(tilt: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let [x, y] = SIZE_PX.map(|size| size as f32 / 2.0);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for k in 0..PANES {
        let (z, tilt, at) = (depth_of_pane(k), if k == 0 { tilt } else { 0.0 }, positions.len() as u32);
        positions.extend([[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| [x, y, z + tilt * x]));
        triangles.extend([[at, at + 1, at + 2], [at, at + 2, at + 3]]);
    }
    (positions, triangles)
}

/// The panes, and a line across the picture before them all, one between each two, and one behind them all.
fn plan<'a>(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]], samples: u32) -> DrawPlan<'a> {
    let edge = |line: usize| Edge {
        vertices: [0, 1].map(|end| (4 * PANES + 2 * line + end) as u32),
        faces: [Edge::NO_FACE; 2],
    };
    let pass = LinePass {
        color: LINE,
        shown: Shown::Visible,
        is_tinted: true,
        ..LinePass::new(Arc::new((0..=PANES).map(edge).collect()), 6.0)
    };
    let look = |k: usize| {
        let [r, g, b, alpha] = pane(k);
        let look = ShadedMaterial::unlit([r / alpha, g / alpha, b / alpha, alpha]);
        ShadedMaterial { flags: look.flags | flags::BLEND, ..look }
    };
    let mut surface = SurfacePass::new(Faces::Both, (0..PANES).map(look).collect());
    surface.triangle_materials = (0..2 * PANES as u32).map(|t| t / 2).collect::<Vec<_>>().into();
    DrawPlan {
        surface: Some(surface),
        pass_masks: Cow::Owned(vec![pass_mask::LAYER; triangles.len()]),
        peeling: Some(PeelingPass { count_max: 16, behind_surface: false, wires_only: false, fade: 1.0 }),
        lines: vec![pass],
        background: [0.2, 0.4, 0.1, 1.0],
        ..scenes::screen_plan(SIZE_PX, samples, 1.0, positions, triangles)
    }
}

/// The panes' positions, and the ends of the lines.
fn with_lines(mut positions: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    for front in 0..=PANES {
        let (y, z) = (height_of_line(front), depth_of_pane(front) + 0.05);
        positions.extend([[-80.0, y, z], [80.0, y, z]]);
    }
    positions
}

fn over(front: [f32; 4], behind: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|k| front[k] + (1.0 - front[3]) * behind[k])
}

/// A pixel covered by a line with these panes before it, linear.
fn truth(front: &[usize], background: [f32; 4]) -> [f32; 4] {
    let behind = (0..PANES).filter(|k| !front.contains(k)).rev().fold(background, |under, k| over(pane(k), under));
    front.iter().rev().fold(over(LINE, behind), |under, &k| over(pane(k), under))
}

fn cpus() -> Vec<Box<dyn Renderer>> {
    let mut all: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::plain(1)), Box::new(CpuRenderer::new(2))];
    all.extend(Isa::available().into_iter().map(|isa| Box::new(CpuRenderer::with_isa(1, isa)) as Box<dyn Renderer>));
    all
}

fn renderers() -> Vec<Box<dyn Renderer>> {
    let mut all = cpus();
    all.extend(gpus().into_iter().flatten().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>));
    all
}

fn draw(renderer: &mut dyn Renderer, plan: &DrawPlan<'_>) -> Image {
    renderer.draw(plan, &Deadline::default()).unwrap()
}

/// A byte of sRGB from the linear value.
fn byte(v: f32) -> i32 {
    srgb8_thresholds().iter().filter(|&&threshold| v >= threshold).count() as i32
}

/// Asserts the colour of a pixel to one step.
fn assert_pixel(image: &Image, [x, y]: [usize; 2], want: [f32; 4], what: &str) {
    let found = image.rgba.as_chunks::<4>().0[y * image.width_px as usize + x];
    for k in 0..3 {
        let want = byte(want[k]);
        assert!((i32::from(found[k]) - want).abs() <= 1, "{what} at {x}, {y}: {found:?}, channel {k} should be {want}");
    }
}

#[test]
fn a_line_takes_the_tint_of_what_lies_before_it() {
    let (positions, triangles) = panes(0.0);
    let positions = with_lines(positions);
    let mut cases = 0;
    for samples in [1, 4, 16] {
        let plan = plan(&positions, &triangles, samples);
        for renderer in &mut renderers() {
            let image = draw(renderer.as_mut(), &plan);
            for front in 0..=PANES {
                let y = front * PITCH_PX + PITCH_PX / 2;
                // Of the panes that count as one, all lie before the line, or none.
                let counted = if (TOLD_APART..PANES).contains(&front) { TOLD_APART - 1 } else { front };
                let before: Vec<usize> = (0..counted).collect();
                for x in [3, 60, 116] {
                    assert_pixel(&image, [x, y], truth(&before, plan.background), &format!("{front} panes"));
                    cases += 1;
                }
                let between = (0..PANES).rev().fold(plan.background, |under, k| over(pane(k), under));
                assert_pixel(&image, [60, y + PITCH_PX / 2], between, "no line");
            }
        }
    }
    assert!(cases >= 3 * 4 * (PANES + 1) * 3, "{cases}");
    let [first, last] = [0, PANES].map(|front| truth(&(0..front).collect::<Vec<_>>(), [0.0; 4]));
    assert!((first[0] - last[0]).abs() > 0.2, "{first:?} {last:?}: tint or not, it would be the same");
}

/// The nearest pane goes through the line that lies before the others.
#[test]
fn a_line_through_a_pane_takes_its_tint_up_to_where_it_comes_out() {
    for tilt in [0.001, -0.001, 0.0001] {
        let (positions, triangles) = panes(tilt);
        let mut positions = with_lines(positions);
        // The first line lies in the middle of the pane.
        for end in 0..2 {
            positions[4 * PANES + end][2] = depth_of_pane(0);
        }
        let plan = plan(&positions, &triangles, 4);
        for renderer in &mut renderers() {
            let image = draw(renderer.as_mut(), &plan);
            for x in [4, 30, 44, 78, 90, 115] {
                let is_before = (x > 60) == (tilt > 0.0);
                let before: &[usize] = if is_before { &[0] } else { &[] };
                assert_pixel(&image, [x, PITCH_PX / 2], truth(before, plan.background), &format!("tilt {tilt}"));
            }
        }
    }
}

/// Lines on a sheet of glass that covers no part of itself.
#[test]
fn lines_along_glass_are_as_dark_as_without_a_tint() {
    let mesh = scenes::mesh(&shapes::sheet(24));
    let (mut cases, mut renderers) = (0, renderers());
    for (width, view) in [("1", "0,4,0.5"), ("3", "0,4,0.5"), ("8", "0,4,0.5"), ("2", "1.5,4,1")] {
        for projection in ["perspective", "orthographic"] {
            let keys = [
                ("size", "200x180"),
                ("style", "wire"),
                ("wire.thickness", width),
                ("wire.color", "a20"),
                ("surface.opacity", "0.5"),
                ("camera.eye", view),
                ("camera.target", "0,0,0"),
                ("camera.projection", projection),
            ];
            let plan = scenes::plan(&mesh, &scenes::spec(&keys));
            assert!(plan.lines.iter().all(|lines| lines.is_tinted) && !plan.lines.is_empty());
            let mut untinted = scenes::plan(&mesh, &scenes::spec(&keys));
            untinted.lines.iter_mut().for_each(|lines| lines.is_tinted = false);
            for renderer in &mut renderers {
                let [found, want] = [&plan, &untinted].map(|plan| draw(renderer.as_mut(), plan));
                assert!(found == want, "{width} px from {view}, {projection}");
                cases += 1;
            }
        }
    }
    assert!(cases >= 8 * 4, "{cases}");
}

/// The contour of a closed surface lies on it: nothing of the surface is in front of it.
#[test]
fn contours_of_glass_are_as_dark_as_without_a_tint() {
    let mut ball = Obj::default();
    ball.ball([0.0; 3], 1.0, 90);
    let meshes = [ball.finish(), shapes::torus(60), shapes::cube()].map(|obj| scenes::mesh(&obj));
    let (mut cases, mut renderers) = (0, renderers());
    for (width, first) in [("1", 3), ("3", 3), ("12", 3), ("30", 1)] {
        // The widest is wider than the ring.
        for (i, mesh) in meshes.iter().take(first).enumerate() {
            let keys = [
                ("size", "160"),
                ("style", "smooth"),
                ("outline.method", "contour"),
                ("outline.unit", "px"),
                ("outline.thickness", width),
                ("outline.color", "a20"),
                ("surface.opacity", "0.5"),
                // From above nothing of the ring lies before another part of it.
                ("camera.view", "top"),
            ];
            let plan = scenes::plan(mesh, &scenes::spec(&keys));
            assert!(plan.tints_lines());
            let mut untinted = scenes::plan(mesh, &scenes::spec(&keys));
            untinted.lines.iter_mut().for_each(|lines| lines.is_tinted = false);
            for renderer in &mut renderers {
                let [found, want] = [&plan, &untinted].map(|plan| draw(renderer.as_mut(), plan));
                assert!(found == want, "{width} px around mesh {i}");
                cases += 1;
            }
        }
    }
    assert!(cases >= 10 * 4, "{cases}");
}

/// A ball behind one of glass, also so near that the glass goes on behind the eye; lines of all kinds.
#[test]
fn both_back_ends_tint_alike() {
    let mesh = scenes::mesh(&shapes::two_balls());
    let glass = [
        ("size", "200x160"),
        ("camera.target", "0,0,0"),
        ("materials.left.surface.opacity", "0.4"),
        ("materials.left.surface.color", "48c"),
    ];
    let looks: [&[(&str, &str)]; 8] = [
        // Several bands on a GPU, the last of them a short one.
        &[("size", "900x200"), ("style", "wire"), ("camera.eye", "-4,1.2,5"), ("samples", "16")],
        &[("style", "technical"), ("camera.eye", "-4,1.2,5")],
        &[("style", "wire"), ("camera.eye", "-4,1.2,5"), ("samples", "1")],
        &[
            ("style", "wire"),
            ("camera.eye", "-4,1.2,5"),
            ("wire.lit", "true"),
            ("wire.thickness", "3"),
            ("samples", "8"),
        ],
        &[("style", "wire"), ("camera.eye", "-4,1.2,5"), ("wire.opacity", "0.5"), ("wire.smoothing", "2")],
        &[("style", "wire"), ("camera.eye", "-4,1.2,5"), ("wire.hidden", "fade"), ("background", "transparent")],
        &[("style", "wire"), ("camera.eye", "-1.6,0.2,0.1")],
        &[("style", "wire"), ("camera.eye", "-4,1.2,5"), ("outline.method", "hull"), ("outline.thickness", "3")],
    ];
    let mut renderers = cpus();
    let number_of_cpus = renderers.len();
    for (number, look) in looks.into_iter().enumerate() {
        renderers.truncate(number_of_cpus);
        renderers.extend(
            gpus_of_case(number).iter().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>),
        );
        let keys = last_of_each(&[&glass[..], look].concat());
        let plan = scenes::plan(&mesh, &scenes::spec(&keys));
        let mut untinted = scenes::plan(&mesh, &scenes::spec(&keys));
        untinted.lines.iter_mut().for_each(|lines| lines.is_tinted = false);
        let want = draw(renderers[0].as_mut(), &plan);
        assert!(want != draw(renderers[0].as_mut(), &untinted), "{look:?}");
        for renderer in &mut renderers {
            let found = draw(renderer.as_mut(), &plan);
            Likeness::of(&found, &want).assert(Tolerance::TWINS, &format!("{look:?}"));
        }
    }
}

#[test]
fn lines_that_show_through_everything_take_no_tint() {
    let mesh = scenes::mesh(&shapes::two_balls());
    let passes = |glass: &[(&str, &str)], hidden| {
        let keys = [glass, &[("style", "wire"), ("wire.hidden", hidden)]].concat();
        let plan = scenes::plan(&mesh, &scenes::spec(&keys));
        plan.lines.iter().map(|lines| (lines.shown, lines.is_tinted)).collect::<Vec<_>>()
    };
    let glass = [("materials.left.surface.opacity", "0.4")];
    assert_eq!(passes(&glass, "hide"), [(Shown::Visible, true)]);
    assert_eq!(passes(&glass, "fade"), [(Shown::Faded, true)]);
    assert_eq!(passes(&glass, "show"), [(Shown::All, false)]);
    assert_eq!(passes(&[], "hide"), [(Shown::Visible, false)]);
    // The ground's shadow is a layer, too, but lies below.
    assert_eq!(passes(&[("scene.ground", "shadow")], "hide"), [(Shown::Visible, false)]);
}
