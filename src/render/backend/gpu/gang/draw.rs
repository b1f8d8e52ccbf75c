//! The GPU commands that draw a gang (several jobs, one picture each, whose work is done by the same dispatches):
//! shared input is uploaded once, each job has its own part of every buffer that kernels write, and the finished
//! pictures lie one after the other in one buffer, where the CPU reads them.

use std::sync::Arc;

use super::seat::GangShare;
use crate::backend::DrawError;
use crate::backend::gpu::buffers::Buffers;
use crate::backend::gpu::device::Gpu;
use crate::backend::gpu::params::{Batch, Frame};
use crate::backend::gpu::pipelines::Slot;
use crate::backend::gpu::recorder::{bind_buffers, bind_uniforms};
use crate::backend::gpu::schedule::Schedule;
use crate::backend::gpu::schedule::sizes::{
    JOBS_MAX, OCCLUSION_BYTES, SAMPLE_BYTES, color_bytes, is_painted, work_bytes,
};
use crate::backend::gpu::staging::Mapped;
use crate::backend::gpu::upload::{upload_geometry, upload_shading};
use crate::image::Pixels;
use crate::limits::Deadline;
use crate::plan::{DrawPlan, ScreenVertex};

/// Distance between the batches of two dispatches: those of all jobs lie together. Every device can bind there.
const BATCHES_STRIDE: usize = JOBS_MAX * size_of::<Batch>();

/// The pictures of a gang, in memory that the CPU and the device share.
#[derive(Clone)]
pub struct Pictures {
    mapped: Arc<Mapped>,
    /// The end of each picture, bytes; it begins where the one before it ends.
    ends: Arc<[usize]>,
}

impl Pictures {
    /// The pixels of the picture of a job.
    pub fn rgba(&self, job: usize) -> Pixels {
        let begin = job.checked_sub(1).and_then(|before| self.ends.get(before)).copied().unwrap_or(0);
        let end = self.ends.get(job).copied().unwrap_or(begin);
        Mapped::pixels(&self.mapped, begin..end)
    }
}

/// Draws the pictures of all shares, the first of which is the plan's own.
pub fn draw(
    gpu: &Arc<Gpu>,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
    shares: &[GangShare],
) -> Result<Pictures, DrawError> {
    gpu.check()?;
    let mut buffers = gpu.spare_buffers.take();
    let drawn = gpu.scoped(|| submit(gpu, &mut buffers, plan, schedule, shares));
    gpu.gang_drawn(shares.len());
    let filled = buffers.unbind_all();
    // After an error the buffers may still be in use.
    let pictures = drawn?;
    filled.into_iter().for_each(|(slot, source, buffer)| gpu.residents.keep(slot, &source, buffer));
    gpu.spare_buffers.give_back(buffers);
    Ok(pictures)
}

/// The beginning of a job's part of each buffer; of the last, the end.
#[derive(Default)]
struct Starts {
    vertices: u32,
    samples: u32,
    items: u32,
    pixels: u32,
}

fn submit(
    gpu: &Gpu,
    buffers: &mut Buffers,
    plan: &DrawPlan<'_>,
    schedule: &Schedule,
    shares: &[GangShare],
) -> Result<Pictures, DrawError> {
    let key = shares.first().map_or(0, GangShare::key);
    let kernels = schedule.kernels();
    gpu.make_pipelines(&kernels, key)?;
    upload_geometry(gpu, buffers, plan, schedule)?;
    upload_shading(gpu, buffers, plan, schedule)?;
    let (frames, batches, ends, all) = uniforms(shares);
    reserve(gpu, buffers, plan, &all)?;
    let frames = buffers.upload_frame(&gpu.handles, bytemuck::cast_slice(&frames))?;
    buffers.known_batches.clear();
    let bytes: &[u8] = bytemuck::cast_slice(&batches);
    let of_dispatches = Buffers::uniform(&gpu.handles, &mut buffers.batches, bytes.len() as u64).clone();
    gpu.handles.queue.write_buffer(&of_dispatches, 0, bytes);
    let group = bind_uniforms(&gpu.handles, &frames, (&of_dispatches, BATCHES_STRIDE));
    let mut bound = Vec::new();
    for &kernel in &kernels {
        bound.push(bind_buffers(gpu, buffers, kernel, key)?);
    }
    let mut encoder = gpu.handles.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes: None });
    let own = shares.first().map_or(&[][..], GangShare::dispatches);
    for (number, dispatch) in own.iter().enumerate() {
        let Some((pipeline, buffers)) = kernels.iter().position(|k| *k == dispatch.kernel).and_then(|at| bound.get(at))
        else {
            continue;
        };
        let most = |axis: usize| {
            let of = |share: &GangShare| share.dispatches().get(number).map_or(1, |dispatch| dispatch.workgroups[axis]);
            shares.iter().map(of).max().unwrap_or(1)
        };
        pass.set_pipeline(&pipeline.pipeline);
        pass.set_bind_group(0, &group, &[(number * BATCHES_STRIDE) as u32]);
        pass.set_bind_group(1, buffers, &[]);
        pass.dispatch_workgroups(most(0), most(1), shares.len() as u32);
    }
    drop(pass);
    gpu.handles.queue.submit([encoder.finish()]);
    let size = ends.last().copied().unwrap_or(0) as u64;
    let staging = buffers.staging.take().ok_or_else(|| DrawError::Device("no memory for pictures".to_owned()))?;
    // No deadline ends this: a gang is many jobs', and small.
    let view = gpu.map(&staging, size, &Deadline::default())?;
    Ok(Pictures { mapped: Arc::new(Mapped::new(view, staging, &gpu.handles.readbacks)), ends: ends.into() })
}

/// Reserves what the kernels write, for all jobs.
fn reserve(gpu: &Gpu, buffers: &mut Buffers, plan: &DrawPlan<'_>, all: &Starts) -> Result<(), DrawError> {
    let vertices = u64::from(all.vertices) * size_of::<ScreenVertex>() as u64;
    buffers.reserve(&gpu.handles, Slot::Vertices, vertices)?;
    buffers.reserve(&gpu.handles, Slot::Samples, u64::from(all.samples) * SAMPLE_BYTES)?;
    buffers.reserve(&gpu.handles, Slot::Work, work_bytes(all.items))?;
    let pixels = u64::from(all.pixels);
    if !is_painted(plan) {
        buffers.reserve(&gpu.handles, Slot::Colors, pixels * color_bytes(plan))?;
    }
    if plan.occlusion.is_some() {
        buffers.reserve(&gpu.handles, Slot::Occlusion, pixels * OCCLUSION_BYTES)?;
    }
    let staging = buffers.staging(&gpu.handles, pixels * 4)?.clone();
    buffers.bind(Slot::Rgba, staging);
    Ok(())
}

/// The uniforms of all jobs, and of all jobs for each dispatch; the end of each picture, bytes; and the sizes of all.
fn uniforms(shares: &[GangShare]) -> (Vec<Frame>, Vec<Batch>, Vec<usize>, Starts) {
    let dispatches = shares.first().map_or(0, |share| share.dispatches().len());
    let mut frames = vec![Frame::default(); JOBS_MAX];
    let mut batches = vec![Batch::default(); JOBS_MAX * dispatches];
    let (mut at, mut ends) = (Starts::default(), Vec::new());
    for (job, (share, frame)) in shares.iter().zip(&mut frames).enumerate() {
        *frame = Frame { vertices_at: at.vertices, items_at: at.items, pixels_at: at.pixels, ..*share.frame() };
        for (number, dispatch) in share.dispatches().iter().enumerate() {
            if let Some(batch) = batches.get_mut(number * JOBS_MAX + job) {
                *batch = Batch { samples_at: at.samples, rgba_at: at.pixels, ..dispatch.batch };
            }
        }
        let amounts = share.amounts();
        at.vertices += amounts.vertices;
        at.samples += amounts.samples;
        at.items += amounts.items;
        at.pixels += amounts.pixels;
        ends.push(at.pixels as usize * 4);
    }
    (frames, batches, ends, at)
}
