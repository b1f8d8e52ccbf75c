//! The GPU buffers in which a job (one picture) or several jobs together are drawn: their input, what
//! the stages compute, and the bytes of the pictures. When that has succeeded, the set of buffers is
//! kept for a later job, because allocating buffers anew takes time. The finished picture takes along
//! the buffer that holds its bytes. A set is freed instead if it takes more than half of the memory
//! for kept sets, or has no room beside the others.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::handles::Handles;
use super::params::Batch;
use super::residents::Source;
use crate::backend::DrawError;
use crate::backend::gpu::pipelines::{SLOTS, Slot};

/// Longest input that is remembered, so that it is not written again where the next job has the same.
const REMEMBERED_BYTES_MAX: usize = 8 << 10;

/// Smallest buffer: a binding may not be empty, and a struct must fit in.
const SIZE_MIN: u64 = 256;

/// Unused sets of buffers.
///
/// The set used last is taken first. Workers take turns with jobs; if each had a set of its own,
/// most of the memory would lie idle, and the first job of each would wait for more.
pub struct SpareBuffers {
    sets: Mutex<Vec<Buffers>>,
    bytes_max: u64,
}

impl SpareBuffers {
    /// No sets so far, and never more than `bytes_max`.
    pub fn new(bytes_max: u64) -> Self {
        Self { sets: Mutex::default(), bytes_max }
    }

    /// A set for a job.
    pub fn take(&self) -> Buffers {
        self.lock().pop().unwrap_or_default()
    }

    /// Frees all sets. True if there were some.
    pub fn clear(&self) -> bool {
        let freed = std::mem::take(&mut *self.lock());
        !freed.is_empty()
    }

    /// Memory of all sets, bytes.
    pub fn bytes(&self) -> u64 {
        self.lock().iter().map(Buffers::bytes).sum()
    }

    /// A set that a finished job used. It is not kept where it takes more than half of the room, or all
    /// sets together more than there is.
    pub fn give_back(&self, buffers: Buffers) {
        let mut sets = self.lock();
        let kept: u64 = sets.iter().map(Buffers::bytes).sum();
        let more = buffers.bytes();
        if more <= self.bytes_max / 2 && kept + more <= self.bytes_max {
            sets.push(buffers);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Buffers>> {
        self.sets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Buffers that grow as jobs need.
#[derive(Default)]
pub struct Buffers {
    storage: [Option<wgpu::Buffer>; SLOTS],
    /// The bytes with which a slot's own buffer begins, if they were [uploaded](Self::upload) and are short:
    /// colour thresholds, materials and such are often those of the last job. No kernel writes to what is
    /// uploaded.
    known: [Vec<u8>; SLOTS],
    /// Buffers of others that the current job reads in the place of these.
    bound: [Option<wgpu::Buffer>; SLOTS],
    /// Buffers that the current job has filled, to be kept for others if it succeeds.
    filled: Vec<(Slot, Source, wgpu::Buffer)>,
    /// Uniforms of a plan, where the CPU cannot write to where kernels read.
    frame: Option<wgpu::Buffer>,
    /// Uniforms of the dispatches.
    pub batches: Option<wgpu::Buffer>,
    /// Those with which `batches` begins, if they are known.
    pub known_batches: Vec<Batch>,
    /// The last job's uniforms of a plan and of the dispatches, and what binds them.
    pub uniforms: Option<(wgpu::Buffer, wgpu::Buffer, wgpu::BindGroup)>,
    /// Buffer from which the CPU reads results. A picture takes it along.
    pub staging: Option<wgpu::Buffer>,
    /// Buffer from which the CPU reads the work list's length.
    counts: Option<wgpu::Buffer>,
    /// Places for times, and the buffer that they are written to.
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
}

impl Buffers {
    /// A buffer of at least `size` bytes for the slot; what it held is lost if it had to grow.
    pub fn reserve(&mut self, gpu: &Handles, slot: Slot, size: u64) -> Result<&wgpu::Buffer, DrawError> {
        use wgpu::BufferUsages as U;
        let limit = check_size(gpu, size)?;
        let usage = U::STORAGE | U::COPY_DST | U::COPY_SRC;
        Ok(grow(gpu, &mut self.storage[slot as usize], size, limit, usage))
    }

    /// Lets the job read another buffer in the place of the slot's own.
    pub fn bind(&mut self, slot: Slot, buffer: wgpu::Buffer) {
        self.bound[slot as usize] = Some(buffer);
    }

    /// Notes a buffer that is to be kept if the job succeeds.
    pub fn keep_later(&mut self, slot: Slot, source: &Source, buffer: &wgpu::Buffer) {
        self.filled.push((slot, source.clone(), buffer.clone()));
    }

    /// To be called after each job. Returns what is to be kept.
    pub fn unbind_all(&mut self) -> Vec<(Slot, Source, wgpu::Buffer)> {
        self.bound = Default::default();
        std::mem::take(&mut self.filled)
    }

    /// A new buffer of just the size of slices of whole words, filled with them.
    pub fn filled(gpu: &Handles, parts: &[&[u8]]) -> Result<wgpu::Buffer, DrawError> {
        let size = parts.iter().map(|part| part.len() as u64).sum();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        check_size(gpu, size)?;
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let buffer = gpu.device.create_buffer(&descriptor);
        write_slices(gpu, &buffer, parts);
        Ok(buffer)
    }

    /// Reserves and fills a buffer. The length is rounded up to whole words with zeros.
    pub fn upload(&mut self, gpu: &Handles, slot: Slot, bytes: &[u8]) -> Result<(), DrawError> {
        let size = bytes.len().next_multiple_of(4) as u64;
        let has_room = self.storage[slot as usize].as_ref().is_some_and(|buffer| buffer.size() >= size);
        if has_room && !bytes.is_empty() && self.known[slot as usize] == bytes {
            return Ok(());
        }
        let is_short = bytes.len() <= REMEMBERED_BYTES_MAX;
        self.known[slot as usize] = if is_short { bytes.to_vec() } else { Vec::new() };
        let buffer = self.reserve(gpu, slot, size)?;
        let (words, rest) = bytes.split_at(bytes.len() & !3);
        if !words.is_empty() {
            gpu.queue.write_buffer(buffer, 0, words);
        }
        if !rest.is_empty() {
            let mut last = [0; 4];
            last[..rest.len()].copy_from_slice(rest);
            gpu.queue.write_buffer(buffer, words.len() as u64, &last);
        }
        Ok(())
    }

    /// Reserves a buffer and fills it with slices of whole words, one after the other.
    pub fn upload_slices(&mut self, gpu: &Handles, slot: Slot, parts: &[&[u8]]) -> Result<(), DrawError> {
        self.known[slot as usize].clear();
        let buffer = self.reserve(gpu, slot, parts.iter().map(|part| part.len() as u64).sum())?;
        write_slices(gpu, buffer, parts);
        Ok(())
    }

    /// Reserves a buffer and fills it with whole words from a place on; what is before them is for
    /// a kernel to write.
    pub fn upload_at(&mut self, gpu: &Handles, slot: Slot, at: u64, bytes: &[u8]) -> Result<(), DrawError> {
        self.known[slot as usize].clear();
        let buffer = self.reserve(gpu, slot, at + bytes.len() as u64)?;
        if !bytes.is_empty() {
            gpu.queue.write_buffer(buffer, at, bytes);
        }
        Ok(())
    }

    /// The buffer that the job reads as the slot's, or an empty one where the plan needs none.
    pub fn storage(&mut self, gpu: &Handles, slot: Slot) -> Result<wgpu::Buffer, DrawError> {
        if let Some(buffer) = &self.bound[slot as usize] {
            return Ok(buffer.clone());
        }
        self.reserve(gpu, slot, 0).cloned()
    }

    /// A buffer that holds the uniforms of a plan. Where kernels can read what the CPU writes it is a new one, because
    /// then no command copies them: that costs the device more than the buffer costs the CPU.
    pub fn upload_frame(&mut self, gpu: &Handles, bytes: &[u8]) -> Result<wgpu::Buffer, DrawError> {
        use wgpu::BufferUsages as U;
        let size = bytes.len() as u64;
        if !gpu.maps_storage {
            let buffer = Self::uniform(gpu, &mut self.frame, size);
            gpu.queue.write_buffer(buffer, 0, bytes);
            return Ok(buffer.clone());
        }
        let usage = U::UNIFORM | U::STORAGE | U::MAP_WRITE;
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: true };
        let buffer = gpu.device.create_buffer(&descriptor);
        let mut view = buffer.get_mapped_range_mut(..).map_err(|e| DrawError::Device(e.to_string()))?;
        view.copy_from_slice(bytes);
        drop(view);
        buffer.unmap();
        Ok(buffer)
    }

    /// A uniform buffer of at least `size` bytes.
    pub fn uniform<'a>(gpu: &Handles, slot: &'a mut Option<wgpu::Buffer>, size: u64) -> &'a wgpu::Buffer {
        use wgpu::BufferUsages as U;
        grow(gpu, slot, size, gpu.limits.max_buffer_size, U::UNIFORM | U::STORAGE | U::COPY_DST)
    }

    /// A buffer of at least `size` bytes that the CPU can map, and kernels write to if the device allows both.
    pub fn staging(&mut self, gpu: &Handles, size: u64) -> Result<&wgpu::Buffer, DrawError> {
        use wgpu::BufferUsages as U;
        let limit = gpu.limits.max_buffer_size;
        if size > limit {
            return Err(DrawError::BeyondGpu(format!("the picture has {size} bytes, and the GPU's limit is {limit}")));
        }
        let written = if gpu.maps_storage { U::STORAGE } else { U::empty() };
        if self.staging.is_none() {
            self.staging = gpu.readbacks.take(size);
        }
        Ok(grow(gpu, &mut self.staging, size, limit, U::MAP_READ | U::COPY_DST | written))
    }

    /// A small buffer that the CPU can map.
    pub fn counts(&mut self, gpu: &Handles) -> &wgpu::Buffer {
        use wgpu::BufferUsages as U;
        grow(gpu, &mut self.counts, 8, SIZE_MIN, U::MAP_READ | U::COPY_DST)
    }

    /// Places for so many times, and a buffer of `size` bytes for them.
    pub fn queries(&mut self, gpu: &Handles, count: u32, size: u64) -> (wgpu::QuerySet, wgpu::Buffer) {
        use wgpu::BufferUsages as U;
        let make = || {
            let ty = wgpu::QueryType::Timestamp;
            let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: None, ty, count });
            let usage = U::QUERY_RESOLVE | U::COPY_SRC;
            let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
            (queries, gpu.device.create_buffer(&descriptor))
        };
        self.queries.get_or_insert_with(make).clone()
    }

    fn bytes(&self) -> u64 {
        let all = self.storage.iter().chain([&self.frame, &self.batches, &self.staging, &self.counts]);
        all.flatten().map(wgpu::Buffer::size).sum()
    }
}

/// The largest size of a buffer, if this one is not larger.
fn check_size(gpu: &Handles, size: u64) -> Result<u64, DrawError> {
    let limit = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
    if size > limit {
        return Err(DrawError::BeyondGpu(format!("it needs a buffer of {size} bytes, and the GPU's limit is {limit}")));
    }
    Ok(limit)
}

/// Fills a buffer with slices of whole words, one after the other.
fn write_slices(gpu: &Handles, buffer: &wgpu::Buffer, parts: &[&[u8]]) {
    let mut at = 0;
    for part in parts.iter().filter(|part| !part.is_empty()) {
        gpu.queue.write_buffer(buffer, at, part);
        at += part.len() as u64;
    }
}

fn grow<'a>(
    gpu: &Handles,
    slot: &'a mut Option<wgpu::Buffer>,
    size: u64,
    limit: u64,
    usage: wgpu::BufferUsages,
) -> &'a wgpu::Buffer {
    let kept = slot.take().filter(|buffer| buffer.size() >= size);
    slot.insert(kept.unwrap_or_else(|| {
        // A quarter more than asked for, so that a row of slowly growing jobs does not allocate
        // each time.
        let size = (size + size / 4).next_multiple_of(SIZE_MIN).clamp(SIZE_MIN, limit & !3);
        gpu.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    }))
}
