//! The recorder of one job's commands (a job draws one picture). `execute` in the parent module
//! walks through the steps of a [`Schedule`](super::schedule::Schedule) and calls the recorder for
//! each. The recorder writes the wgpu commands, hands them to the device, and reads back what the
//! device has written.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc;

use super::buffers::Buffers;
use super::device::Gpu;
use super::handles::Handles;
use super::params::{BATCH_STRIDE, Batch, Frame, pack};
use crate::backend::gpu::pipelines::key::pipeline_key;
use crate::backend::gpu::pipelines::{Kernel, Pipeline, Slot, uniforms_layout};
use crate::backend::gpu::schedule::tiles::Tiles;
use crate::backend::gpu::stage_clock::StageClock;
use crate::backend::gpu::staging::Mapped;
use crate::backend::{DrawError, DrawStage, DrawTimes};
use crate::limits::Deadline;
use crate::plan::DrawPlan;

/// One job's commands.
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    deadline: &'a Deadline,
    buffers: &'a mut Buffers,
    uniforms: wgpu::BindGroup,
    spare_batch: usize,
    key: u32,
    kernels: HashMap<Kernel, (Arc<Pipeline>, wgpu::BindGroup)>,
    encoder: Option<wgpu::CommandEncoder>,
    pass: Option<(DrawStage, wgpu::ComputePass<'static>)>,
    clock: Option<StageClock>,
    in_flight: Option<mpsc::Receiver<()>>,
}

impl<'a> Recorder<'a> {
    /// Begins a job. Everything must be uploaded and reserved before the first dispatch.
    pub fn new(
        gpu: &'a Gpu,
        deadline: &'a Deadline,
        buffers: &'a mut Buffers,
        plan: &DrawPlan<'_>,
        batches: &[Batch],
    ) -> Result<Self, DrawError> {
        let frame = Frame::new(plan);
        let frame = buffers.upload_frame(&gpu.handles, bytemuck::bytes_of(&frame))?;
        // One more, for dispatches whose parameters are known only while recording.
        let spare_batch = batches.len();
        let batches = upload_batches(&gpu.handles, buffers, batches);
        let uniforms = match buffers.uniforms.take() {
            Some((frame_before, batches_before, group)) if frame_before == frame && batches_before == batches => group,
            _ => bind_uniforms(&gpu.handles, &frame, (&batches, BATCH_STRIDE)),
        };
        buffers.uniforms = Some((frame, batches, uniforms.clone()));
        Ok(Self {
            gpu,
            deadline,
            buffers,
            uniforms,
            spare_batch,
            key: pipeline_key(plan),
            kernels: HashMap::new(),
            encoder: None,
            pass: None,
            clock: None,
            in_flight: None,
        })
    }

    /// Times the stages from now on, where the device can; to be called before the first dispatch.
    pub fn start_clock(&mut self) {
        self.clock = StageClock::new(self.gpu, self.buffers);
    }

    /// Copies the times to `offset` in the staging buffer, of which they take [`StageClock::BYTES`].
    pub fn copy_times(&mut self, offset: u64) {
        self.pass = None;
        if let (Some(clock), Some(to)) = (&self.clock, self.buffers.staging.clone()) {
            let encoder = self.encoder.get_or_insert_with(|| new_encoder(self.gpu));
            clock.copy(encoder, &to, offset);
        }
    }

    /// The durations of the stages, given the bytes that [`copy_times`](Self::copy_times) has copied.
    pub fn times(&self, bytes: &[u8]) -> DrawTimes {
        self.clock.as_ref().map_or_else(DrawTimes::default, |clock| clock.times(bytes))
    }

    /// Runs a kernel.
    pub fn dispatch(&mut self, kernel: Kernel, batch: usize, workgroups: [u32; 2]) -> Result<(), DrawError> {
        if !self.kernels.contains_key(&kernel) {
            let bound = bind_buffers(self.gpu, self.buffers, kernel, self.key)?;
            self.kernels.insert(kernel, bound);
        }
        self.begin_pass(kernel.stage());
        if let (Some((_, pass)), Some((pipeline, group))) = (&mut self.pass, self.kernels.get(&kernel)) {
            pass.set_pipeline(&pipeline.pipeline);
            pass.set_bind_group(0, &self.uniforms, &[(batch * BATCH_STRIDE) as u32]);
            pass.set_bind_group(1, group, &[]);
            pass.dispatch_workgroups(workgroups[0], workgroups[1], 1);
        }
        Ok(())
    }

    /// Draws the items of the work list: reads its length, then runs the kernel in rounds.
    pub fn tiles_in_rounds(&mut self, kernel: Kernel, batch: &Batch, tiles: &Tiles) -> Result<(), DrawError> {
        let mut counts = [0; 2];
        let (work, to) =
            (self.buffers.storage(&self.gpu.handles, Slot::Work)?, self.buffers.counts(&self.gpu.handles).clone());
        self.encoder().copy_buffer_to_buffer(&work, 0, &to, 0, Some(8));
        self.read(&to, 8, |bytes| counts = bytemuck::pod_read_unaligned(bytes))?;
        let [large, huge] = counts.map(|count: u32| count.min(batch.capacity));
        for [large, huge] in tiles.rounds(large, huge) {
            let range = Batch {
                large_first: large.start,
                large_end: large.end,
                huge_first: huge.start,
                huge_end: huge.end,
                ..*batch
            };
            if let Some(batches) = &self.buffers.batches {
                let offset = (self.spare_batch * BATCH_STRIDE) as u64;
                self.gpu.handles.queue.write_buffer(batches, offset, bytemuck::bytes_of(&range));
            }
            self.dispatch(kernel, self.spare_batch, [tiles.workgroups, 1])?;
            // Writes to buffers come before all commands of a submission: one round each.
            self.submit()?;
        }
        Ok(())
    }

    /// Draws lines in rounds until no workgroup is paused.
    pub fn lines_in_rounds(&mut self, batch: usize, workgroups: [u32; 2], bytes: u64) -> Result<(), DrawError> {
        self.clear(Slot::Progress, bytes)?;
        loop {
            self.dispatch(Kernel::Edge, batch, workgroups)?;
            if self.read_word(Slot::Progress, 0)? == 0 {
                return Ok(());
            }
            self.clear(Slot::Progress, 4)?;
        }
    }

    /// Reads one word of a buffer, when all that was recorded is done.
    pub fn read_word(&mut self, slot: Slot, index: u32) -> Result<u32, DrawError> {
        let (from, to) =
            (self.buffers.storage(&self.gpu.handles, slot)?, self.buffers.counts(&self.gpu.handles).clone());
        self.encoder().copy_buffer_to_buffer(&from, u64::from(index) * 4, &to, 0, Some(4));
        let mut word = 0;
        self.read(&to, 4, |bytes| word = bytemuck::pod_read_unaligned(bytes))?;
        Ok(word)
    }

    /// Fills the first `size` bytes of a buffer with zeros.
    pub fn clear(&mut self, slot: Slot, size: u64) -> Result<(), DrawError> {
        let buffer = self.buffers.storage(&self.gpu.handles, slot)?;
        self.encoder().clear_buffer(&buffer, 0, Some(size));
        Ok(())
    }

    /// Copies `size` bytes of a buffer, from `first` on, to `offset` in the staging buffer.
    pub fn copy_out(&mut self, slot: Slot, first: u64, size: u64, offset: u64) -> Result<(), DrawError> {
        let from = self.buffers.storage(&self.gpu.handles, slot)?;
        if let Some(to) = self.buffers.staging.clone() {
            self.encoder().copy_buffer_to_buffer(&from, first, &to, offset, Some(size));
        }
        Ok(())
    }

    /// Hands the commands so far to the device, at most two submissions ahead of it.
    pub fn submit(&mut self) -> Result<(), DrawError> {
        self.pass = None;
        if let Some(encoder) = self.encoder.take() {
            let (sender, done) = mpsc::channel();
            encoder.on_submitted_work_done(move || {
                // A job that has given up has dropped the receiver.
                let _ = sender.send(());
            });
            self.gpu.handles.queue.submit([encoder.finish()]);
            if let Some(before) = self.in_flight.replace(done) {
                self.gpu.wait(&before, self.deadline)?;
            }
        }
        Ok(self.deadline.check()?)
    }

    /// Submits, waits, and passes the first `size` bytes of the staging buffer to `read`.
    pub fn read_staging(&mut self, size: u64, read: impl FnOnce(&[u8])) -> Result<(), DrawError> {
        match self.buffers.staging.clone() {
            Some(staging) => self.read(&staging, size, read),
            None => Ok(()),
        }
    }

    /// Submits, waits, and takes the staging buffer away to be read: its first `size` bytes.
    pub fn take_staging(&mut self, size: u64) -> Result<Mapped, DrawError> {
        let staging = self.buffers.staging.take().ok_or_else(|| DrawError::Device("no memory to read".to_owned()))?;
        self.submit()?;
        let view = self.gpu.map(&staging, size, self.deadline)?;
        Ok(Mapped::new(view, staging, &self.gpu.handles.readbacks))
    }

    fn read(&mut self, buffer: &wgpu::Buffer, size: u64, read: impl FnOnce(&[u8])) -> Result<(), DrawError> {
        self.submit()?;
        let view = self.gpu.map(buffer, size, self.deadline)?;
        read(&view);
        drop(view);
        buffer.unmap();
        Ok(())
    }

    /// Begins a pass for a stage, if the stage needs another.
    fn begin_pass(&mut self, stage: DrawStage) {
        if self.pass.as_ref().is_some_and(|(of, _)| *of == stage || self.clock.is_none()) {
            return;
        }
        self.pass = None;
        let encoder = self.encoder.get_or_insert_with(|| new_encoder(self.gpu));
        let timestamp_writes = self.clock.as_mut().and_then(|clock| clock.begin(stage));
        let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
        self.pass = Some((stage, encoder.begin_compute_pass(&descriptor).forget_lifetime()));
    }

    /// The encoder, outside any pass.
    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.pass = None;
        self.encoder.get_or_insert_with(|| new_encoder(self.gpu))
    }
}

/// Most batches that are remembered, so that they are not written again where the next job has the same.
const REMEMBERED_BATCHES_MAX: usize = 64;

fn new_encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.handles.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None })
}

/// Binds a kernel's buffers to its pipeline for plans with this key.
pub fn bind_buffers(
    gpu: &Gpu,
    buffers: &mut Buffers,
    kernel: Kernel,
    key: u32,
) -> Result<(Arc<Pipeline>, wgpu::BindGroup), DrawError> {
    let pipeline = gpu.pipelines.get(&gpu.handles, kernel, key);
    let mut bound = Vec::new();
    for &slot in &pipeline.slots {
        bound.push((slot, buffers.storage(&gpu.handles, kernel.bound_at(slot))?));
    }
    let entries: Vec<_> = bound
        .iter()
        .map(|(slot, buffer)| wgpu::BindGroupEntry { binding: *slot as u32, resource: buffer.as_entire_binding() })
        .collect();
    let group = gpu.handles.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.buffers,
        entries: &entries,
    });
    Ok((pipeline, group))
}

/// Binds the uniforms of a plan, and one dispatch's of those of all, which lie `stride` bytes apart.
pub fn bind_uniforms(
    gpu: &Handles,
    frame: &wgpu::Buffer,
    (batches, stride): (&wgpu::Buffer, usize),
) -> wgpu::BindGroup {
    let one = wgpu::BufferBinding { buffer: batches, offset: 0, size: wgpu::BufferSize::new(stride as u64) };
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &uniforms_layout(gpu),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Buffer(one) },
        ],
    })
}

/// Uploads batches, a share at a time, into a buffer with room for one more.
fn upload_batches(gpu: &Handles, buffers: &mut Buffers, batches: &[Batch]) -> wgpu::Buffer {
    let before = buffers.batches.clone();
    let size = (batches.len() + 1) as u64 * BATCH_STRIDE as u64;
    let buffer = Buffers::uniform(gpu, &mut buffers.batches, size).clone();
    if before.as_ref() == Some(&buffer) && buffers.known_batches == batches && !batches.is_empty() {
        return buffer;
    }
    buffers.known_batches.clear();
    if batches.len() <= REMEMBERED_BATCHES_MAX {
        buffers.known_batches.extend_from_slice(batches);
    }
    let mut at = 0;
    for share in batches.chunks(4096) {
        let packed = pack(share);
        gpu.queue.write_buffer(&buffer, at, &packed);
        at += packed.len() as u64;
    }
    buffer
}
