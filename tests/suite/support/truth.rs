//! Measures how far pictures are from the truth that the oracle computes. Also the switch between
//! short and long runs.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, FADE, Shown};

use crate::oracle::lines::coverage::ink;
use crate::oracle::screen::Scene;
use crate::oracle::surface::visible::{Segment, all};
use crate::support::gpus::gpus;
pub use crate::support::seen::{scene, segments};
use crate::support::seen::{segments_of, snapped_scene};

/// True if the long cases run, which take minutes: `MESHSNAP_ORACLE=long`.
pub fn is_long() -> bool {
    std::env::var("MESHSNAP_ORACLE").is_ok_and(|v| v == "long")
}

/// `short` cases, or `long` ones with `MESHSNAP_ORACLE=long`.
pub fn cases<T>(short: T, long: T) -> T {
    if is_long() { long } else { short }
}

/// Says what was measured for a goal of docs/accuracy.md; `docs/goals.sh` collects it.
pub fn goal(number: u32, measured: &str) {
    println!("goal {number}: {measured}");
}

/// Both back-ends, or the CPU alone where there is no Vulkan.
pub fn renderers() -> Vec<Box<dyn Renderer>> {
    let mut all: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(2))];
    if let Some(gpus) = gpus() {
        all.push(Box::new(GpuRenderer::new(gpus[0].clone())));
    }
    all
}

/// Points along a pixel's side, so that the oracle takes their square.
pub fn points_per_side() -> u32 {
    cases(32, 64)
}

/// The coverage of each pixel by the plan's only line pass. Hidden parts that fade count by their alpha beside that
/// of the others.
pub fn true_ink(plan: &DrawPlan<'_>) -> Vec<f64> {
    ink_of(plan, scene(plan))
}

/// The same of vertices on the lattice of 1/256 px.
pub fn snapped_ink(plan: &DrawPlan<'_>) -> Vec<f64> {
    ink_of(plan, snapped_scene(plan))
}

fn ink_of(plan: &DrawPlan<'_>, scene: Scene) -> Vec<f64> {
    let whole = (plan.lines[0].shown == Shown::Faded).then(|| ink_along(plan, &all(&scene)));
    let drawn = ink_along(plan, &segments_of(plan, scene));
    let fade = f64::from(FADE);
    match whole {
        Some(whole) => drawn.iter().zip(whole).map(|(drawn, whole)| drawn + fade * (whole - drawn)).collect(),
        None => drawn,
    }
}

fn ink_along(plan: &DrawPlan<'_>, segments: &[Segment]) -> Vec<f64> {
    ink([plan.width_px, plan.height_px], segments, f64::from(plan.lines[0].width_px), points_per_side())
}

/// The coverage that a back-end draws. The plan's lines are opaque white on nothing, so that alpha
/// is their coverage.
pub fn drawn_ink(plan: &DrawPlan<'_>, renderer: &mut dyn Renderer) -> Vec<f64> {
    assert_eq!((plan.background, plan.lines[0].color), ([0.0; 4], [1.0; 4]), "alpha is not coverage");
    alpha(&renderer.draw(plan, &Deadline::default()).unwrap())
}

/// Alpha, 0 to 1.
pub fn alpha(image: &Image) -> Vec<f64> {
    image.rgba.chunks(4).map(|p| f64::from(p[3]) / 255.0).collect()
}

/// The distance of pictures from the truth. Pixels that neither has touched do not count.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    pixels: usize,
    squares: f64,
    max: f64,
    drawn: f64,
    truth: f64,
}

impl Errors {
    /// Of one picture.
    pub fn of(drawn: &[f64], truth: &[f64]) -> Self {
        assert_eq!(drawn.len(), truth.len());
        let mut errors = Self::default();
        for (&d, &t) in drawn.iter().zip(truth) {
            assert!(d.is_finite() && t.is_finite());
            let error = 255.0 * (d - t).abs();
            errors.pixels += usize::from(d > 0.0 || t > 0.0);
            errors.squares += error * error;
            errors.max = errors.max.max(error);
            errors.drawn += d;
            errors.truth += t;
        }
        errors
    }

    /// Adds another picture's.
    pub fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.squares += other.squares;
        self.max = self.max.max(other.max);
        self.drawn += other.drawn;
        self.truth += other.truth;
    }

    /// Root of the mean square, /255.
    pub fn rmse(&self) -> f64 {
        (self.squares / self.pixels.max(1) as f64).sqrt()
    }

    /// The largest, /255.
    pub fn max(&self) -> f64 {
        self.max
    }

    /// Drawn ink, as a share of true ink.
    pub fn ink(&self) -> f64 {
        self.drawn / self.truth
    }

    /// Pixels that either touched.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Says what was measured, and that it is past the gate if it is.
    pub fn check(&self, what: &str, gate: Gate) -> Result<(), String> {
        let measured = format!("{what:<44} rmse {:7.3}  max {:7.2}  ink {:8.4}", self.rmse(), self.max(), self.ink());
        println!("{measured}  (gate {gate:?})");
        if self.is_within(gate) { Ok(()) } else { Err(format!("{measured}, but {gate:?}")) }
    }

    /// True if a gate lets them pass.
    pub fn is_within(&self, gate: Gate) -> bool {
        self.pixels > 0 && self.rmse() <= gate.rmse && self.max <= gate.max && (self.ink() - 1.0).abs() <= gate.ink
    }
}

/// The errors that a gate lets pass.
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    /// Of all touched pixels, /255.
    pub rmse: f64,
    /// Of the worst pixel, /255.
    pub max: f64,
    /// The largest distance of the share of ink from 1.
    pub ink: f64,
}
