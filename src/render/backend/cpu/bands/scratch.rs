//! The height of bands, and the buffers in which a thread draws one. A band is a range of pixel
//! rows that one thread draws at a time. Bands are so high that their buffers fit a core's cache,
//! but at least four rows. They are higher if their lines look far beyond them, because each band
//! draws the samples beyond it for itself.
//!
//! Buffers that are not too large are kept for the next picture.

use std::sync::{Mutex, PoisonError};

use crate::backend::cpu::geometry::samples::{HANGOVER, SampleBand};
use crate::backend::cpu::lines::coverage::BandStrokes;
use crate::backend::cpu::lines::farthest::Farthest;
use crate::backend::cpu::lines::holes::Holes;
use crate::backend::cpu::mixed::draw::MixedScratch;
use crate::backend::cpu::peeling::state::PeelBand;
use crate::backend::cpu::peeling::tints::Tints;
use crate::backend::cpu::surface::flat_colors::FlatColors;
use crate::backend::cpu::surface::light::Light;
use crate::plan::DrawPlan;

/// Memory of a band, bytes: half of a common 1 MiB second-level cache.
const BAND_BYTES: usize = 512 << 10;

/// Rows of a band, at least, of a picture that has as many: a tall triangle is looked at once for
/// each band.
const ROWS_MIN: u32 = 4;

/// Memory of all bands that are drawn at once, bytes, whatever is drawn on however many threads.
pub const BANDS_BYTES_MAX: usize = 256 << 20;

/// Memory of a band whose height is a multiple of its margin, bytes.
const TALL_BYTES: usize = 8 << 20;

/// Memory kept from picture to picture, bytes: of vertices, and of colours of faces.
pub const KEPT_BYTES_MAX: usize = 8 << 20;

/// The same of all bands' scratch. A picture of 512 x 512 pixels with lines takes 16 MiB on two
/// threads; memory from the system costs as much time as drawing in it.
const KEPT_SCRATCH_BYTES_MAX: usize = 24 << 20;

/// Memory of a picture's samples, bytes, up to which a plan with occlusion keeps them: 640 x 600 pixels with
/// four samples. Of larger pictures, bands draw theirs twice, which is cheaper than memory.
const KEPT_SAMPLES_BYTES_MAX: usize = 12 << 20;

/// Bytes of a sample: depth and id.
const SAMPLE_BYTES: usize = 8;

/// Division of a picture into bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Banding {
    /// Rows in each band but the last.
    pub rows: u32,
    /// Rows beyond a band that its lines look at.
    pub margin: u32,
    /// Bands that are drawn at once.
    pub at_once: usize,
}

impl Banding {
    /// The division for a number of threads. Bands fit the cache, unless their lines look far beyond
    /// them: then a band has as many rows as lets the threads do the most in [`BANDS_BYTES_MAX`],
    /// because small bands draw most samples for their neighbours, and few large ones fit at once.
    pub fn new(plan: &DrawPlan<'_>, threads: usize) -> Self {
        let margin = plan.margin_rows();
        let cached = (BAND_BYTES / (row_bytes(plan, 1) + row_bytes(plan, 0)).max(1)) as u32;
        let banding = |rows: u32| {
            let rows = rows.max(cached).max(ROWS_MIN).clamp(1, plan.height_px.max(1));
            let one = Self { rows, margin, at_once: 1 };
            let most = threads.min(plan.height_px.div_ceil(rows) as usize).max(1);
            Self { at_once: (BANDS_BYTES_MAX / one.bytes(plan).max(1)).clamp(1, most), ..one }
        };
        let is_small = |banding: &Self| banding.bytes(plan) <= BANDS_BYTES_MAX;
        // Rows that are shown of those that are drawn, by all threads.
        let yields = |b: &Self| b.at_once as u64 * (u64::from(b.rows) << 20) / u64::from(b.rows + 2 * b.margin);
        let mut best = banding(0);
        for share in (0..8).rev() {
            let other = banding((2 * margin) >> share);
            if !is_small(&best) || (is_small(&other) && yields(&other) >= yields(&best)) {
                best = other;
            }
        }
        // Past the cache, what a band draws for its neighbours costs more than fetching its own
        // samples.
        for times in [4, 8] {
            let other = banding(times * margin);
            if other.bytes(plan) <= other.at_once * TALL_BYTES && yields(&other) > yields(&best) {
                best = other;
            }
        }
        best.evened(plan)
    }

    /// Changes the height so that every thread draws the same number of bands. Keeps the old height
    /// if the new one would be more than a fifth larger.
    fn evened(self, plan: &DrawPlan<'_>) -> Self {
        if self.margin == 0 {
            return self;
        }
        let bands = plan.height_px.div_ceil(self.rows) as usize;
        let rounds = (bands / self.at_once).max(1);
        let rows = plan.height_px.div_ceil((rounds * self.at_once) as u32);
        let evened = Self { rows: rows.max(1), ..self };
        let is_taller = evened.rows > self.rows + self.rows / 5;
        if is_taller || evened.bytes(plan) > BANDS_BYTES_MAX { self } else { evened }
    }

    /// Memory of the bands that are drawn at once.
    pub fn bytes(&self, plan: &DrawPlan<'_>) -> usize {
        let all = (self.rows + 2 * self.margin) as usize;
        let size = [plan.width_px, self.rows].map(|pixels| pixels as usize);
        let mixed = if plan.is_adaptive { MixedScratch::bytes_of(size) } else { 0 };
        self.at_once * (all * row_bytes(plan, 0) + self.rows as usize * row_bytes(plan, 1) + mixed)
    }
}

/// Bytes of a row: of its samples (0), or of what there is only where a row is shown (1).
fn row_bytes(plan: &DrawPlan<'_>, part: usize) -> usize {
    let samples = |columns: u32| columns as usize * plan.samples as usize + HANGOVER;
    if part == 0 {
        let columns = plan.width_px + 2 * plan.margin_px;
        let farthest = if plan.hides_lines() { columns as usize * size_of::<f32>() } else { 0 };
        return samples(columns) * SAMPLE_BYTES + farthest;
    }
    let light = if plan.lights_lines() { size_of::<Light>() + size_of::<u32>() } else { 0 };
    let coverage = if plan.lines.is_empty() { 0 } else { BandStrokes::PIXEL_BYTES };
    let whole = if plan.lines.iter().any(|lines| plan.fades_hidden(lines)) { size_of::<f32>() } else { 0 };
    let holes = if plan.has_holes() { Holes::row_bytes(plan.width_px) } else { 0 };
    let peel = if plan.peeling().is_some() { PeelBand::SAMPLE_BYTES } else { 0 };
    let tints = if plan.tints_lines() { Tints::PIXEL_BYTES + size_of::<f32>() } else { 0 };
    // A plan of flat faces alone needs no colours of pixels.
    let color = if plan.lines.is_empty() && FlatColors::suffice(plan) { 0 } else { size_of::<[f32; 4]>() };
    plan.width_px as usize * (color + light + coverage + whole + tints) + holes + samples(plan.width_px) * peel
}

/// A band's buffers, kept from band to band.
pub struct BandScratch {
    /// The visibility buffer.
    pub samples: SampleBand,
    /// True if `samples` holds the band that is drawn already.
    pub is_filled: bool,
    /// Rows that are shown; the last band of a picture may use fewer.
    pub rows: u32,
    /// Rows beyond these, above and below, that `samples` has room for too.
    pub margin: u32,
    /// Depth peeling, where the plan has it.
    pub peel: Option<PeelBand>,
    /// The depth of the farthest corner behind each pixel, where surfaces hide lines.
    pub farthest: Farthest,
    /// Per pixel, premultiplied linear RGBA.
    pub colors: Vec<[f32; 4]>,
    /// Strokes of the current line pass.
    pub strokes: BandStrokes,
    /// Per pixel, where the pass fades hidden parts of edges: the share that whole edges cover.
    pub whole: Vec<f32>,
    /// Holes of the current line pass.
    pub holes: Holes,
    /// Mixed pixels.
    pub mixed: MixedScratch,
    /// Per pixel, where the pass is lit: the face that lights its lines, plus 1.
    pub owners: Vec<u32>,
    /// Per pixel, the light on its lines.
    pub light: Vec<Light>,
    /// Per pixel, where layers tint the pass: the depth of its nearest line; 0 where it has none.
    pub line_depths: Vec<f32>,
}

impl BandScratch {
    fn new(plan: &DrawPlan<'_>, Banding { rows, margin, .. }: Banding) -> Self {
        Self {
            samples: SampleBand::new([plan.width_px, plan.height_px], plan.margin_px, rows + 2 * margin, plan.samples),
            is_filled: false,
            rows,
            margin,
            peel: None,
            farthest: Farthest::default(),
            colors: Vec::new(),
            strokes: BandStrokes::default(),
            whole: Vec::new(),
            holes: Holes::default(),
            mixed: MixedScratch::default(),
            owners: Vec::new(),
            light: Vec::new(),
            line_depths: Vec::new(),
        }
    }

    /// Calls `each` with a band's kept samples in place of its own, if it has any.
    pub fn with_kept(&mut self, kept: Option<&mut SampleBand>, is_filled: bool, each: impl FnOnce(&mut Self)) {
        let Some(kept) = kept else { return each(self) };
        std::mem::swap(&mut self.samples, kept);
        self.is_filled = is_filled;
        each(self);
        self.is_filled = false;
        std::mem::swap(&mut self.samples, kept);
    }

    /// Allocated memory, bytes.
    fn bytes(&self) -> usize {
        self.samples.depth.len() * SAMPLE_BYTES
            + self.peel.as_ref().map_or(0, PeelBand::bytes)
            + self.farthest.bytes()
            + self.colors.capacity() * size_of::<[f32; 4]>()
            + self.strokes.bytes()
            + self.whole.capacity() * size_of::<f32>()
            + self.holes.bytes()
            + self.mixed.bytes()
            + self.owners.capacity() * size_of::<u32>()
            + self.light.capacity() * size_of::<Light>()
            + self.line_depths.capacity() * size_of::<f32>()
    }
}

/// The samples of a whole picture, band by band: of one with occlusion, which looks at all depths before
/// anything is shaded.
///
/// The first picture of a size draws its samples twice: memory that is new takes more time than that.
#[derive(Default)]
pub struct KeptSamples {
    bands: Vec<SampleBand>,
    /// Columns, rows, margin and samples of the last picture with occlusion, and its division.
    last: Option<([u32; 4], Banding)>,
}

impl KeptSamples {
    /// Makes room for a plan's samples, if they take little and the last picture was of the same size.
    pub fn reset(&mut self, plan: &DrawPlan<'_>, banding: Banding) {
        let size = ([plan.width_px, plan.height_px, plan.margin_px, plan.samples], banding);
        if Self::bytes(plan, banding) == 0 {
            *self = Self::default();
        } else if self.last != Some(size) {
            *self = Self { bands: Vec::new(), last: Some(size) };
        } else if self.bands.is_empty() {
            let band = || {
                let rows = banding.rows + 2 * banding.margin;
                SampleBand::new([plan.width_px, plan.height_px], plan.margin_px, rows, plan.samples)
            };
            self.bands.resize_with(plan.height_px.div_ceil(banding.rows) as usize, band);
        }
    }

    /// Memory that a plan's samples take, bytes; 0 if they are not kept.
    pub fn bytes(plan: &DrawPlan<'_>, banding: Banding) -> usize {
        let bands = plan.height_px.div_ceil(banding.rows) as usize;
        let bytes = bands * (banding.rows + 2 * banding.margin) as usize * row_bytes(plan, 0);
        if plan.occlusion.is_some() && bytes <= KEPT_SAMPLES_BYTES_MAX { bytes } else { 0 }
    }

    /// Each band's samples; None, without end, where they are not kept.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = Option<&mut SampleBand>> {
        let count = if self.bands.is_empty() { usize::MAX } else { 0 };
        self.bands.iter_mut().map(Some).chain(std::iter::repeat_with(|| None).take(count))
    }
}

/// Unused buffers of bands.
#[derive(Default)]
pub struct ScratchPool(Mutex<Vec<BandScratch>>);

impl ScratchPool {
    /// Calls `each` with a scratch that fits the plan.
    pub fn with(&self, plan: &DrawPlan<'_>, banding: Banding, each: impl FnOnce(&mut BandScratch)) {
        let size_px = [plan.width_px, plan.height_px];
        let fits = |s: &BandScratch| {
            s.samples.size_px == size_px
                && (s.rows, s.margin) == (banding.rows, banding.margin)
                && s.samples.margin == plan.margin_px
                && s.samples.samples == plan.samples
        };
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().filter(fits);
        let mut scratch = kept.unwrap_or_else(|| BandScratch::new(plan, banding));
        each(&mut scratch);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }

    /// Frees buffers that are too large to keep for another picture.
    pub fn trim(&self) {
        let mut kept = 0;
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(|scratch| {
            let fits = kept + scratch.bytes() <= KEPT_SCRATCH_BYTES_MAX;
            kept += if fits { scratch.bytes() } else { 0 };
            fits
        });
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::backend::Renderer as _;
    use crate::backend::cpu::CpuRenderer;
    use crate::limits::Deadline;
    use crate::plan::{Faces, LinePass, PeelingPass, Projection, ShadedMaterial, Shown, SurfacePass};

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
        let pass = LinePass::new(Arc::default(), 1.0);
        let plan = DrawPlan::new(size_px, &[], &[], projection);
        DrawPlan { samples: 4, lines: vec![pass; passes], ..plan }
    }

    /// Draws nothing in all of a band's buffers; whether they are kept for the next picture, after
    /// how many bytes.
    fn is_kept(plan: &DrawPlan<'_>) -> (bool, usize) {
        let (pool, banding) = (ScratchPool::default(), Banding::new(plan, 1));
        let pixels = (plan.width_px * banding.rows) as usize;
        let mut bytes = 0;
        pool.with(plan, banding, |scratch| {
            scratch.colors.resize(pixels, [0.0; 4]);
            scratch.strokes.reset(pixels);
            bytes = scratch.bytes();
        });
        pool.trim();
        (!pool.0.lock().unwrap_or_else(PoisonError::into_inner).is_empty(), bytes)
    }

    #[test]
    fn a_band_fits_the_cache_however_many_lines_there_are() {
        for (passes, rows) in [(0, 10), (1, 5), (12, 5), (500, 5)] {
            let banding = Banding::new(&plan([1000, 900], passes), 8);
            assert_eq!(banding, Banding { rows, margin: 0, at_once: 8 }, "{passes} passes");
        }
    }

    /// All kinds of plans whose lines look far beyond a band.
    fn with_wide_lines(each: &mut impl FnMut(&DrawPlan<'_>)) {
        for size_px in [[4096, 4096], [4096, 100], [100, 4096], [1, 1], [640, 480]] {
            for (samples, width_px) in [1, 4, 8, 16].into_iter().flat_map(|s| [1.0, 9.0, 110.0].map(|w| (s, w))) {
                for (layered, passes) in [(false, 1), (true, 1), (false, 128), (true, 8192)] {
                    let mut plan = plan(size_px, passes);
                    let mut surface = SurfacePass::new(Faces::Both, Vec::new());
                    surface.is_shaded = true;
                    plan.surface = Some(surface);
                    for lines in &mut plan.lines {
                        (lines.width_px, lines.shown, lines.lit) = (width_px, Shown::Faded, true);
                    }
                    if let Some(first) = plan.lines.first_mut() {
                        (first.shown, first.is_complete) = (Shown::Visible, true);
                    }
                    let peel = PeelingPass { count_max: 16, behind_surface: false, wires_only: false, fade: 1.0 };
                    plan.peeling = Some(peel).filter(|_| layered);
                    plan.samples = samples;
                    each(&plan);
                    // The same with a mesh that continues beyond the picture.
                    plan.margin_px = plan.line_margin_rows();
                    each(&plan);
                }
            }
        }
    }

    #[test]
    fn bands_never_take_more_than_they_may() {
        let (mut cases, mut alone) = (0, 0);
        with_wide_lines(&mut |plan| {
            for threads in [1, 2, 8, 64, 1024] {
                let banding = Banding::new(plan, threads);
                let bytes = banding.bytes(plan);
                assert!(bytes <= BANDS_BYTES_MAX, "{bytes}: {banding:?} on {threads}, {:?}", plan.lines.first());
                assert!((1..=threads).contains(&banding.at_once) && banding.rows >= 1);
                // Of less than two bands of rows and margins there is little to share.
                let is_large = plan.height_px > 4 * banding.margin && plan.height_px > banding.rows;
                alone += usize::from(banding.at_once == 1 && threads > 1 && is_large);
                cases += 1;
            }
        });
        assert_eq!(cases, 2 * 5 * 12 * 4 * 5);
        assert!(alone < cases / 20, "{alone} of {cases} pictures are drawn by one thread alone");
    }

    #[test]
    fn a_band_takes_what_it_was_said_to() {
        let mut cases = 0;
        with_wide_lines(&mut |plan| {
            let banding = Banding::new(plan, 1);
            if banding.bytes(plan) > 32 << 20 {
                return;
            }
            ScratchPool::default().with(plan, banding, |scratch| {
                let pixels = (plan.width_px * banding.rows) as usize;
                if plan.hides_lines() {
                    scratch.farthest.clear(&scratch.samples);
                }
                if plan.has_holes() {
                    scratch.samples.shown = [0, banding.rows];
                    scratch.holes.reset(&scratch.samples);
                }
                scratch.colors = Vec::with_capacity(pixels);
                scratch.strokes.reset(pixels);
                if plan.lines.iter().any(|lines| plan.fades_hidden(lines)) {
                    scratch.whole = Vec::with_capacity(pixels);
                }
                scratch.owners = Vec::with_capacity(pixels);
                scratch.light = Vec::with_capacity(pixels);
                scratch.peel = plan.peeling().map(|_| PeelBand::new(&scratch.samples, scratch.rows));
                assert_eq!(scratch.bytes(), banding.bytes(plan));
            });
            cases += 1;
        });
        assert!(cases > 100, "{cases}");
    }

    /// Thousands of slivers that cross each other: pixels of many faces, and long lists.
    #[test]
    fn mixed_pixels_take_at_most_what_they_were_said_to() {
        let mut state = 5_u32;
        let mut chance = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let positions: Vec<[f32; 3]> = (0..12_000).map(|_| [chance(), chance(), 0.3 * chance()]).collect();
        let triangles: Vec<[u32; 3]> = (0..4_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut plan = DrawPlan::new([130, 90], &positions, &triangles, Projection::for_tests());
        (plan.samples, plan.is_adaptive, plan.margin_px) = (4, true, 1);
        let materials = [1.0, 0.1].map(|v| ShadedMaterial::unlit([v, v, v, 1.0])).to_vec();
        let mut surface = SurfacePass::new(Faces::Both, materials);
        surface.is_shaded = true;
        surface.triangle_materials = (0..4_000).map(|i| i % 2).collect::<Vec<u32>>().into();
        plan.surface = Some(surface);
        let banding = Banding::new(&plan, 1);
        let mut cpu = CpuRenderer::new(1);
        cpu.draw(&plan, &Deadline::default()).unwrap();
        assert!(cpu.draw_times().mixed_pixels > 3_000, "{}", cpu.draw_times().mixed_pixels);
        let all = cpu.scratch.0.lock().unwrap();
        let found = all.iter().map(|scratch| scratch.mixed.bytes()).max().unwrap();
        let most = MixedScratch::bytes_of([plan.width_px as usize, banding.rows as usize]);
        assert!(found > 1 << 20 && found <= most, "{found} of {most}");
    }

    #[test]
    fn only_what_is_small_is_kept() {
        let (kept, bytes) = is_kept(&plan([1000, 900], 12));
        assert!(kept && (300_000..700_000).contains(&bytes), "{bytes}");
        let mut wide = plan([4096, 500], 1);
        wide.surface = Some(SurfacePass::new(Faces::Both, Vec::new()));
        (wide.lines[0].width_px, wide.lines[0].shown) = (50.0, Shown::Visible);
        let (kept, bytes) = is_kept(&wide);
        assert!(!kept && bytes > KEPT_SCRATCH_BYTES_MAX, "{bytes}");
    }
}
