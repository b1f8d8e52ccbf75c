//! The dispatches and other GPU commands that draw a plan (all that is to be drawn for one picture), in the order of
//! the stages. They are computed by pure arithmetic, without a device.
//!
//! The picture is cut into horizontal bands, so that the sample buffer stays small. Triangles are cut into chunks, so
//! that the work list (the large ones among them) stays small. After each chunk of a large mesh, and each band, the
//! commands go to the device, so that no single submission takes long and the deadline is looked at in between.

pub(crate) mod line_shares;
pub(crate) mod sizes;
pub(crate) mod step;
#[cfg(test)]
pub(crate) mod test_plans;
pub(crate) mod tiles;
use self::sizes::{ALONE_SIZE, Banding, DeviceTraits, has_visibility, is_painted};
use self::step::{Band, Goal, Step};
use self::tiles::{Tiles, alone_size};
use super::params::{Batch, edge_lists, faces_code};
use crate::backend::DrawError;
use crate::backend::gpu::pass_mask::Pass;
use crate::backend::gpu::pipelines::{Kernel, SampleTarget, SampleWrite};
use crate::backend::sample_partition::POINTS;
use crate::plan::{DrawPlan, pass_mask};

/// Triangles per dispatch, where none needs clipping; each may leave one item in the work list.
const CHUNK: u32 = 1 << 20;

/// Triangles per dispatch where all may need clipping, into at most six pieces each.
const CHUNK_CLIP: u32 = 1 << 17;
pub const PIECES_MAX: u32 = 6;

/// Largest number of batches, 256 bytes each on the GPU: 128 MiB.
///
/// The most that a job within all other limits takes: of 4096 rows at 4 samples, layers make 32
/// bands of 128 rows. In each, 10 million triangles that may need clipping are 77 chunks, for the
/// surface and 16 layers, filled and hull, in two phases: 17 * 77 * 2 * 2 = 5236. A pass of 30
/// million edges that may be long is 229 chunks and three more for its coverage; 48 such passes are
/// 11,136. That makes 0.52 million; a job with more is refused. Margin rows are no bands of their own
/// and do not add to it. Mixed pixels take less: 512 rounds of 77 chunks, filled and hull, in two phases are 158,000.
/// In a band with layers, their lists are 77 more, and the search for thin triangles 10. Layers at 16 samples have four
/// times the bands: the largest such job is refused.
const BATCHES_MAX: usize = 1 << 19;

/// Rounds of mixed pixels that are queued on a real device before their number is read back. Waiting for it takes
/// longer than a few empty rounds.
const ROUNDS_QUEUED: u32 = 8;

/// Mixed pixels that a workgroup of a real device colours, one after the other. On software it colours one: a thread
/// may run 1,600 iterations for a pixel of 256 triangles, and thousands more to shade its share of them.
const PIXELS_EACH: u32 = 16;

/// Workgroups of a real device that look for thin triangles, at least: a few triangles may be thin and long.
const THIN_WORKGROUPS: u32 = 2048;

/// Workgroups of a real device that find the parts of mixed pixels, at most.
const PARTS_WORKGROUPS: u32 = 4096;

/// Pixels that have lists, for a workgroup on software: a thread runs 4,096 iterations for the longest list, and as
/// many again for its points.
const LISTS_EACH_SOFTWARE: u32 = 4;

/// Samples that a thread of the transform stage empties, at most.
const CLEARED_BY_THREAD: u32 = 4;

/// Threads of a workgroup, in every kernel.
pub const WORKGROUP: u32 = 64;

/// All commands for a plan.
#[derive(Debug)]
pub struct Schedule {
    pub steps: Vec<Step>,
    pub batches: Vec<Batch>,
    /// Number of rows in the largest band, and above and below it.
    pub banding: Banding,
    /// Items that the work list must hold.
    pub work_items: u32,
    /// Layers that are looked for in each band.
    pub layers: u32,
    /// Runs of the tile kernel, for samples.
    pub tiles: Tiles,
    /// The same for the points of mixed pixels.
    pub tiles_of_points: Tiles,
    /// Bytes for the state of paused workgroups of the edge kernel.
    pub progress_bytes: u64,
    /// The result.
    pub goal: Goal,
    /// True until the work list is first used: the transform stage has emptied it.
    is_work_empty: bool,
}

impl Schedule {
    /// The commands that compute `goal` for `plan`.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, goal: Goal) -> Result<Self, DrawError> {
        let banding = Banding::new(plan, device, goal)?;
        let tiles = Tiles::new(plan, device, banding, u64::from(plan.samples));
        let tiles_of_points = Tiles::new(plan, device, banding, POINTS as u64 / 4);
        let edge_starts = edge_lists(&plan.lines).1;
        let (steps, batches) = (Vec::new(), Vec::new());
        let mut schedule = Self {
            steps,
            batches,
            banding,
            work_items: 0,
            layers: 0,
            tiles,
            tiles_of_points,
            progress_bytes: 0,
            goal,
            is_work_empty: true,
        };
        schedule.transform(plan, device)?;
        let occlusion = plan.occlusion.is_some() && goal.is_shown();
        if occlusion {
            schedule.occlusion(plan, device)?;
        }
        for band in schedule.bands(plan, device) {
            // The only band's samples are there already.
            let is_seen = occlusion && banding.rows >= plan.height_px;
            if !is_seen {
                // The transform stage has emptied the first ones.
                let samples = occlusion || band.row_first > 0;
                schedule.steps.push(Step::ClearBand { samples });
                schedule.visibility(plan, device, band)?;
            }
            if has_visibility(plan) {
                schedule.layers(plan, device, band, goal)?;
            }
            if goal.is_shown() {
                schedule.picture_stages(plan, device, band, &edge_starts)?;
            }
            schedule.steps.push(Step::EndBand(Band { rows: [band.row_first as u32, band.row_end as u32] }));
        }
        Ok(schedule)
    }

    /// The bands of the picture.
    fn bands(&self, plan: &DrawPlan<'_>, device: &DeviceTraits) -> Vec<Batch> {
        let banding = self.banding;
        let [beyond, margin] = [banding.beyond, banding.margin].map(|px| px as i32);
        let band = |first: u32| {
            let end = plan.height_px.min(first + banding.rows);
            let [row_first, row_end] = [first as i32, end as i32];
            let seen = [row_first - margin, row_end + margin].map(|y| y.clamp(-beyond, plan.height_px as i32 + beyond));
            // Kernels that run per pixel cover the band's own rows only.
            Batch {
                row_first,
                row_end,
                column_end: plan.width_px as i32,
                seen_first: seen[0],
                seen_end: seen[1],
                seen_margin: beyond,
                rgba_at: if device.maps_pictures { first * plan.width_px } else { 0 },
                samples_at: plan.samples * (banding.seen_columns(plan) * row_first.abs_diff(seen[0]) + banding.beyond),
                list_capacity: banding.list_capacity(plan),
                part_capacity: banding.part_capacity(plan),
                ..Batch::default()
            }
        };
        (0..plan.height_px).step_by(banding.rows as usize).map(band).collect()
    }

    /// The visibility buffer of a band.
    fn visibility(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, band: Batch) -> Result<(), DrawError> {
        if !has_visibility(plan) {
            return Ok(());
        }
        let all = Batch {
            row_first: band.seen_first,
            row_end: band.seen_end,
            column_first: -band.seen_margin,
            column_end: band.column_end + band.seen_margin,
            samples_at: 0,
            ..band
        };
        self.triangles(device, all, SampleTarget::Visibility, Pass::of_visibility(plan))
    }

    /// The light that hollows go without, from the depths of all bands.
    fn occlusion(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits) -> Result<(), DrawError> {
        for band in self.bands(plan, device) {
            self.steps.push(Step::ClearBand { samples: band.row_first > 0 });
            self.visibility(plan, device, band)?;
            let count = plan.width_px * band.row_end.abs_diff(band.row_first);
            self.dispatch(device, Kernel::Grid, count, Batch { count, ..band })?;
            self.steps.push(Step::Submit);
        }
        let count = plan.width_px * plan.height_px;
        self.dispatch(device, Kernel::Gather, count, Batch { count, ..Batch::default() })
    }

    /// The runs of a tile kernel.
    pub fn tiles_of(&self, kernel: Kernel) -> &Tiles {
        match kernel {
            Kernel::VisibilityTile { target: SampleTarget::Points, .. } => &self.tiles_of_points,
            _ => &self.tiles,
        }
    }

    /// The kernels of all steps.
    pub fn kernels(&self) -> Vec<Kernel> {
        let mut kernels = Vec::new();
        for step in &self.steps {
            let kernel = match *step {
                Step::Dispatch { kernel, .. } | Step::Tiles { kernel, .. } => kernel,
                Step::Lines { .. } => Kernel::Edge,
                _ => continue,
            };
            if !kernels.contains(&kernel) {
                kernels.push(kernel);
            }
        }
        kernels
    }

    fn transform(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits) -> Result<(), DrawError> {
        let count = plan.positions.len() as u32;
        // The band's samples are at most 256 MiB.
        let cleared = if has_visibility(plan) { self.banding.seen_samples(plan) as u32 } else { 0 };
        if has_visibility(plan) || !plan.lines.is_empty() {
            let threads = count.max(cleared.div_ceil(CLEARED_BY_THREAD));
            self.dispatch(device, Kernel::Transform, threads, Batch { count, cleared, ..Batch::default() })?;
        }
        Ok(())
    }

    /// One round per peeled layer; a round does nothing if the previous one has left nothing to
    /// find.
    fn layers(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, band: Batch, goal: Goal) -> Result<(), DrawError> {
        let Some(pass) = plan.peeling() else { return Ok(()) };
        let rounds = match goal {
            Goal::Picture | Goal::Colors => pass.count_max,
            Goal::Samples => 0,
            Goal::Layer(layer) => layer + 1,
        };
        self.layers = rounds;
        let count = plan.width_px * band.row_end.abs_diff(band.row_first);
        // A layer drawn for a test is not shaded, so no sample is finished early.
        let pass_bit = if goal.is_shown() { u32::from(pass_mask::LAYER) } else { 0 };
        let mut ends = Vec::new();
        for layer in 0..rounds {
            self.steps.push(Step::ClearLayer);
            self.triangles(device, Batch { layer, ..band }, SampleTarget::Layer, Pass::of_peeling(plan))?;
            let batch = Batch { count, pass_bit, layer, ..band };
            self.dispatch(device, Kernel::Composite, count, batch)?;
            self.steps.push(Step::Submit);
            if self.tiles.in_rounds && goal.is_shown() {
                ends.push(self.steps.len());
                self.steps.push(Step::EndLayer { layer, end: 0 });
            }
        }
        let last = self.steps.len();
        for at in ends {
            if let Some(Step::EndLayer { end, .. }) = self.steps.get_mut(at) {
                *end = last;
            }
        }
        Ok(())
    }

    fn triangles(
        &mut self,
        device: &DeviceTraits,
        band: Batch,
        target: SampleTarget,
        passes: [Option<Pass>; 2],
    ) -> Result<(), DrawError> {
        // Lists take depth and id together.
        let at_once = device.int64_atomics || target == SampleTarget::Lists;
        let writes: &[SampleWrite] =
            if at_once { &[SampleWrite::Both] } else { &[SampleWrite::Depth, SampleWrite::Id] };
        // The depth phase must be complete before the id phase compares with it.
        for &write in writes {
            for Pass { ids, clip, faces, pass_bit } in passes.iter().flatten().cloned() {
                let (chunk, pieces) = if clip { (CHUNK_CLIP, PIECES_MAX) } else { (CHUNK, 1) };
                for first in ids.clone().step_by(chunk as usize) {
                    let in_chunk = chunk.min(ids.end - first);
                    let groups_each = self.tiles.groups_each(in_chunk);
                    if let (SampleTarget::Visibility, false, Some(groups_each)) = (target, clip, groups_each) {
                        let (count, pass_bit) = (in_chunk, u32::from(pass_bit));
                        let batch = Batch { first, count, faces: faces_code(faces), pass_bit, groups_each, ..band };
                        self.dispatch_groups(device, Kernel::VisibilityFew { write }, count * groups_each, batch)?;
                        continue;
                    }
                    let capacity = in_chunk * pieces;
                    self.work_items = self.work_items.max(capacity);
                    let batch = Batch {
                        first,
                        count: in_chunk,
                        faces: faces_code(faces),
                        capacity,
                        large_end: u32::MAX,
                        huge_end: u32::MAX,
                        pass_bit: u32::from(pass_bit),
                        alone_size: alone_size(in_chunk, target, device),
                        ..band
                    };
                    if !std::mem::take(&mut self.is_work_empty) {
                        self.steps.push(Step::ClearWork);
                    }
                    self.dispatch(device, Kernel::Visibility { write, target }, in_chunk, batch)?;
                    if clip {
                        self.dispatch(device, Kernel::Clip, in_chunk, batch)?;
                    }
                    let kernel = Kernel::VisibilityTile { write, target };
                    self.steps.push(Step::Tiles { kernel, batch: self.batches.len() - 1 });
                    if ids.len() > chunk as usize {
                        self.steps.push(Step::Submit);
                    }
                }
            }
        }
        Ok(())
    }

    /// The stages after visibility, for a band.
    fn picture_stages(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        band: Batch,
        edge_starts: &[u32],
    ) -> Result<(), DrawError> {
        let count = plan.width_px * band.row_end.abs_diff(band.row_first);
        let pixels = Batch { count, ..band };
        if self.is_painted(plan) {
            return self.dispatch(device, Kernel::Paint, count, pixels);
        }
        if plan.is_shaded() {
            self.dispatch(device, Kernel::Shade, count, pixels)?;
        }
        if plan.has_mixed() {
            self.mixed(plan, device, pixels)?;
        }
        self.lines(plan, device, pixels, edge_starts)?;
        match self.goal {
            Goal::Picture => self.dispatch(device, Kernel::Resolve, count, pixels),
            _ => Ok(()),
        }
    }

    /// True if one kernel makes the picture of the visibility buffer, and no colours are kept in between.
    pub fn is_painted(&self, plan: &DrawPlan<'_>) -> bool {
        self.goal == Goal::Picture && is_painted(plan)
    }

    /// The mixed pixels of a band.
    fn mixed(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, pixels: Batch) -> Result<(), DrawError> {
        let around = (plan.width_px + 2) * (pixels.row_first.abs_diff(pixels.row_end) + 2);
        self.dispatch(device, Kernel::Breaks, around, Batch { count: around, ..pixels })?;
        for Pass { ids, faces, pass_bit, .. } in Pass::of_visibility(plan).into_iter().flatten() {
            for first in ids.clone().step_by(CHUNK as usize) {
                let (count, pass_bit) = (CHUNK.min(ids.end - first), u32::from(pass_bit));
                let groups = count.div_ceil(WORKGROUP);
                let is_hardware = device.alone_size_of_few < ALONE_SIZE;
                let groups_each = if is_hardware { THIN_WORKGROUPS.div_ceil(groups) } else { 1 };
                let batch = Batch { first, count, faces: faces_code(faces), pass_bit, groups_each, ..pixels };
                self.dispatch_groups(device, Kernel::Thin, groups * groups_each, batch)?;
                if ids.len() > CHUNK as usize {
                    self.steps.push(Step::Submit);
                }
            }
        }
        self.dispatch(device, Kernel::MixedPixels, pixels.count, pixels)?;
        if !device.has_pixel_lists {
            return self.mixed_points(plan, device, pixels);
        }
        self.triangles(device, pixels, SampleTarget::Lists, Pass::of_visibility(plan))?;
        let each = if device.loops_are_limited { LISTS_EACH_SOFTWARE } else { PIXELS_EACH };
        let most = if device.loops_are_limited { u32::MAX } else { PARTS_WORKGROUPS };
        self.dispatch_groups(device, Kernel::MixedParts, pixels.count.div_ceil(each).min(most), pixels)?;
        let parts = self.banding.part_capacity(plan);
        self.dispatch(device, Kernel::MixedShade, parts, pixels)?;
        self.dispatch(device, Kernel::MixedSum, pixels.count, pixels)
    }

    /// The mixed pixels of a band by what each of their points sees: as many at a time as have room.
    fn mixed_points(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, pixels: Batch) -> Result<(), DrawError> {
        // Kernels leave all points clear, unless a software device ends their loops.
        if device.loops_are_limited {
            self.steps.push(Step::ClearPoints);
        }
        let slots = self.banding.slots(plan);
        let (queued, pixels_each) = if device.loops_are_limited { (1, 1) } else { (ROUNDS_QUEUED, PIXELS_EACH) };
        let mut ends = Vec::new();
        for first in (0..pixels.count).step_by(slots as usize) {
            if first > 0 && (first / slots).is_multiple_of(queued) {
                ends.push(self.steps.len());
                self.steps.push(Step::EndMixed { drawn: first, end: 0 });
            }
            let some = Batch { slots_first: first, slots_end: first + slots, ..pixels };
            self.triangles(device, some, SampleTarget::Points, Pass::of_visibility(plan))?;
            let workgroups = slots.div_ceil(pixels_each);
            self.dispatch_groups(device, Kernel::MixedColor, workgroups, Batch { count: slots, ..some })?;
            if plan.triangles.len() > CHUNK as usize {
                self.steps.push(Step::Submit);
            }
        }
        let last = self.steps.len();
        for at in ends {
            if let Some(Step::EndMixed { end, .. }) = self.steps.get_mut(at) {
                *end = last;
            }
        }
        Ok(())
    }

    pub(crate) fn dispatch(
        &mut self,
        device: &DeviceTraits,
        kernel: Kernel,
        threads: u32,
        batch: Batch,
    ) -> Result<(), DrawError> {
        self.dispatch_groups(device, kernel, threads.div_ceil(WORKGROUP), batch)
    }

    pub(crate) fn dispatch_groups(
        &mut self,
        device: &DeviceTraits,
        kernel: Kernel,
        workgroups: u32,
        batch: Batch,
    ) -> Result<(), DrawError> {
        if workgroups == 0 {
            return Ok(());
        }
        // Consecutive dispatches with equal parameters share a batch.
        if self.batches.last() != Some(&batch) {
            if self.batches.len() == BATCHES_MAX {
                return Err(DrawError::BeyondGpu(format!("it takes more than {BATCHES_MAX} dispatches")));
            }
            self.batches.push(batch);
        }
        let x = workgroups.min(device.workgroups_max);
        let batch = self.batches.len() - 1;
        self.steps.push(Step::Dispatch { kernel, batch, workgroups: [x, workgroups.div_ceil(x)] });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::schedule::test_plans::{Case, DEVICE, LARGEST, plan};
    use crate::plan::Shown;

    fn schedule(triangles: &[[u32; 3]], case: Case) -> Result<Schedule, DrawError> {
        Schedule::new(&plan(triangles, case), &DEVICE, Goal::Picture)
    }

    #[test]
    fn a_small_flat_picture_takes_three_kernels_and_no_clearing() {
        let hardware = DeviceTraits {
            alone_size_of_few: 1024,
            int64_atomics: true,
            loops_are_limited: false,
            tile_workgroups: 1024,
            ..DEVICE
        };
        let case = Case { size_px: [256; 2], is_peeled: false, passes: 0, ..LARGEST };
        let mut flat = plan(&[[0; 3]], case);
        flat.projection.clip = false;
        let schedule = Schedule::new(&flat, &hardware, Goal::Picture).unwrap();
        let few = Kernel::VisibilityFew { write: SampleWrite::Both };
        assert_eq!(schedule.kernels(), [Kernel::Transform, few, Kernel::Paint]);
        assert_eq!(schedule.steps.len(), 5, "{:?}", schedule.steps);
        assert_eq!(schedule.batches[0].cleared, 256 * 256 * 4);
        assert!(schedule.steps.contains(&Step::ClearBand { samples: false }));
        // Clipped triangles go to the work list, which is empty at first.
        let clipped = Schedule::new(&plan(&[[0; 3]], case), &hardware, Goal::Picture).unwrap();
        assert!(clipped.kernels().contains(&Kernel::Clip) && !clipped.steps.contains(&Step::ClearWork));
    }

    #[test]
    fn the_largest_job_is_scheduled_and_what_goes_beyond_is_refused() {
        let triangles = vec![[0; 3]; 10_000_000];
        let all = schedule(&triangles, Case { passes: 64, ..LARGEST }).unwrap();
        assert!(all.batches.len() > BATCHES_MAX / 8, "{}: the limit is far too high", all.batches.len());
        assert!(all.steps.len() < 8 * BATCHES_MAX);
        // Wide lines look far beyond their band, which costs no more bands.
        let wide = Case { passes: 64, width_px: 100.0, shown: Shown::Visible, ..LARGEST };
        let wide = schedule(&triangles, wide).unwrap();
        assert!(wide.banding.margin > 100 && wide.banding.rows == all.banding.rows, "{:?}", wide.banding);
        assert_eq!(wide.batches.len(), all.batches.len());
        // More samples are fewer rows in a band.
        let fine = schedule(&triangles, Case { samples: 16, passes: 64, ..LARGEST }).unwrap();
        assert!(fine.banding.rows < all.banding.rows, "{:?}", fine.banding);
        let few = &triangles[..1];
        assert!(schedule(few, Case { passes: 4096, ..LARGEST }).is_ok());
        let refused = schedule(few, Case { passes: 16_384, ..LARGEST }).unwrap_err();
        assert!(matches!(&refused, DrawError::BeyondGpu(reason) if reason.contains("dispatches")), "{refused}");
    }
}
