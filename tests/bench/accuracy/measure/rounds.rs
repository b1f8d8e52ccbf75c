//! Draws a scene's cases (each technique with each number of samples) on every back-end in rounds,
//! so that whatever slows the machine slows all of them, and measures times and errors.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{DrawPlan, samplers};
use meshsnap_render::spec::{Samples, WireMethod};

use super::scenes::{Scene, plan};
use super::techniques::{Family, Technique};
use super::truths::{Apart, Errors, Truth};
use super::{BASELINE_SAMPLES, BackEnd, Effort, Row};
use crate::oracle::screen::Screen;
use crate::oracle::surface::srgb;
use crate::oracle::vector::length;

/// A plan to draw.
struct Case<'a> {
    technique: Technique,
    samples: Samples,
    thickness: f64,
    plan: DrawPlan<'a>,
}

/// Samples of pictures that are drawn with twice the columns and rows, and scaled down.
const DOUBLED: Samples = Samples::Fixed(64);

/// The results of a case's draws on one back-end.
struct Drawn {
    /// Of the round that warms up, which is not timed.
    picture: Image,
    /// Of each timed round, milliseconds.
    times_ms: Vec<f64>,
}

/// Every technique of the scene's family, by every number of samples, on every back-end.
pub fn measure(scene: &Scene, effort: Effort, back_ends: &mut [BackEnd]) -> Vec<Row> {
    let mesh = scene.mesh(effort.size_px);
    let baseline = baseline(scene, effort, &mesh);
    let height_px = median_height_px(&baseline.plan);
    let wanted = |technique: Technique| technique.thickness(scene.width_px, height_px);
    let mut cases: Vec<Case<'_>> = Vec::new();
    for &technique in scene.family.techniques() {
        let cased = |&samples| case(scene, effort, &mesh, technique, samples, wanted(technique));
        // A picture that cannot have adaptive samples would be one of 16 once more.
        let is_own = |case: &Case<'_>| case.samples != Samples::Adaptive || case.plan.is_adaptive;
        cases.extend(scene.family.samples().iter().map(cased).filter(is_own));
    }
    let truths = truths(scene, effort, &mesh, &baseline, &cases);
    let (drawn, baseline_ms) = rounds(&cases, &baseline, effort.runs, back_ends);

    let mut rows = Vec::new();
    let errors = errors(scene.family.techniques(), &truths, &cases, &drawn);
    for ((case, drawn), errors) in cases.iter().zip(&drawn).zip(errors) {
        for ((back_end, on), (errors, twin)) in back_ends.iter().zip(drawn).zip(errors) {
            let is_cpu = back_end.name.starts_with("cpu");
            assert!(!is_cpu || on.picture == drawn[0].picture, "{}: threads change the picture", scene.name);
            let median_ms = median(on.times_ms.clone());
            rows.push(Row {
                scene: scene.name,
                family: scene.family,
                triangles: mesh.triangles.len(),
                technique: case.technique,
                back_end: back_end.name,
                samples: case.samples,
                thickness: case.thickness,
                median_ms,
                time_ratio: median_ms / baseline_ms,
                errors,
                twin: twin.filter(|_| !is_cpu),
            });
        }
    }
    rows
}

/// The errors of each case's pictures, and how far each is from the first back-end's. Cases are compared side by side,
/// and equal pictures once.
fn errors(
    techniques: &[Technique],
    truths: &[Arc<Truth>],
    cases: &[Case<'_>],
    drawn: &[Vec<Drawn>],
) -> Vec<Vec<(Errors, Option<Apart>)>> {
    let compared = |(case, drawn): (&Case<'_>, &Vec<Drawn>)| {
        let truth = techniques.iter().position(|&own| own == case.technique).expect("a technique of the family");
        let first = truths[truth].errors(&drawn[0].picture);
        let others = drawn[1..].iter().map(|on| {
            let is_equal = on.picture == drawn[0].picture;
            let errors = if is_equal { first } else { truths[truth].errors(&on.picture) };
            (errors, Some(Apart::of(&drawn[0].picture, &on.picture)))
        });
        std::iter::once((first, None)).chain(others).collect()
    };
    cases.par_iter().zip(drawn).map(compared).collect()
}

/// A GPU that has been idle for as long as the CPU draws all cases takes three to five times as long at first, because
/// its clock is low (docs/gpu-notes.md). So long it draws before its cases are timed.
const AWAKE_AFTER: Duration = Duration::from_millis(50);

/// Each case on each back-end, once to warm up and then in turn; and the baseline's median on the
/// first of them. Each round begins with another case: a CPU that has waited for the GPU may be slow at first.
fn rounds(cases: &[Case<'_>], baseline: &Case<'_>, runs: usize, back_ends: &mut [BackEnd]) -> (Vec<Vec<Drawn>>, f64) {
    let count = back_ends.len();
    let gpu = back_ends.iter().position(|back_end| back_end.name == "gpu").unwrap_or(count);
    let mut draw = |back_end: usize, plan: &DrawPlan<'_>| {
        let deadline = Deadline::default();
        let began = Instant::now();
        let picture = back_ends[back_end].renderer.draw(plan, &deadline);
        let took_ms = began.elapsed().as_secs_f64() * 1e3;
        (picture.expect("a picture"), took_ms)
    };
    let mut warm = |plan: &DrawPlan<'_>| -> Vec<Drawn> {
        (0..count).map(|back_end| Drawn { picture: draw(back_end, plan).0, times_ms: Vec::new() }).collect()
    };
    let mut drawn: Vec<Vec<Drawn>> = cases.iter().map(|case| warm(&case.plan)).collect();
    for (_, drawn) in cases.iter().zip(&mut drawn).filter(|(case, _)| case.samples == DOUBLED) {
        drawn.iter_mut().for_each(|on| on.picture = halved(&on.picture));
    }
    let mut of_baseline = Vec::new();
    for round in 0..runs {
        let first = round * cases.len() / runs;
        of_baseline.push(draw(0, &baseline.plan).1);
        for back_end in 0..count {
            let began = Instant::now();
            while back_end == gpu && began.elapsed() < AWAKE_AFTER {
                draw(back_end, &baseline.plan);
            }
            for i in (first..cases.len()).chain(0..first) {
                let of_case = &mut drawn[i];
                of_case[back_end].times_ms.push(draw(back_end, &cases[i].plan).1);
            }
        }
    }
    (drawn, median(of_baseline))
}

/// An opaque picture of half the columns and rows: each pixel the mean of four, in linear light.
fn halved(picture: &Image) -> Image {
    let [width_px, height_px] = [picture.width_px / 2, picture.height_px / 2];
    let mut rgba = Vec::with_capacity(picture.rgba.len() / 4);
    for (y, x) in (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x))) {
        let four = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[dx, dy]| picture.pixel(2 * x + dx, 2 * y + dy));
        let mean = |k: usize| four.iter().map(|pixel| srgb::to_linear(f64::from(pixel[k]) / 255.0)).sum::<f64>() / 4.0;
        rgba.extend([0, 1, 2].map(|k| (255.0 * srgb::from_linear(mean(k))).round() as u8));
        rgba.push(255);
    }
    Image { width_px, height_px, rgba: rgba.into() }
}

/// Exact wires of the scene's own width, or 1 px wide where it has none.
fn baseline<'a>(scene: &Scene, effort: Effort, mesh: &'a Mesh) -> Case<'a> {
    let width_px = if scene.family == Family::Wires { scene.width_px } else { 1.0 };
    case(scene, effort, mesh, Technique::Wire(WireMethod::Exact), BASELINE_SAMPLES, width_px)
}

fn case<'a>(
    scene: &Scene,
    effort: Effort,
    mesh: &'a Mesh,
    technique: Technique,
    samples: Samples,
    thickness: f64,
) -> Case<'a> {
    // Requests carry f32.
    let thickness = f64::from(thickness as f32);
    let (scale, asked) = if samples == DOUBLED { (2, Samples::Fixed(16)) } else { (1, samples) };
    let keys = technique.keys(scene, asked, f64::from(scale) * thickness);
    let mut plan = plan(mesh, &scene.spec(scale * effort.size_px, &keys));
    if technique == Technique::Trilinear {
        let materials = plan.surface.iter_mut().flat_map(|surface| &mut surface.materials);
        materials.flat_map(|material| &mut material.textures).for_each(|used| used.sampler |= samplers::TRILINEAR);
    }
    Case { technique, samples, thickness, plan }
}

/// A truth for each technique, in their order.
fn truths(scene: &Scene, effort: Effort, mesh: &Mesh, baseline: &Case<'_>, cases: &[Case<'_>]) -> Vec<Arc<Truth>> {
    let of = |technique, plan: &DrawPlan<'_>| {
        Arc::new(Truth::new(scene.family, technique, plan, scene.width_px, effort.points_per_side))
    };
    let techniques = scene.family.techniques();
    let own = |technique| cases.iter().find(|case| case.technique == technique).expect("a case of each technique");
    match scene.family {
        Family::Wires => vec![of(Technique::Wire(WireMethod::Exact), &baseline.plan); techniques.len()],
        Family::Faces | Family::Pictures => vec![of(Technique::FaceNormals, &cases[0].plan); techniques.len()],
        Family::Textures | Family::WholeTextures => vec![of(techniques[0], &cases[0].plan); techniques.len()],
        Family::Whole => techniques.par_iter().map(|&technique| of(technique, &own(technique).plan)).collect(),
        // Each in its own view: room is left for what sticks out.
        Family::Outlines => {
            let outline = |&technique: &Technique| {
                let own = own(technique);
                let mut lines = case(scene, effort, mesh, Technique::Contour, BASELINE_SAMPLES, own.thickness).plan;
                lines.projection = own.plan.projection;
                of(technique, &lines)
            };
            techniques.par_iter().map(outline).collect()
        }
    }
}

/// Half of the heights of all triangles on screen, three each, are larger.
fn median_height_px(plan: &DrawPlan<'_>) -> f64 {
    let screen = Screen::new(&crate::support::seen::scene(plan));
    let heights = screen.pieces.iter().flat_map(|piece| {
        let corner = |k: usize| [piece.corners[k % 3][0], piece.corners[k % 3][1]];
        let twice_area = piece.side(0, corner(0));
        (0..3).map(move |k| {
            let (a, b) = (corner(k), corner(k + 1));
            twice_area / length([b[0] - a[0], b[1] - a[1]])
        })
    });
    median(heights.filter(|h| h.is_finite()).collect())
}

fn median(mut values: Vec<f64>) -> f64 {
    assert!(!values.is_empty());
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
