//! The CPU rasterizer, which draws plans without a GPU. Its pictures are the reference: tests compare their bytes
//! with stored pictures. A picture of the GPU may differ from them by one step in 255, in a few pixels.
//!
//! Stages in order: transform and visibility in `geometry`, then `occlusion`, `peeling`, shade in `surface`, `mixed`,
//! `lines`, `resolve`. `context` holds the input that they share. Transform and occlusion look at the whole picture.
//! `bands` runs the others: the picture is cut into bands of rows that mostly fit a core's cache, threads take bands,
//! and no band depends on another. The hot loops are compiled for several instruction sets (`isa`).
//!
//! **Invariant:** threads and instruction sets do not change a byte.

// Loops over lanes and corners walk several arrays at once; an index says that best.
#![allow(clippy::needless_range_loop)]

mod bands;
mod context;
mod deadline_poll;
pub(super) mod geometry;
mod isa;
pub(super) mod lines;
pub(super) mod mixed;
pub(super) mod occlusion;
pub(crate) mod peeling;
pub(super) mod resolve;
mod row_queue;
mod stopwatch;
pub(super) mod surface;
mod threads;
mod vector;

pub use isa::Isa;
pub use threads::DrawingThreads;

use std::sync::Arc;

use half::f16;

use self::bands::bins::Bins;
use self::bands::scratch::{BandScratch, Banding, KEPT_BYTES_MAX, KeptSamples, ScratchPool};
use self::context::RasterContext;
use self::occlusion::Occlusion;
use self::resolve::SrgbEncoder;
use self::row_queue::RowQueue;
use self::stopwatch::Stopwatch;
use self::surface::flat_colors::FlatColors;
use self::threads::{CHUNK, ThreadShare, map};
use super::{BackendKind, DrawError, DrawStage, DrawTimes, Renderer};
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::image::{Image, LinearImage, RowSink};
use crate::limits::Deadline;
use crate::plan::{DrawPlan, OcclusionPass};

/// Result of a run over all bands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Goal {
    /// The picture.
    Picture,
    /// Samples alone.
    Samples,
}

/// Draws on the CPU. Keeps its buffers from picture to picture.
pub struct CpuRenderer {
    isa: Isa,
    threads: Arc<DrawingThreads>,
    vertices: Vec<ScreenVertex>,
    scratch: ScratchPool,
    srgb: SrgbEncoder,
    flat: FlatColors,
    occlusion: Occlusion,
    kept: KeptSamples,
    /// Of the last picture.
    draw_times: DrawTimes,
    /// True if no shortcuts are taken.
    is_plain: bool,
}

impl CpuRenderer {
    /// A renderer that uses up to `threads` threads. Its pictures do not depend on how many.
    pub fn new(threads: usize) -> Self {
        Self::with_isa(threads, Isa::detect())
    }

    /// As [`CpuRenderer::new`] on a given instruction set, for tests that compare them.
    pub fn with_isa(threads: usize, isa: Isa) -> Self {
        Self { isa, ..Self::on(Arc::new(DrawingThreads::new(threads))) }
    }

    /// A renderer without shortcuts, for tests that compare bytes: triangles are set up one by one
    /// and drawn in blocks, nothing is left out behind tiles, each point is shaded by itself, and
    /// each edge is compared with every visible triangle.
    #[cfg(feature = "plain")]
    pub fn plain(threads: usize) -> Self {
        Self { is_plain: true, ..Self::new(threads) }
    }

    /// A renderer that shares threads with others.
    pub fn on(threads: Arc<DrawingThreads>) -> Self {
        Self {
            isa: Isa::detect(),
            threads,
            vertices: Vec::new(),
            scratch: ScratchPool::default(),
            srgb: SrgbEncoder::new(),
            flat: FlatColors::default(),
            occlusion: Occlusion::default(),
            kept: KeptSamples::default(),
            draw_times: DrawTimes::default(),
            is_plain: false,
        }
    }

    /// Transforms the plan's vertices; afterwards [`RasterContext`] can be made.
    fn transform(&mut self, plan: &DrawPlan<'_>, pool: Option<&rayon::ThreadPool>) {
        let isa = self.isa;
        let own = plan.hull.as_ref().map_or(&[][..], |hull| &hull.vertices);
        // Room for just what there is: a list that grows by itself would double.
        self.vertices.clear();
        self.vertices.reserve_exact(plan.positions.len() + own.len());
        self.vertices.resize(plan.positions.len(), ScreenVertex::default());
        let chunks = plan.positions.chunks(CHUNK).zip(self.vertices.chunks_mut(CHUNK)).collect();
        map(pool, chunks, |(positions, out)| geometry::transform::transform(isa, &plan.projection, positions, out));
        self.vertices.extend_from_slice(own);
    }

    fn context<'a>(
        &'a self,
        plan: &'a DrawPlan<'a>,
        deadline: &'a Deadline,
        watch: &'a Stopwatch,
    ) -> RasterContext<'a> {
        RasterContext {
            plan,
            deadline,
            vertices: &self.vertices,
            isa: self.isa,
            watch,
            srgb: &self.srgb,
            flat: None,
            occlusion: None,
            has_quarters: plan.has_quarters(),
            is_plain: self.is_plain,
        }
    }

    /// Calls `each` with every drawn band, its rows of `out` (`row_len` items a picture row) beside
    /// it.
    fn draw_bands<'o, T: Send>(
        &mut self,
        plan: &DrawPlan<'_>,
        deadline: &Deadline,
        (goal, out): (Goal, &'o mut [T]),
        each: impl Fn(&RasterContext<'_>, &mut BandScratch, &Bins, usize, &'o mut [T]) + Sync + Send,
    ) -> Result<(), DrawError> {
        deadline.check()?;
        let threads = self.threads.clone();
        let share = threads.share();
        let pool = share.pool();
        let watch = Stopwatch::default();
        let mut lap = watch.begin();
        self.transform(plan, pool);
        lap.end(DrawStage::Transform);
        let mut flat = std::mem::take(&mut self.flat);
        let mut occlusion = std::mem::take(&mut self.occlusion);
        let mut kept = std::mem::take(&mut self.kept);
        let mut context = self.context(plan, deadline, &watch);
        // As many bands at once as were paid for, or fewer.
        let mut banding = Banding::new(plan, threads.count());
        banding.at_once = banding.at_once.min(share.count);
        let drawn = bands::bins::bin(&context, pool, [banding.rows, banding.margin]).map(|bins| {
            lap.end(DrawStage::Sort);
            if FlatColors::suffice(plan) && !context.is_plain() {
                flat.find(&context, pool, &bins.triangles);
                context.flat = Some(&flat);
                lap.end(DrawStage::FaceColors);
            }
            let mut no_samples = KeptSamples::default();
            let mut samples = &mut no_samples;
            if let (Some(pass), true) = (&plan.occlusion, goal == Goal::Picture) {
                kept.reset(plan, banding);
                samples = &mut kept;
                self.find_occlusion(&context, pass, (&mut occlusion, samples), (&share, banding, &bins));
                context.occlusion = Some((pass, &occlusion));
                lap.end(DrawStage::Occlusion);
            }
            let row_len = out.len() / plan.height_px as usize;
            let items = out.chunks_mut(row_len * banding.rows as usize).zip(samples.iter_mut()).enumerate();
            share.run(banding.at_once, items, |(band, (out, samples))| {
                if deadline.check().is_ok() {
                    self.scratch.with(plan, banding, |scratch| {
                        scratch.with_kept(samples, true, |scratch| each(&context, scratch, &bins, band, out));
                    });
                }
            });
        });
        (self.flat, self.occlusion, self.kept) = (flat, occlusion, kept);
        self.draw_times = watch.times(lap.restart());
        self.trim();
        drawn?;
        Ok(deadline.check()?)
    }

    /// Draws the picture. A sink gets its bands as [`Renderer::draw_rows`] says.
    fn draw_picture(
        &mut self,
        plan: &DrawPlan<'_>,
        sink: Option<&mut dyn RowSink>,
        deadline: &Deadline,
    ) -> Result<Image, DrawError> {
        let mut rgba = vec![0_u8; plan.width_px as usize * plan.height_px as usize * 4];
        let queue = sink.map(RowQueue::new);
        self.draw_bands(plan, deadline, (Goal::Picture, &mut rgba), |context, scratch, bins, band, out| {
            bands::draw(context, scratch, bins, band, out);
            if let Some(queue) = &queue {
                queue.push(context, band, out);
            }
        })?;
        drop(queue);
        Ok(Image { width_px: plan.width_px, height_px: plan.height_px, rgba: rgba.into() })
    }

    /// Draws the samples of all bands, and finds what light their pixels go without.
    fn find_occlusion(
        &self,
        context: &RasterContext<'_>,
        pass: &OcclusionPass,
        (occlusion, kept): (&mut Occlusion, &mut KeptSamples),
        (share, banding, bins): (&ThreadShare<'_>, Banding, &Bins),
    ) {
        let plan = context.plan;
        occlusion.grid.reset(pass, [plan.width_px, plan.height_px]);
        let (shape, stride) = (occlusion.grid.shape(), occlusion.grid.stride());
        let rows = occlusion.grid.picture_mut().chunks_mut(stride * banding.rows as usize);
        share.run(banding.at_once, rows.zip(kept.iter_mut()).enumerate(), |(band, (out, samples))| {
            if context.deadline.check().is_ok() {
                self.scratch.with(plan, banding, |scratch| {
                    scratch.with_kept(samples, false, |scratch| {
                        bands::write_places(context, pass, (scratch, bins, band), shape, out);
                    });
                });
            }
        });
        occlusion.find(context.isa, plan.samples, pass, context.deadline, share.pool());
    }

    /// Frees buffers that are too large to keep for another picture.
    fn trim(&mut self) {
        self.scratch.trim();
        if self.vertices.capacity() * size_of::<ScreenVertex>() > KEPT_BYTES_MAX {
            self.vertices = Vec::new();
        }
        if self.occlusion.allocated() > KEPT_BYTES_MAX {
            self.occlusion = Occlusion::default();
        }
        if self.flat.bytes() > KEPT_BYTES_MAX {
            self.flat = FlatColors::default();
        }
    }

    /// Memory that drawing the plan takes beside what grows with its mesh, bytes. On all threads,
    /// so that no refusal depends on what else is drawn.
    pub fn bands_bytes(&self, plan: &DrawPlan<'_>) -> u64 {
        let banding = Banding::new(plan, self.threads.count());
        let occlusion =
            plan.occlusion.as_ref().map_or(0, |pass| Occlusion::bytes(pass, [plan.width_px, plan.height_px]));
        (banding.bytes(plan) + occlusion + KeptSamples::bytes(plan, banding)) as u64
    }
}

impl CpuRenderer {
    /// Layer number `layer` alone, as [`Renderer::draw_visibility`] says, for tests that compare
    /// back-ends sample for sample.
    pub fn draw_layer(&mut self, plan: &DrawPlan<'_>, layer: u32, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        let mut words = vec![0_u64; plan.width_px as usize * plan.height_px as usize * plan.samples as usize];
        self.draw_bands(plan, deadline, (Goal::Samples, &mut words), |context, scratch, bins, band, words| {
            bands::draw_layer(context, scratch, bins, band, layer, words);
        })?;
        Ok(words)
    }
}

impl Renderer for CpuRenderer {
    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        self.draw_picture(plan, None, deadline)
    }

    fn draw_rows(
        &mut self,
        plan: &DrawPlan<'_>,
        sink: &mut dyn RowSink,
        deadline: &Deadline,
    ) -> Result<Image, DrawError> {
        self.draw_picture(plan, Some(sink), deadline)
    }

    fn draw_linear(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<LinearImage, DrawError> {
        let mut rgba = vec![[f16::ZERO; 4]; plan.width_px as usize * plan.height_px as usize];
        self.draw_bands(plan, deadline, (Goal::Picture, &mut rgba), bands::draw_linear)?;
        Ok(LinearImage { width_px: plan.width_px, height_px: plan.height_px, rgba })
    }

    fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        let mut words = vec![0_u64; plan.width_px as usize * plan.height_px as usize * plan.samples as usize];
        self.draw_bands(plan, deadline, (Goal::Samples, &mut words), |context, scratch, bins, band, words| {
            bands::draw_visibility(context, scratch, bins, band, words);
        })?;
        Ok(words)
    }

    fn draw_times(&self) -> DrawTimes {
        self.draw_times
    }

    fn kind(&self) -> BackendKind {
        BackendKind::Cpu
    }
}
