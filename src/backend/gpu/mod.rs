//! The wgpu back-end: the CPU's stages as compute shaders, headless.
//!
//! In reading order: [`device`] opens a GPU; [`schedule`] decides what is dispatched for a plan; [`recorder`] turns that
//! into commands; [`kernels`] and [`bindings`] say what each stage is made of, [`stages`] are their pipelines, [`params`] their numbers,
//! [`buffers`] their memory and [`sizes`] how much of it.
//!
//! Architecture invariant: a job's use of the device stays on the thread that draws it, because wgpu's error scopes do.

mod buffers;
mod device;
mod params;
pub(crate) mod pass_mask;
pub(crate) mod pipelines;
mod recorder;
mod schedule;

use std::sync::Arc;

pub use self::device::{AtomicsChoice, Gpu, GpuInfo, GpuKind};
pub use self::schedule::sizes::bands_bytes;

use self::buffers::Buffers;
use self::params::{attributes, cell_masks, corner_triangles, edge_lists, hull_looks};
use self::pipelines::Slot;
use self::recorder::Recorder;
use self::schedule::Schedule;
use self::schedule::sizes::{
    DeviceTraits, LAYERED_BYTES, OWNER_BYTES, SAMPLE_BYTES, STROKES_BYTES, color_bytes, has_visibility, samples,
    work_bytes,
};
use self::schedule::step::{Band, Goal, Step};
use super::{BackendKind, DrawError, Renderer};
use crate::image::{Image, srgb8_thresholds};
use crate::limits::Deadline;
use crate::plan::{DrawPlan, HullVertex};

/// Workgroups that share the large triangles: enough to fill a large GPU.
const TILE_WORKGROUPS: u32 = 1024;

/// The same on a processor, where each costs time even if it finds nothing to do.
const TILE_WORKGROUPS_SOFTWARE: u32 = 64;

/// Draws on the GPU. A worker's own; the device and what is kept from job to job are shared.
pub struct GpuRenderer {
    gpu: Arc<Gpu>,
}

impl GpuRenderer {
    /// A renderer on an opened GPU.
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self { gpu }
    }

    /// The GPU that it draws on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Layer number `layer` alone, as [`Renderer::draw_visibility`] says, for tests that compare back-ends sample for sample.
    pub fn draw_layer(&mut self, plan: &DrawPlan<'_>, layer: u32, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        match plan.peeling() {
            Some(_) => self.words(plan, Goal::Layer(layer), Slot::Layer, deadline),
            None => Ok(vec![0; plan.width_px as usize * plan.samples as usize * plan.height_px as usize]),
        }
    }

    /// What a buffer of samples holds in the end.
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
            upload_geometry(gpu, buffers, plan, &schedule)?;
            buffers.staging(gpu, u64::from(schedule.banding.rows) * row_words as u64 * 8)?;
            let mut recorder = Recorder::new(gpu, deadline, buffers, plan, &schedule.batches);
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

    /// Runs `job` with errors caught and buffers tidied up afterwards.
    fn job<T>(&self, job: impl FnOnce(&Gpu, &mut Buffers) -> Result<T, DrawError>) -> Result<T, DrawError> {
        self.gpu.check()?;
        let mut buffers = self.gpu.spare_buffers.take();
        let result = self.gpu.scoped(|| job(&self.gpu, &mut buffers));
        self.gpu.job_ended();
        // After an error work may still be running on them, and the staging buffer may be half mapped.
        if result.is_ok() {
            self.gpu.spare_buffers.give_back(buffers);
        }
        result
    }
}

impl Renderer for GpuRenderer {
    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        deadline.check()?;
        let row_bytes = u64::from(plan.width_px) * 4;
        let size = row_bytes * u64::from(plan.height_px);
        let mut image = Image { width_px: plan.width_px, height_px: plan.height_px, rgba: Vec::new() };
        if size == 0 {
            return Ok(image);
        }
        self.job(|gpu, buffers| {
            let schedule = Schedule::new(plan, &traits(gpu), Goal::Picture)?;
            upload_geometry(gpu, buffers, plan, &schedule)?;
            upload_looks(gpu, buffers, plan, &schedule)?;
            buffers.staging(gpu, size)?;
            let mut recorder = Recorder::new(gpu, deadline, buffers, plan, &schedule.batches);
            execute(&mut recorder, plan, &schedule, |recorder, Band { rows: [first, end] }| {
                let to = u64::from(first) * row_bytes;
                recorder.copy_out(Slot::Rgba, 0, u64::from(end - first) * row_bytes, to)?;
                recorder.submit()
            })?;
            recorder.read_staging(size, |bytes| image.rgba = bytes.to_vec())?;
            Ok(image)
        })
    }

    fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        self.words(plan, Goal::Samples, Slot::Samples, deadline)
    }

    fn kind(&self) -> BackendKind {
        BackendKind::Gpu
    }
}

fn traits(gpu: &Gpu) -> DeviceTraits {
    DeviceTraits {
        binding_bytes_max: gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size),
        workgroups_max: gpu.limits.max_compute_workgroups_per_dimension,
        tile_workgroups: if gpu.is_software() { TILE_WORKGROUPS_SOFTWARE } else { TILE_WORKGROUPS },
        int64_atomics: gpu.int64_atomics,
        loops_are_limited: gpu.is_software(),
    }
}

/// Puts what transform and visibility read on the GPU, and makes room for what they write.
fn upload_geometry(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
) -> Result<(), DrawError> {
    buffers.upload(gpu, Slot::Positions, bytemuck::cast_slice(&plan.positions))?;
    let (corners, own) = plan.hull.as_ref().map_or((&[][..], &[][..]), |hull| (&hull.triangles, &hull.vertices));
    let triangles = [bytemuck::cast_slice(&plan.triangles), bytemuck::cast_slice(corners)];
    buffers.upload_parts(gpu, Slot::Triangles, &triangles)?;
    let transformed = plan.positions.len() as u64 * size_of::<HullVertex>() as u64;
    buffers.upload_at(gpu, Slot::Vertices, transformed, bytemuck::cast_slice(own))?;
    if let Some(hull) = &plan.hull {
        buffers.upload(gpu, Slot::HullLooks, &hull_looks(hull))?;
    }
    if !has_visibility(plan) {
        return Ok(());
    }
    buffers.upload(gpu, Slot::Roles, &plan.pass_masks)?;
    buffers.reserve(gpu, Slot::Samples, schedule.banding.seen_samples(plan) * SAMPLE_BYTES)?;
    let samples = samples(plan, schedule.banding.rows);
    if plan.peeling().is_some() {
        buffers.reserve(gpu, Slot::Layer, samples * SAMPLE_BYTES)?;
        buffers.reserve(gpu, Slot::Layered, samples * LAYERED_BYTES)?;
        buffers.reserve(gpu, Slot::Rounds, u64::from(schedule.layers) * 4)?;
    }
    buffers.reserve(gpu, Slot::Work, work_bytes(schedule.work_items))?;
    Ok(())
}

/// Puts what shade, lines and resolve read on the GPU, and makes room for what they write.
fn upload_looks(gpu: &Gpu, buffers: &mut Buffers, plan: &DrawPlan<'_>, schedule: &Schedule) -> Result<(), DrawError> {
    let band_pixels = u64::from(plan.width_px) * u64::from(schedule.banding.rows);
    if has_visibility(plan) || !plan.lines.is_empty() {
        buffers.reserve(gpu, Slot::Colors, band_pixels * color_bytes(plan))?;
    }
    if let Some(surface) = &plan.surface {
        buffers.upload(gpu, Slot::Attributes, &attributes(surface))?;
        buffers.upload(gpu, Slot::Materials, bytemuck::cast_slice(&surface.materials))?;
        buffers.upload(gpu, Slot::FaceNormals, bytemuck::cast_slice(&surface.face_normals))?;
        if let Some(normals) = &surface.vertex_normals {
            buffers.upload(gpu, Slot::Normals, bytemuck::cast_slice(&normals.values))?;
        }
        if let Some(uvs) = &surface.uvs {
            buffers.upload(gpu, Slot::Uvs, bytemuck::cast_slice(&uvs.values))?;
        }
        if let Some(colors) = &surface.colors {
            buffers.upload(gpu, Slot::VertexColors, bytemuck::cast_slice(&colors.values))?;
        }
        let triangles = corner_triangles(surface, &plan.triangles).0;
        let triangles: Vec<&[u8]> = triangles.into_iter().map(bytemuck::cast_slice).collect();
        buffers.upload_parts(gpu, Slot::CornerTriangles, &triangles)?;
        let (images, texels) = (&surface.textures.images, &surface.textures.texels);
        buffers.upload_parts(gpu, Slot::Texels, &[bytemuck::cast_slice(images), bytemuck::cast_slice(texels)])?;
    }
    if !plan.lines.is_empty() {
        let edges: Vec<&[u8]> = edge_lists(&plan.lines).0.into_iter().map(bytemuck::cast_slice).collect();
        let colors: Vec<[f32; 4]> = plan.lines.iter().map(|lines| lines.color).collect();
        buffers.upload_parts(gpu, Slot::Edges, &edges)?;
        buffers.upload(gpu, Slot::LineColors, bytemuck::cast_slice(&colors))?;
        buffers.upload(gpu, Slot::Cells, bytemuck::cast_slice(&cell_masks(plan.samples)))?;
        buffers.reserve(gpu, Slot::Strokes, band_pixels * STROKES_BYTES)?;
        buffers.reserve(gpu, Slot::Progress, schedule.progress_bytes)?;
        if plan.lights_lines() {
            buffers.reserve(gpu, Slot::Owners, band_pixels * OWNER_BYTES)?;
        }
    }
    buffers.upload(gpu, Slot::Thresholds, bytemuck::cast_slice(&srgb8_thresholds()))?;
    buffers.reserve(gpu, Slot::Rgba, band_pixels * 4)?;
    Ok(())
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
            Step::ClearBand => clear_band(recorder, plan, schedule)?,
            Step::ClearLayer => {
                recorder.clear(Slot::Layer, samples(plan, schedule.banding.rows) * SAMPLE_BYTES)?;
            }
            Step::EndLayer { layer, end } => {
                if recorder.read_word(Slot::Rounds, layer)? == 0 {
                    next = end;
                }
            }
            Step::ClearWork => recorder.clear(Slot::Work, 8)?,
            Step::Dispatch { stage, batch, workgroups } => recorder.dispatch(stage, batch, workgroups)?,
            Step::Lines { batch, workgroups } => {
                recorder.lines_in_rounds(batch, workgroups, schedule.progress_bytes)?;
            }
            Step::Tiles { stage, batch } if schedule.tiles.in_rounds => {
                recorder.tiles_in_rounds(stage, &schedule.batches[batch], &schedule.tiles)?;
            }
            Step::Tiles { stage, batch } => recorder.dispatch(stage, batch, [schedule.tiles.workgroups, 1])?,
            Step::Submit => recorder.submit()?,
            Step::EndBand(band) => end_band(recorder, band)?,
        }
    }
    Ok(())
}

fn clear_band(recorder: &mut Recorder<'_>, plan: &DrawPlan<'_>, schedule: &Schedule) -> Result<(), DrawError> {
    if schedule.layers > 0 {
        recorder.clear(Slot::Rounds, u64::from(schedule.layers) * 4)?;
    }
    if has_visibility(plan) {
        recorder.clear(Slot::Samples, schedule.banding.seen_samples(plan) * SAMPLE_BYTES)?;
    }
    if schedule.goal == Goal::Picture && !plan.lines.is_empty() {
        let pixels = u64::from(plan.width_px) * u64::from(schedule.banding.rows);
        recorder.clear(Slot::Strokes, pixels * STROKES_BYTES)?;
        if plan.lights_lines() {
            recorder.clear(Slot::Owners, pixels * OWNER_BYTES)?;
        }
    }
    Ok(())
}
