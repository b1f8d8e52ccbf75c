//! Memory of bands: how large they are, and their buffers.

use std::sync::{Mutex, PoisonError};

use super::ink::Ink;
use super::layers::LayerBand;
use super::light::Light;
use super::samples::SampleBand;
use crate::plan::DrawPlan;

/// Memory of a band, bytes: half of a common 1 MiB second-level cache.
const BAND_BYTES: usize = 512 << 10;

/// Largest scratch that is kept from picture to picture, bytes. Only a wide row of very many line passes needs more.
const KEPT_BYTES_MAX: usize = 8 << 20;

/// Bytes of a sample: depth and id.
const SAMPLE_BYTES: usize = 8;

/// Bytes of a sample, its layers included.
const LAYERED_SAMPLE_BYTES: usize = SAMPLE_BYTES + LayerBand::SAMPLE_BYTES;

/// Rows in each band but the last.
pub fn rows_per_band(plan: &DrawPlan<'_>) -> u32 {
    let sample_bytes = if plan.layers().is_some() { LAYERED_SAMPLE_BYTES } else { SAMPLE_BYTES };
    let light_bytes = if plan.lights_lines() { size_of::<Light>() } else { 0 };
    let ink_bytes = plan.lines.len() * size_of::<f32>() + if plan.lines.is_empty() { 0 } else { size_of::<Ink>() };
    let owner_bytes = if plan.lights_lines() { size_of::<u32>() } else { 0 };
    let colors_bytes = size_of::<[f32; 4]>() + light_bytes + owner_bytes;
    let pixel_bytes = plan.samples as usize * sample_bytes + colors_bytes + ink_bytes;
    let row_bytes = plan.width_px as usize * pixel_bytes;
    // Where samples beyond the band are drawn too, at least as many in it: or most of the work would be done twice.
    let least = (2 * plan.line_margin_rows()).max(1);
    ((BAND_BYTES / row_bytes.max(1)) as u32).max(least).min(plan.height_px.max(1))
}

/// A band's buffers, kept from band to band.
pub struct BandScratch {
    /// What each sample sees.
    pub samples: SampleBand,
    /// Rows that are shown; the last band of a picture may use fewer.
    pub rows: u32,
    /// Rows beyond these, above and below, that `samples` has room for too.
    pub margin: u32,
    /// Where the plan has layers.
    pub layers: Option<LayerBand>,
    /// A pixel, premultiplied linear RGBA.
    pub colors: Vec<[f32; 4]>,
    /// Of the line pass that is drawn just now.
    pub ink: Vec<Ink>,
    /// Coverage by lines, 0 to 1, of one pass after the other.
    pub coverage: Vec<f32>,
    /// Where lines are lit, whose light falls on them.
    pub owners: Vec<u32>,
    /// A pixel, where lines are lit.
    pub light: Vec<Light>,
}

impl BandScratch {
    /// What it holds on to, bytes.
    fn bytes(&self) -> usize {
        let layered = if self.layers.is_some() { LAYERED_SAMPLE_BYTES } else { SAMPLE_BYTES };
        self.samples.depth.len() * layered
            + self.colors.capacity() * size_of::<[f32; 4]>()
            + self.ink.capacity() * size_of::<Ink>()
            + self.coverage.capacity() * size_of::<f32>()
            + self.owners.capacity() * size_of::<u32>()
            + self.light.capacity() * size_of::<Light>()
    }
}

/// Buffers of bands that nobody draws just now.
#[derive(Default)]
pub struct ScratchPool(Mutex<Vec<BandScratch>>);

impl ScratchPool {
    /// Lends a scratch that fits the plan.
    pub fn with(&self, plan: &DrawPlan<'_>, rows: u32, each: impl FnOnce(&mut BandScratch)) {
        let (size_px, margin) = ([plan.width_px, plan.height_px], plan.line_margin_rows());
        let fits = |s: &BandScratch| {
            s.samples.size_px == size_px && s.rows == rows && s.margin == margin && s.samples.samples == plan.samples
        };
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().filter(fits);
        let mut scratch = kept.unwrap_or_else(|| BandScratch {
            samples: SampleBand::new(size_px, 0, rows + 2 * margin, plan.samples),
            rows,
            margin,
            layers: None,
            colors: Vec::new(),
            ink: Vec::new(),
            coverage: Vec::new(),
            owners: Vec::new(),
            light: Vec::new(),
        });
        each(&mut scratch);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }

    /// Lets go of what is too large to keep for another picture.
    pub fn trim(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(|scratch| scratch.bytes() <= KEPT_BYTES_MAX);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::plan::{LinePass, Projection, Shown};

    fn plan(size_px: [u32; 2], passes: usize) -> DrawPlan<'static> {
        let zero = [0.0; 4];
        let axis = [0.0; 3];
        let projection = Projection {
            x: zero,
            y: zero,
            z: zero,
            w: zero,
            near_w: 0.5,
            clip: false,
            to_viewer: axis,
            screen_up: axis,
            screen_right: axis,
        };
        let (edges, shown) = (Arc::from([]), Shown::All);
        let pass = LinePass {
            edges,
            width_px: 1.0,
            smoothing_px: 0.0,
            color: zero,
            shown,
            skip_back_edges: false,
            contour: false,
            lit: false,
        };
        let plan = DrawPlan::new(size_px, &[], &[], projection);
        DrawPlan { samples: 4, lines: vec![pass; passes], ..plan }
    }

    /// Draws nothing in all of a band's buffers; whether they are kept for the next picture, after how many bytes.
    fn is_kept(plan: &DrawPlan<'_>) -> (bool, usize) {
        let (pool, rows) = (ScratchPool::default(), rows_per_band(plan));
        let pixels = (plan.width_px * rows) as usize;
        let mut bytes = 0;
        pool.with(plan, rows, |scratch| {
            scratch.colors.resize(pixels, [0.0; 4]);
            scratch.ink.resize(pixels, Ink::default());
            scratch.coverage.resize(pixels * plan.lines.len(), 0.0);
            bytes = scratch.bytes();
        });
        pool.trim();
        (!pool.0.lock().unwrap_or_else(PoisonError::into_inner).is_empty(), bytes)
    }

    #[test]
    fn a_band_and_all_its_ink_fit_the_cache() {
        for (passes, rows) in [(0, 10), (12, 3), (500, 1)] {
            assert_eq!(rows_per_band(&plan([1000, 900], passes)), rows, "{passes} passes");
        }
    }

    #[test]
    fn only_what_is_small_is_kept() {
        let (kept, bytes) = is_kept(&plan([1000, 900], 12));
        assert!(kept && (300_000..700_000).contains(&bytes), "{bytes}");
        let (kept, bytes) = is_kept(&plan([8192, 10], 300));
        assert!(!kept && bytes > KEPT_BYTES_MAX, "{bytes}");
    }
}
