//! The wgpu back-end: the CPU's stages as compute shaders, headless.
//!
//! In reading order: `device` opens a GPU; `schedule` computes the dispatches for a plan;
//! `recorder` turns them into commands; `pipelines` holds each kernel's source, bindings and
//! specialisation; `stage_clock` times the stages; `params` holds the uniforms, `buffers` a job's memory,
//! `staging` the buffers that pictures are read from, `residents` what stays in memory for the next job,
//! `gang` the jobs that share dispatches, `pass_mask` the passes over triangles, `linear` pictures in linear
//! light. `displays` keeps drivers from looking for a window system.
//!
//! **Invariant:** a job uses the device on one thread only, because wgpu's error scopes belong to a
//! thread.

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

use std::sync::Arc;

pub use self::device::{AtomicsChoice, Gpu};
pub use self::displays::ignore_displays;
pub use self::schedule::sizes::bands_bytes;
pub use crate::backend::{GpuInfo, GpuKind};

use self::buffers::Buffers;
use self::gang::{GangShare, Seat as _, Turn, may_share};
use self::params::{attributes, corner_triangles, edge_lists, hull_materials, sample_masks, texture_table};
use self::pipelines::Slot;
use self::pipelines::key::pipeline_key;
use self::recorder::Recorder;
use self::residents::{ListLookup, Source};
use self::schedule::Schedule;
use self::schedule::sizes::{
    DeviceTraits, PEEL_STATE_BYTES, SAMPLE_BYTES, STROKES_BYTES, color_bytes, has_visibility, occlusion_bytes,
    owner_bytes, samples, work_bytes,
};
use self::schedule::step::{Band, Goal, Step};
use self::stage_clock::StageClock;
use self::staging::Mapped;
use super::{BackendKind, DrawError, DrawTimes, Renderer};
use crate::image::{Image, LinearImage, Pixels, srgb8_thresholds};
use crate::limits::Deadline;
use crate::plan::{CornerValues, DrawPlan, HullVertex, SurfacePass};

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

/// Gives a slot its input: the buffer that is kept for its source, or else the slices.
fn supply(
    gpu: &Gpu,
    buffers: &mut Buffers,
    slot: Slot,
    source: Option<Source>,
    parts: &[&[u8]],
) -> Result<(), DrawError> {
    if let Some(source) = &source {
        let buffer = match gpu.residents.find(slot, source) {
            ListLookup::Buffer(buffer) => Some(buffer),
            ListLookup::Wanted => {
                let buffer = Buffers::filled(&gpu.handles, parts)?;
                buffers.keep_later(slot, source, &buffer);
                Some(buffer)
            }
            ListLookup::Unwanted => None,
        };
        if let Some(buffer) = buffer {
            buffers.bind(slot, buffer);
            return Ok(());
        }
    }
    buffers.upload_slices(&gpu.handles, slot, parts)
}

/// Supplies the input of transform and visibility, and reserves their output.
fn upload_geometry(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
) -> Result<(), DrawError> {
    let mesh = plan.mesh.as_ref();
    let positions = Source::of(&plan.positions, mesh);
    supply(gpu, buffers, Slot::Positions, positions, &[bytemuck::cast_slice(&plan.positions)])?;
    let (corners, own) = plan.hull.as_ref().map_or((&[][..], &[][..]), |hull| (&hull.triangles, &hull.vertices));
    let triangles = Source::of(&plan.triangles, mesh).filter(|_| corners.is_empty());
    let slices = [bytemuck::cast_slice(&plan.triangles), bytemuck::cast_slice(corners)];
    supply(gpu, buffers, Slot::Triangles, triangles, &slices)?;
    let gpu = &gpu.handles;
    let transformed = plan.positions.len() as u64 * size_of::<HullVertex>() as u64;
    buffers.upload_at(gpu, Slot::Vertices, transformed, bytemuck::cast_slice(own))?;
    if let Some(hull) = &plan.hull {
        buffers.upload(gpu, Slot::HullMaterials, &hull_materials(hull))?;
    }
    if !has_visibility(plan) {
        return Ok(());
    }
    buffers.upload(gpu, Slot::PassMasks, &plan.pass_masks)?;
    buffers.reserve(gpu, Slot::Samples, schedule.banding.seen_samples(plan) * SAMPLE_BYTES)?;
    let samples = samples(plan, schedule.banding.rows);
    if plan.peeling().is_some() {
        buffers.reserve(gpu, Slot::PeelLayer, samples * SAMPLE_BYTES)?;
        buffers.reserve(gpu, Slot::PeelState, samples * PEEL_STATE_BYTES)?;
        buffers.reserve(gpu, Slot::PeelRounds, u64::from(schedule.layers) * 4)?;
    }
    buffers.reserve(gpu, Slot::Work, work_bytes(schedule.work_items))?;
    Ok(())
}

/// Supplies the input of shade, lines and resolve, and reserves their output.
fn upload_shading(gpu: &Gpu, buffers: &mut Buffers, plan: &DrawPlan<'_>, schedule: &Schedule) -> Result<(), DrawError> {
    let band_pixels = u64::from(plan.width_px) * u64::from(schedule.banding.rows);
    if !schedule.is_painted(plan) && (has_visibility(plan) || !plan.lines.is_empty()) {
        buffers.reserve(&gpu.handles, Slot::Colors, band_pixels * color_bytes(plan))?;
    }
    if plan.has_mixed() {
        buffers.reserve(&gpu.handles, Slot::Mixed, schedule.banding.mixed_bytes(plan))?;
        buffers.reserve(&gpu.handles, Slot::Lists, schedule.banding.lists_bytes(plan))?;
        // It is all zeros when a job begins: mixed_color.wgsl clears what it reads, a new buffer is clear, and a job
        // that fails does not give its buffers back.
        buffers.reserve(&gpu.handles, Slot::Points, schedule.banding.points_bytes(plan))?;
    }
    if plan.occlusion.is_some() {
        buffers.reserve(&gpu.handles, Slot::Occlusion, occlusion_bytes(plan))?;
    }
    if let Some(surface) = &plan.surface {
        upload_surface(gpu, buffers, plan, surface)?;
    }
    if !plan.lines.is_empty() {
        let (lists, _) = edge_lists(&plan.lines);
        let slices: Vec<&[u8]> = lists.iter().map(|list| bytemuck::cast_slice(list)).collect();
        let source = plan.lines.first().filter(|_| lists.len() == 1);
        let source = source.and_then(|lines| Source::of_arc(&lines.edges, size_of_val(&lines.edges[..])));
        supply(gpu, buffers, Slot::Edges, source, &slices)?;
        let gpu = &gpu.handles;
        let colors: Vec<[f32; 4]> = plan.lines.iter().map(|lines| lines.color).collect();
        buffers.upload(gpu, Slot::LineColors, bytemuck::cast_slice(&colors))?;
        buffers.upload(gpu, Slot::SampleMasks, bytemuck::cast_slice(&sample_masks(plan.samples)))?;
        buffers.reserve(gpu, Slot::Strokes, band_pixels * STROKES_BYTES)?;
        buffers.reserve(gpu, Slot::Progress, schedule.progress_bytes)?;
        if owner_bytes(plan) > 0 {
            buffers.reserve(gpu, Slot::Owners, band_pixels * owner_bytes(plan))?;
        }
    }
    buffers.upload(&gpu.handles, Slot::Thresholds, bytemuck::cast_slice(&srgb8_thresholds()))?;
    Ok(())
}

/// Supplies what shading reads of the surface.
fn upload_surface(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    surface: &SurfacePass<'_>,
) -> Result<(), DrawError> {
    let mesh = plan.mesh.as_ref();
    if surface.edge_masks.is_empty() {
        let materials = &surface.triangle_materials;
        supply(gpu, buffers, Slot::Attributes, Source::of(materials, mesh), &[bytemuck::cast_slice(materials)])?;
    } else {
        buffers.upload(&gpu.handles, Slot::Attributes, &attributes(surface))?;
    }
    buffers.upload(&gpu.handles, Slot::Materials, bytemuck::cast_slice(&surface.materials))?;
    let face_normals = &surface.face_normals;
    supply(gpu, buffers, Slot::FaceNormals, Source::of(face_normals, mesh), &[bytemuck::cast_slice(face_normals)])?;
    if let Some(CornerValues { values, .. }) = &surface.vertex_normals {
        supply(gpu, buffers, Slot::Normals, Source::of(values, mesh), &[bytemuck::cast_slice(values)])?;
    }
    if let Some(CornerValues { values, .. }) = &surface.uvs {
        let sets: [&[u8]; 2] = [bytemuck::cast_slice(values), bytemuck::cast_slice(&surface.second_uvs)];
        let source = Source::of(values, mesh).map(|source| source.followed_by(sets[1].len()));
        supply(gpu, buffers, Slot::Uvs, source, &sets)?;
    }
    if let Some(CornerValues { values, .. }) = &surface.colors {
        supply(gpu, buffers, Slot::VertexColors, Source::of(values, mesh), &[bytemuck::cast_slice(values)])?;
    }
    let lists = corner_triangles(surface, &plan.triangles).0;
    let all = [
        surface.vertex_normals.as_ref().map(|normals| &normals.triangles),
        surface.uvs.as_ref().map(|uvs| &uvs.triangles),
        surface.colors.as_ref().map(|colors| &colors.triangles),
    ];
    let source = match lists[..] {
        [list] => all.into_iter().flatten().find(|of| std::ptr::eq(&of[..], list)).and_then(|of| Source::of(of, mesh)),
        _ => None,
    };
    let slices: Vec<&[u8]> = lists.into_iter().map(bytemuck::cast_slice).collect();
    supply(gpu, buffers, Slot::CornerTriangles, source, &slices)?;
    let images = texture_table(&surface.textures);
    let mut parts: Vec<&[u8]> = vec![bytemuck::cast_slice(&images)];
    parts.extend(surface.textures.images.iter().map(|image| bytemuck::cast_slice::<_, u8>(&image.texels)));
    let source = Source::of_arc(&surface.textures, parts.iter().map(|part| part.len()).sum());
    supply(gpu, buffers, Slot::Texels, source, &parts)
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
