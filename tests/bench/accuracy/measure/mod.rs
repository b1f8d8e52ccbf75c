//! The benchmark of run time against error, in parts that the test suite runs too: scenes,
//! techniques, the true picture of each scene, and timed rounds.

// Each binary that includes this module uses its own part of it. A tool for developers: giving up
// loudly is fine.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod condensed;
pub mod goals;
pub mod json;
pub mod meshes;
pub mod plot;
pub mod rounds;
pub mod scenes;
pub mod summary;
pub mod table;
pub mod techniques;
pub mod textured;
pub mod truths;

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::{Gpu, GpuRenderer};
use meshsnap_render::spec::Samples;

/// Visibility samples a pixel, and adaptive ones where a picture can have them.
pub const SAMPLES: &[Samples] =
    &[Samples::Fixed(1), Samples::Fixed(4), Samples::Fixed(8), Samples::Fixed(16), Samples::Adaptive];

/// Those of whole pictures. 64 are 16 in a picture of twice the columns and rows, scaled down.
pub const WHOLE_SAMPLES: &[Samples] = &[
    Samples::Fixed(1),
    Samples::Fixed(4),
    Samples::Fixed(8),
    Samples::Fixed(16),
    Samples::Fixed(64),
    Samples::Adaptive,
];

/// Threads of the CPU's renderers; the first is the baseline's.
const THREADS: [usize; 2] = [1, 2];

/// The baseline of all times: on the same scene's mesh, in the same rounds.
pub const BASELINE: &str = "cpu-1, exact wires, 4 samples";
/// The baseline's samples.
pub const BASELINE_SAMPLES: Samples = Samples::Fixed(4);

/// A renderer that is measured.
pub struct BackEnd {
    /// `cpu-1`, `cpu-2` (by threads) or `gpu`.
    pub name: &'static str,
    pub renderer: Box<dyn Renderer>,
}

/// The CPU with one thread first, then with two, then the GPU if there is one.
pub fn back_ends(gpu: Option<Arc<Gpu>>) -> Vec<BackEnd> {
    let cpu = |(name, threads)| BackEnd { name, renderer: Box::new(CpuRenderer::new(threads)) };
    let mut all: Vec<BackEnd> = ["cpu-1", "cpu-2"].into_iter().zip(THREADS).map(cpu).collect();
    all.extend(gpu.map(|gpu| BackEnd { name: "gpu", renderer: Box::new(GpuRenderer::new(gpu)) }));
    all
}

/// The amount of work to do.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Pictures are squares of this many pixels per side.
    pub size_px: u32,
    /// Timed rounds.
    pub runs: usize,
    /// Of the oracle: points along a pixel's side.
    pub points_per_side: u32,
}

impl Effort {
    /// The effort of the published figures.
    pub const FULL: Self = Self { size_px: 512, runs: 9, points_per_side: 32 };
    /// To look at while working.
    pub const QUICK: Self = Self { size_px: 256, runs: 3, points_per_side: 16 };
}

/// One technique on one back-end with one number of samples on one scene.
#[derive(Clone, Debug)]
pub struct Row {
    pub scene: &'static str,
    pub family: techniques::Family,
    pub triangles: usize,
    pub technique: techniques::Technique,
    pub back_end: &'static str,
    pub samples: Samples,
    /// The requested `wire.thickness` or `outline.thickness`; 0 for faces.
    pub thickness: f64,
    pub median_ms: f64,
    /// To the baseline's median.
    pub time_ratio: f64,
    pub errors: truths::Errors,
    /// Of a GPU's picture: how far it is from the CPU's.
    pub twin: Option<truths::Apart>,
}
