//! The distribution of the work on lines over GPU threads: how many edges a workgroup and a dispatch take, how many
//! slices of pixel rows a window (a range of an edge's length) is divided into, and after how much work a workgroup
//! pauses, so that no dispatch takes too long. The dispatches of stage lines are scheduled here too.

use super::CHUNK;
use super::sizes::{DeviceTraits, has_visibility};
use super::step::Step;
use crate::backend::DrawError;
use crate::backend::gpu::params::{Batch, faces_code, fade_places, line_flags};
use crate::backend::gpu::pass_mask::Pass;
use crate::backend::gpu::pipelines::Kernel;
use crate::backend::gpu::schedule::Schedule;
use crate::backend::sample_partition::POINTS;
use crate::plan::{DrawPlan, LinePass};

/// Edges per dispatch.
const EDGE_CHUNK: u32 = 1 << 20;

/// The same where each may cross a large picture, at least. On an NVIDIA H200 a dispatch of needles that
/// cross 4096 px in crowds takes about a second then.
const EDGE_CHUNK_LONG: u32 = 1 << 17;

/// Most edges per dispatch on a real device, times the width and height of the picture together.
const EDGE_PIXELS_LONG: u32 = 1 << 29;

/// Samples that a dispatch may read at most, if the length of its edges is not known: a second or
/// so of work.
const BLIND_LOOKS_MAX: u64 = 1 << 34;

/// Edges that keep all of a GPU busy.
const BUSY_EDGES: usize = 1 << 15;

/// Workgroups that keep all of a GPU busy, and all of a processor.
const BUSY_GROUPS: u32 = 4096;
const BUSY_GROUPS_SOFTWARE: u32 = 16;

/// Slices of a window, at most.
const SLICES_MAX: f32 = 64.0;

/// Loop iterations that a thread may run in a dispatch where they are limited: llvmpipe (Mesa 22)
/// leaves all loops of a thread after 65,535 iterations, silently.
const ITERATIONS_MAX: u32 = 60_000;

/// The same on a real device, where a dispatch should end in time for the deadline.
const ITERATIONS_MAX_HARDWARE: u32 = 1 << 24;

/// Lines from this reach on may take long on a real device too, pixels.
const WIDE_PX: f32 = 8.0;

/// Threads of a workgroup of the edge kernel.
pub const LINE_THREADS: u32 = 32;

/// Triangles that a workgroup remembers, and intervals that they hide of an edge.
pub const IDS_MAX: u32 = 512;
pub const INTERVALS_MAX: u32 = 512;

/// Units of work without end.
pub const NO_LIMIT: u32 = u32::MAX;

/// Faces per dispatch whose points a software device tests.
const SOFTWARE_FACES: u32 = 1 << 14;

/// Bytes before what paused workgroups remember: how many there are.
pub const PROGRESS_HEAD_BYTES: u64 = 4;

/// Bytes of what a paused workgroup remembers.
pub const PAUSED_BYTES: u64 = 12;

/// Parameters of the edge kernel for a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineShares {
    /// Shares of a window of an edge, by rows, where the line is so wide that it has many pixels.
    pub slices: u32,
    /// Edges of a workgroup.
    pub edges_per_group: u32,
    /// Edges per dispatch, at most.
    pub edges: u32,
    /// Units of work after which a workgroup pauses until the next round: looks at as many shares as it
    /// has threads, searches along a share, parts that are drawn. At least one of each.
    pub units: u32,
}

impl LineShares {
    /// The parameters of a pass of the plan.
    pub fn new(plan: &DrawPlan<'_>, lines: &LinePass, device: &DeviceTraits) -> Self {
        let side = lines.window_px() + 2.0 * lines.reach_px();
        // Few edges leave most of a GPU idle, so workgroups may look along them twice; a processor has
        // nothing to spare.
        let is_idle = !device.loops_are_limited && lines.edges.len() < BUSY_EDGES;
        let pixels = if is_idle { 256.0 } else { 1600.0 };
        let slices = (side * 2.0 * lines.reach_px() / pixels).ceil().clamp(1.0, SLICES_MAX) as u32;
        let groups = if device.loops_are_limited { BUSY_GROUPS_SOFTWARE } else { BUSY_GROUPS };
        let unit = unit_iterations(plan.samples, lines, slices);
        let units = match device.loops_are_limited {
            true => (ITERATIONS_MAX / unit).max(3),
            false if lines.reach_px() > WIDE_PX => (ITERATIONS_MAX_HARDWARE / unit).max(3),
            false => NO_LIMIT,
        };
        let edges = edges_a_dispatch(plan, lines, device);
        Self { slices, edges_per_group: edges.div_ceil(groups).clamp(1, LINE_THREADS), edges, units }
    }

    /// Bytes of what paused workgroups remember.
    pub fn progress_bytes(&self) -> u64 {
        let groups = self.edges.div_ceil(self.edges_per_group.max(1));
        if self.units == NO_LIMIT { 0 } else { PROGRESS_HEAD_BYTES + PAUSED_BYTES * u64::from(groups) }
    }
}

fn edges_a_dispatch(plan: &DrawPlan<'_>, lines: &LinePass, device: &DeviceTraits) -> u32 {
    // Half a pixel a step, the samples of up to three pixels in each.
    let longest = 2 * u64::from(plan.width_px + plan.height_px) * 3 * u64::from(plan.samples);
    let looks = longest.saturating_mul(lines.edges.len() as u64);
    let sides = (plan.width_px + plan.height_px).max(1);
    let long = match device.loops_are_limited {
        true => EDGE_CHUNK_LONG,
        false => (EDGE_PIXELS_LONG / sides).clamp(EDGE_CHUNK_LONG, EDGE_CHUNK),
    };
    let most = if looks > BLIND_LOOKS_MAX { long } else { EDGE_CHUNK };
    lines.edges.len().min(most as usize) as u32
}

/// Loop iterations of a thread that one unit of work takes at most.
fn unit_iterations(samples: u32, lines: &LinePass, slices: u32) -> u32 {
    let length = lines.window_px() + 2.0 * lines.reach_px() + 4.0;
    // Half a pixel a step.
    let steps = (2.0 * length) as u32 + 2;
    let of_threads = |items: u32| items.div_ceil(LINE_THREADS);
    let pixels = ((length as u32).div_ceil(slices) + 1) * (length as u32 + 1);
    // A thread looks at all pixels of its share for a mark.
    let look = pixels + LINE_THREADS.ilog2();
    // The table of triangles is emptied. Samples are looked at twice, then those of three pixels side by side;
    // each triangle may take 16 tries.
    let search = IDS_MAX / LINE_THREADS + 18 * of_threads(steps * samples) + 17 * of_threads(3 * steps * samples);
    // Each pixel has eight words of its mask filled by halves.
    let draw = of_threads(pixels) * (1 + 8 * 3);
    let run = of_threads(3 * steps * samples).max(INTERVALS_MAX / LINE_THREADS);
    look.max(search + draw).max(run + draw) + LINE_THREADS
}

impl Schedule {
    /// All passes of lines, one after the other, into rows of a band.
    pub(crate) fn lines(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        pixels: Batch,
        edge_starts: &[u32],
    ) -> Result<(), DrawError> {
        let fades = fade_places(&plan.lines);
        for (pass, ((lines, &edges_first), line_fade)) in (0..).zip(plan.lines.iter().zip(edge_starts).zip(fades)) {
            let shares = LineShares::new(plan, lines, device);
            let is_lit = lines.lit && plan.lights_lines();
            let first = if pass == 0 { line_flags::FIRST_PASS } else { 0 };
            let lined = Batch {
                edges_per_group: shares.edges_per_group,
                line_exponent: lines.square_exponent(),
                line_windows: 1.0 / lines.window_px(),
                line_slices: shares.slices,
                line_units: shares.units,
                line_peak: lines.peak(),
                line_width: lines.width_px,
                line_smoothing: lines.smoothing_px,
                tint_reach: lines.tint_reach(),
                unseen_part: lines.unseen_part_px(plan.samples),
                farther_samples: lines.farther_samples_max(plan.samples),
                line_flags: line_flags::of(plan, lines, has_visibility(plan)) | first,
                line_pass: pass,
                line_fade,
                ..pixels
            };
            if plan.fades_hidden(lines) {
                let flags = lined.line_flags & !(line_flags::SHOWN_VISIBLE | line_flags::TINTED_PASS);
                let mut whole = Batch { line_flags: flags, ..lined };
                if plan.has_fringes_under(lines) {
                    whole = with(whole, line_flags::FRINGES);
                    self.per_triangle(plan, device, (Kernel::Fringes, POINTS as u32 / 32), whole)?;
                }
                self.edges(device, lines, edges_first, shares, whole)?;
                self.dispatch(device, Kernel::Coverage, pixels.count, whole)?;
            }
            let has_holes = plan.has_holes_under(lines);
            if has_holes {
                self.holes(plan, device, lines, lined)?;
                self.edges(device, lines, edges_first, shares, with(lined, line_flags::RIM_PASS))?;
            }
            let flag = if has_holes { line_flags::HOLES } else { 0 };
            let lined = with(lined, flag);
            self.edges(device, lines, edges_first, shares, lined)?;
            if is_lit {
                self.dispatch(device, Kernel::LineLight, pixels.count, lined)?;
            }
            self.dispatch(device, Kernel::Coverage, pixels.count, lined)?;
        }
        Ok(())
    }

    /// The holes of a pass's faces in rows of a band, and their tips.
    fn holes(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        lines: &LinePass,
        lined: Batch,
    ) -> Result<(), DrawError> {
        let beyond = 2 * lines.hidden_reach_px();
        let rows = lined.row_end.abs_diff(lined.row_first) + beyond;
        self.dispatch(device, Kernel::Holes, (plan.width_px + beyond) * rows, lined)?;
        self.per_triangle(plan, device, (Kernel::Tips, 1), lined)
    }

    /// A kernel of lines that looks at each triangle of the surface, with so many threads.
    fn per_triangle(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        (kernel, threads): (Kernel, u32),
        lined: Batch,
    ) -> Result<(), DrawError> {
        let Some(Pass { ids, faces, pass_bit, .. }) = Pass::of_visibility(plan)[0].clone() else { return Ok(()) };
        // Points take long: a software device would draw those of many faces in a dispatch that no deadline ends.
        let many = if device.loops_are_limited && threads > 1 { SOFTWARE_FACES } else { CHUNK / threads };
        for first in ids.clone().step_by(many as usize) {
            let (count, pass_bit) = (many.min(ids.end - first), u32::from(pass_bit));
            let batch = Batch { first, count, faces: faces_code(faces), pass_bit, ..lined };
            self.dispatch(device, kernel, count * threads, batch)?;
            if threads > 1 && count < ids.end - ids.start {
                self.steps.push(Step::Submit);
            }
        }
        Ok(())
    }

    /// The edges of a pass, in as many dispatches as that takes.
    fn edges(
        &mut self,
        device: &DeviceTraits,
        lines: &LinePass,
        edges_first: u32,
        shares: LineShares,
        lined: Batch,
    ) -> Result<(), DrawError> {
        let edges = lines.edges.len() as u32;
        for first in (0..edges).step_by(shares.edges.max(1) as usize) {
            let count = shares.edges.min(edges - first);
            let batch = Batch { first: edges_first.saturating_add(first), count, ..lined };
            let groups = count.div_ceil(shares.edges_per_group);
            self.dispatch_groups(device, Kernel::Edge, groups, batch)?;
            let progress_bytes = shares.progress_bytes();
            if let (Some(Step::Dispatch { batch, workgroups, .. }), true) =
                (self.steps.last().copied(), progress_bytes > 0)
            {
                self.steps.pop();
                self.steps.push(Step::Lines { batch, workgroups });
                self.progress_bytes = self.progress_bytes.max(progress_bytes);
            } else if edges > shares.edges {
                self.steps.push(Step::Submit);
            }
        }
        Ok(())
    }
}

/// A batch with a further bit of [`line_flags`].
fn with(lined: Batch, flag: u32) -> Batch {
    Batch { line_flags: lined.line_flags | flag, ..lined }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::schedule::step::Goal;
    use crate::backend::gpu::schedule::test_plans::{Case, DEVICE, LARGEST, each_case, edges, lines, plan};
    use crate::plan::Shown;

    #[test]
    fn edges_that_may_be_long_are_drawn_few_at_a_time() {
        for (count, size_px, most) in [(2 << 20, 512, 1 << 17), (200_000, 512, 200_000), (200_000, 4096, 1 << 17)] {
            let case = Case { size_px: [size_px; 2], ..LARGEST };
            let mut plan = plan(&[], case);
            plan.lines = vec![lines(edges(count), 1.0, Shown::Visible)];
            assert_eq!(LineShares::new(&plan, &plan.lines[0], &DEVICE).edges, most, "{count} edges, {size_px} px");
            let schedule = Schedule::new(&plan, &DEVICE, Goal::Picture).unwrap();
            let drawn = schedule.steps.iter().filter(|step| matches!(step, Step::Lines { .. })).count();
            let bands = size_px.div_ceil(schedule.banding.rows);
            assert_eq!(drawn as u32, bands * count.div_ceil(most));
        }
    }

    #[test]
    fn a_real_gpu_gets_fewer_edges_at_a_time_the_larger_the_picture() {
        let real = DeviceTraits { loops_are_limited: false, ..DEVICE };
        for (size_px, most) in [(128, 1 << 20), (512, 1 << 19), (4096, 1 << 17)] {
            let mut plan = plan(&[], Case { size_px: [size_px; 2], ..LARGEST });
            plan.lines = vec![lines(edges(2 << 20), 1.0, Shown::Visible)];
            assert_eq!(LineShares::new(&plan, &plan.lines[0], &real).edges, most, "{size_px} px");
        }
    }

    #[test]
    fn a_unit_of_work_ends_before_a_loop_would_be_left() {
        let mut cases = 0;
        each_case(|plan, case| {
            let Some(lines) = plan.lines.first() else { return };
            let LineShares { slices, units, .. } = LineShares::new(plan, lines, &DEVICE);
            let iterations = unit_iterations(plan.samples, lines, slices);
            assert!(units >= 3 && u64::from(units) * u64::from(iterations) <= 65_535, "{iterations}: {case:?}");
            cases += 1;
        });
        assert!(cases > 100, "{cases}");
    }
}
