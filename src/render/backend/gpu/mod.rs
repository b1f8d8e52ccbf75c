//! The GPU back-end, which draws pictures with wgpu, without a window. Its stages are those of the
//! CPU back-end, written as compute shaders.
//!
//! In reading order: `device` opens a GPU, and `handles` holds the parts of it that buffers need;
//! `schedule` computes the dispatches for a plan (all that is to be drawn for one picture) as a
//! list of steps; `execute` in this file walks through the steps, and `recorder` writes the
//! commands of each; `pipelines` holds each kernel's source, bindings and specialisation;
//! `stage_clock` times the stages; `params` holds the uniforms, `buffers` the memory of a job (the
//! drawing of one picture), which `upload` fills, `staging` the buffers that pictures are read
//! from, `residents` the data of meshes that stay in memory for the next job, `gang` the jobs that
//! share dispatches, `pass_mask` the passes over triangles, `linear` pictures in linear light.
//! `displays` turns off a layer of Mesa that could only print an error.
//!
//! **Invariant:** a job uses the device on one thread only, because wgpu's error scopes belong to a
//! thread. Other threads may make its pipelines, in error scopes of their own.

mod buffers;
mod device;
mod displays;
mod gang;
mod handles;
mod linear;
pub(super) mod params;
pub(crate) mod pass_mask;
pub(crate) mod pipelines;
mod recorder;
mod residents;
pub(super) mod schedule;
mod stage_clock;
mod staging;
mod upload;

use std::sync::Arc;

pub use self::device::{AtomicsChoice, Gpu};
pub use self::displays::ignore_displays;
pub use self::schedule::sizes::bands_bytes;
pub use crate::backend::{GpuInfo, GpuKind};

use self::buffers::Buffers;
use self::gang::{GangShare, Seat as _, Turn, may_share};
use self::pipelines::Slot;
use self::pipelines::key::pipeline_key;
use self::recorder::Recorder;
use self::schedule::Schedule;
use self::schedule::sizes::{DeviceTraits, SAMPLE_BYTES, STROKES_BYTES, has_visibility, owner_bytes, samples};
use self::schedule::step::{Band, Goal, Step};
use self::stage_clock::StageClock;
use self::staging::Mapped;
use self::upload::{upload_geometry, upload_shading};
use super::{BackendKind, DrawError, DrawTimes, Renderer};
use crate::image::{Image, LinearImage, Pixels};
use crate::limits::Deadline;
use crate::plan::DrawPlan;

/// Makes the pipelines for a picture of the plan.
fn make_pipelines_of(gpu: &Gpu, plan: &DrawPlan<'_>) -> Result<(), DrawError> {
    let schedule = Schedule::new(plan, &traits(gpu), Goal::Picture)?;
    gpu.make_pipelines(&schedule.kernels(), pipeline_key(plan))
}

/// The same for a gang of such plans, if they can share dispatches.
fn make_pipelines_of_gangs(gpu: &Gpu, plan: &DrawPlan<'_>) -> Result<(), DrawError> {
    match share_of(gpu, plan)? {
        Some((schedule, share)) => gpu.make_pipelines(&schedule.kernels(), share.key()),
        None => Ok(()),
    }
}

/// The plan's schedule and share, if it can be drawn in a gang.
fn share_of(gpu: &Gpu, plan: &DrawPlan<'_>) -> Result<Option<(Schedule, GangShare)>, DrawError> {
    if !gpu.handles.maps_storage || !may_share(plan) {
        return Ok(None);
    }
    let schedule = Schedule::new(plan, &DeviceTraits { maps_pictures: true, ..traits(gpu) }, Goal::Picture)?;
    Ok(GangShare::of(plan, &schedule).map(|share| (schedule, share)))
}

/// Workgroups that share the large triangles: enough to fill a large GPU.
const TILE_WORKGROUPS: u32 = 1024;

/// The same on a software implementation, where idle workgroups cost time.
const TILE_WORKGROUPS_SOFTWARE: u32 = 64;

/// Draws on the GPU. Each worker has its own; the device, its pipelines and buffers are shared.
pub struct GpuRenderer {
    gpu: Arc<Gpu>,
    /// Of the last picture, by the device's clock.
    draw_times: DrawTimes,
}

impl GpuRenderer {
    /// A renderer on an opened GPU.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        gpu.renderer_made();
        Self { gpu, draw_times: DrawTimes::default() }
    }

    /// The GPU that it draws on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Layer number `layer` alone, as [`Renderer::draw_visibility`] says, for tests that compare
    /// back-ends sample for sample.
    pub fn draw_layer(&mut self, plan: &DrawPlan<'_>, layer: u32, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        match plan.peeling() {
            Some(_) => self.words(plan, Goal::Layer(layer), Slot::PeelLayer, deadline),
            None => Ok(vec![0; plan.width_px as usize * plan.samples as usize * plan.height_px as usize]),
        }
    }

    /// Final content of a buffer of samples.
    fn words(
        &mut self,
        plan: &DrawPlan<'_>,
        goal: Goal,
        slot: Slot,
        deadline: &Deadline,
    ) -> Result<Vec<u64>, DrawError> {
        deadline.check()?;
        let row_words = plan.width_px as usize * plan.samples as usize;
        let len = row_words * plan.height_px as usize;
        if len == 0 || !has_visibility(plan) {
            return Ok(vec![0; len]);
        }
        self.job(|gpu, buffers| {
            let schedule = Schedule::new(plan, &traits(gpu), goal)?;
            gpu.make_pipelines(&schedule.kernels(), pipeline_key(plan))?;
            upload_geometry(gpu, buffers, plan, &schedule)?;
            buffers.staging(&gpu.handles, u64::from(schedule.banding.rows) * row_words as u64 * 8)?;
            let mut recorder = Recorder::new(gpu, deadline, buffers, plan, &schedule.batches)?;
            let mut words = Vec::with_capacity(len);
            execute(&mut recorder, plan, &schedule, |recorder, band| {
                let size = u64::from(band.rows[1] - band.rows[0]) * row_words as u64 * 8;
                recorder.copy_out(slot, 0, size, 0)?;
                recorder.read_staging(size, |bytes| {
                    words.extend(bytes.chunks_exact(8).map(|b| u64::from_le_bytes(std::array::from_fn(|i| b[i]))));
                })
            })?;
            Ok(words)
        })
    }

    /// Runs `job` in an error scope and returns its buffers afterwards.
    fn job<T>(&self, job: impl FnOnce(&Gpu, &mut Buffers) -> Result<T, DrawError>) -> Result<T, DrawError> {
        self.gpu.check()?;
        let mut buffers = self.gpu.spare_buffers.take();
        let result = self.gpu.scoped(|| job(&self.gpu, &mut buffers));
        let filled = buffers.unbind_all();
        if result.is_ok() {
            // Not before: a buffer may not have been filled if something went wrong.
            filled.into_iter().for_each(|(slot, source, buffer)| self.gpu.residents.keep(slot, &source, buffer));
        }
        // After an error the buffers may still be in use, and the staging buffer may be half
        // mapped.
        if result.is_ok() {
            self.gpu.spare_buffers.give_back(buffers);
        }
        result
    }
}

impl Drop for GpuRenderer {
    fn drop(&mut self) {
        self.gpu.renderer_dropped();
    }
}

impl Renderer for GpuRenderer {
    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        match self.draw_once(plan, deadline) {
            // Perhaps there was no memory left.
            Err(DrawError::Device(_)) if self.gpu.free_spare_memory() => self.draw_once(plan, deadline),
            result => result,
        }
    }

    fn draw_linear(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<LinearImage, DrawError> {
        match self.draw_linear_once(plan, deadline) {
            Err(DrawError::Device(_)) if self.gpu.free_spare_memory() => self.draw_linear_once(plan, deadline),
            result => result,
        }
    }

    fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        self.words(plan, Goal::Samples, Slot::Samples, deadline)
    }

    fn draw_times(&self) -> DrawTimes {
        self.draw_times
    }

    fn kind(&self) -> BackendKind {
        BackendKind::Gpu
    }
}

impl GpuRenderer {
    fn draw_once(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        self.draw_times = DrawTimes::default();
        deadline.check()?;
        let row_bytes = u64::from(plan.width_px) * 4;
        let size = row_bytes * u64::from(plan.height_px);
        let image = Image { width_px: plan.width_px, height_px: plan.height_px, rgba: Vec::new().into() };
        if size == 0 {
            return Ok(image);
        }
        let drawing = self.gpu.begin_job();
        // A job that finds the device idle is drawn at once, and timed.
        let may_gang = !drawing.is_alone && self.gpu.draws_gangs();
        let leading = match if may_gang { self.turn(plan, deadline)? } else { None } {
            Some(Drawn::InGang(rgba)) => return Ok(Image { rgba, ..image }),
            Some(Drawn::Alone(leading)) => Some(leading),
            None => None,
        };
        let (rgba, times) = match self.draw_alone(plan, deadline, drawing.is_alone, true)? {
            Some(drawn) => drawn,
            None => {
                tracing::debug!("mixed pixels have more triangles than their lists have room for");
                self.gpu.picture_overflowed();
                let drawn = self.draw_alone(plan, deadline, drawing.is_alone, false)?;
                drawn.ok_or_else(|| DrawError::Device("it found no room where none is needed".to_owned()))?
            }
        };
        drop(leading);
        self.draw_times = times;
        Ok(Image { rgba, ..image })
    }

    /// A picture's pixels, drawn with buffers of its own, and the times of its stages if they are asked for. None if
    /// mixed pixels were to have lists and there was no room for them.
    fn draw_alone(
        &self,
        plan: &DrawPlan<'_>,
        deadline: &Deadline,
        is_timed: bool,
        has_pixel_lists: bool,
    ) -> Result<Option<(Pixels, DrawTimes)>, DrawError> {
        let row_bytes = u64::from(plan.width_px) * 4;
        let size = row_bytes * u64::from(plan.height_px);
        let times_at = size.next_multiple_of(8);
        let counts_at = times_at + StageClock::BYTES;
        // For each band the number of mixed pixels, and whether there was no room for their lists. No band is empty.
        let counts_end = counts_at + if plan.has_mixed() { 8 * u64::from(plan.height_px) } else { 0 };
        self.job(|gpu, buffers| {
            let staging = buffers.staging(&gpu.handles, counts_end)?.clone();
            let device = traits(gpu);
            // Kernels write the bytes to where the CPU reads them, if they can.
            let maps_pictures = gpu.handles.maps_storage && staging.size() <= device.binding_bytes_max;
            let device = DeviceTraits { maps_pictures, has_pixel_lists, ..device };
            let schedule = Schedule::new(plan, &device, Goal::Picture)?;
            gpu.make_pipelines(&schedule.kernels(), pipeline_key(plan))?;
            upload_geometry(gpu, buffers, plan, &schedule)?;
            upload_shading(gpu, buffers, plan, &schedule)?;
            if maps_pictures {
                buffers.bind(Slot::Rgba, staging);
            } else {
                let band_bytes = row_bytes * u64::from(schedule.banding.rows);
                buffers.reserve(&gpu.handles, Slot::Rgba, band_bytes)?;
            }
            let mut recorder = Recorder::new(gpu, deadline, buffers, plan, &schedule.batches)?;
            if is_timed {
                recorder.start_clock();
            }
            let mut counts = 0;
            execute(&mut recorder, plan, &schedule, |recorder, Band { rows: [first, end] }| {
                if plan.has_mixed() {
                    recorder.copy_out(Slot::Mixed, 0, 8, counts_at + 8 * counts)?;
                    counts += 1;
                }
                if !maps_pictures {
                    let to = u64::from(first) * row_bytes;
                    recorder.copy_out(Slot::Rgba, 0, u64::from(end - first) * row_bytes, to)?;
                }
                if end == plan.height_px {
                    recorder.copy_times(times_at);
                }
                recorder.submit()
            })?;
            let read = if is_timed || counts > 0 { counts_at + 8 * counts } else { times_at };
            let mapped = Arc::new(recorder.take_staging(read)?);
            let (times, counts) =
                mapped.bytes()[times_at as usize..].split_at((read.min(counts_at) - times_at) as usize);
            let mut times = recorder.times(times);
            let (counts, _) = counts.as_chunks::<8>();
            let words = counts.iter().map(|words| bytemuck::pod_read_unaligned::<[u32; 2]>(words));
            if words.clone().any(|[_, is_full]| is_full != 0) {
                return Ok(None);
            }
            times.mixed_pixels = words.map(|[count, _]| u64::from(count)).sum();
            Ok(Some((Mapped::pixels(&mapped, 0..size as usize), times)))
        })
    }
}

impl GpuRenderer {
    /// Draws plans in one gang, for tests that compare that with drawing them one by one. None if they cannot share
    /// dispatches.
    pub fn draw_together(&mut self, plans: &[&DrawPlan<'_>]) -> Result<Option<Vec<Pixels>>, DrawError> {
        let mut shares: Vec<GangShare> = Vec::new();
        for plan in plans {
            let Some((_, share)) = share_of(&self.gpu, plan)? else { return Ok(None) };
            if shares.first().is_some_and(|first| !first.is_alike(&share)) || shares.len() == share.gang_max() {
                return Ok(None);
            }
            shares.push(share);
        }
        let Some(Some((schedule, _))) = plans.first().map(|plan| share_of(&self.gpu, plan)).transpose()? else {
            return Ok(None);
        };
        let pictures = gang::draw(&self.gpu, plans[0], &schedule, &shares)?;
        Ok(Some((0..shares.len()).map(|job| pictures.rgba(job)).collect()))
    }

    /// Waits for the job's turn among those that are alike. None if it is to be drawn alone.
    fn turn(&self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Option<Drawn<'_>>, DrawError> {
        let Some((schedule, share)) = share_of(&self.gpu, plan)? else { return Ok(None) };
        let drawn = match self.gpu.gangs.turn(share, deadline)? {
            Turn::Lead(leading) if leading.seats().len() == 1 => return Ok(Some(Drawn::Alone(leading))),
            Turn::Lead(leading) => {
                let pictures = gang::draw(&self.gpu, plan, &schedule, leading.seats());
                leading.give(pictures.as_ref().ok());
                // Where that has failed, each is drawn again, alone, and has its own error then.
                pictures.inspect_err(|error| tracing::debug!(%error, "a gang was not drawn")).ok().map(|all| (all, 0))
            }
            Turn::Drawn(drawn) => drawn,
        };
        deadline.check()?;
        Ok(drawn.map(|(pictures, job)| Drawn::InGang(pictures.rgba(job))))
    }
}

/// A job's turn, when it has come.
enum Drawn<'a> {
    /// The pixels of its picture.
    InGang(Pixels),
    /// It is to be drawn alone, before this is dropped.
    Alone(gang::Leading<'a, GangShare, gang::Pictures>),
}

fn traits(gpu: &Gpu) -> DeviceTraits {
    DeviceTraits {
        binding_bytes_max: gpu.handles.limits.max_storage_buffer_binding_size.min(gpu.handles.limits.max_buffer_size),
        workgroups_max: gpu.handles.limits.max_compute_workgroups_per_dimension,
        tile_workgroups: if gpu.is_software() { TILE_WORKGROUPS_SOFTWARE } else { TILE_WORKGROUPS },
        alone_size_of_few: gpu.alone_size_of_few,
        maps_pictures: false,
        int64_atomics: gpu.int64_atomics,
        loops_are_limited: gpu.is_software(),
        has_pixel_lists: true,
    }
}

/// Records all steps; `end_band` takes a finished band's rows away.
fn execute<'a>(
    recorder: &mut Recorder<'a>,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
    mut end_band: impl FnMut(&mut Recorder<'a>, Band) -> Result<(), DrawError>,
) -> Result<(), DrawError> {
    let mut next = 0;
    while let Some(step) = schedule.steps.get(next) {
        next += 1;
        match *step {
            Step::ClearBand { samples } => clear_band(recorder, plan, schedule, samples)?,
            Step::ClearLayer => {
                recorder.clear(Slot::PeelLayer, samples(plan, schedule.banding.rows) * SAMPLE_BYTES)?;
            }
            Step::EndLayer { layer, end } => {
                if recorder.read_word(Slot::PeelRounds, layer)? == 0 {
                    next = end;
                }
            }
            Step::ClearPoints => recorder.clear(Slot::Points, schedule.banding.points_bytes(plan))?,
            Step::EndMixed { drawn, end } => {
                if recorder.read_word(Slot::Mixed, 0)? <= drawn {
                    next = end;
                }
            }
            Step::ClearWork => recorder.clear(Slot::Work, 8)?,
            Step::Dispatch { kernel, batch, workgroups } => recorder.dispatch(kernel, batch, workgroups)?,
            Step::Lines { batch, workgroups } => {
                recorder.lines_in_rounds(batch, workgroups, schedule.progress_bytes)?;
            }
            Step::Tiles { kernel, batch } if schedule.tiles_of(kernel).in_rounds => {
                recorder.tiles_in_rounds(kernel, &schedule.batches[batch], schedule.tiles_of(kernel))?;
            }
            Step::Tiles { kernel, batch } => recorder.dispatch(kernel, batch, [schedule.tiles.workgroups, 1])?,
            Step::Submit => recorder.submit()?,
            Step::EndBand(band) => end_band(recorder, band)?,
        }
    }
    Ok(())
}

fn clear_band(
    recorder: &mut Recorder<'_>,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
    clears_samples: bool,
) -> Result<(), DrawError> {
    if schedule.layers > 0 {
        recorder.clear(Slot::PeelRounds, u64::from(schedule.layers) * 4)?;
    }
    if has_visibility(plan) && clears_samples {
        recorder.clear(Slot::Samples, schedule.banding.seen_samples(plan) * SAMPLE_BYTES)?;
    }
    if schedule.goal.is_shown() && !plan.lines.is_empty() {
        let pixels = u64::from(plan.width_px) * u64::from(schedule.banding.rows);
        recorder.clear(Slot::Strokes, pixels * STROKES_BYTES)?;
        if owner_bytes(plan) > 0 {
            recorder.clear(Slot::Owners, pixels * owner_bytes(plan))?;
        }
    }
    Ok(())
}
