//! Buffers from which the CPU reads finished pictures in place, without a copy. A picture keeps its buffer until the
//! last reader of its pixels is done. Other jobs draw into other buffers meanwhile, and buffers that no picture lies
//! in are kept for later jobs, as long as they do not take too much memory.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::image::{Pixels, SharedMemory};

/// Largest memory of the spare buffers, bytes: on a software implementation it is the process's memory.
const KEPT_BYTES_MAX: u64 = 256 << 20;

/// Buffers that no picture lies in.
///
/// A job takes one, and its picture keeps it until the last reader of its pixels is done. So there are as many as
/// pictures are drawn and encoded at a time.
#[derive(Default)]
pub struct ReadbackPool(Mutex<Spare>);

#[derive(Default)]
struct Spare {
    /// The oldest first.
    buffers: Vec<wgpu::Buffer>,
    /// True from the first job that takes a buffer until the last renderer is dropped. Buffers are kept meanwhile.
    is_open: bool,
}

impl ReadbackPool {
    /// Frees all buffers, and those that are given back before the next job takes one.
    pub fn close(&self) {
        self.lock().is_open = false;
        self.clear();
    }

    /// The smallest buffer of at least `size` bytes.
    pub fn take(&self, size: u64) -> Option<wgpu::Buffer> {
        let mut spare = self.lock();
        spare.is_open = true;
        let fits = spare.buffers.iter().enumerate().filter(|(_, buffer)| buffer.size() >= size);
        let (at, _) = fits.min_by_key(|(_, buffer)| buffer.size())?;
        Some(spare.buffers.remove(at))
    }

    /// Takes back a buffer that is not mapped. The oldest go where all together would be too much.
    fn give_back(&self, buffer: wgpu::Buffer) {
        let mut spare = self.lock();
        spare.buffers.push(buffer);
        let mut kept: u64 = spare.buffers.iter().map(wgpu::Buffer::size).sum();
        let mut oldest = 0;
        while (kept > KEPT_BYTES_MAX || !spare.is_open) && oldest < spare.buffers.len() {
            kept -= spare.buffers[oldest].size();
            oldest += 1;
        }
        let freed: Vec<_> = spare.buffers.drain(..oldest).collect();
        drop(spare);
        drop(freed);
    }

    /// Frees all. True if there were some.
    pub fn clear(&self) -> bool {
        let freed = std::mem::take(&mut self.lock().buffers);
        !freed.is_empty()
    }

    /// Memory of all, bytes.
    pub fn bytes(&self) -> u64 {
        self.lock().buffers.iter().map(wgpu::Buffer::size).sum()
    }

    fn lock(&self) -> MutexGuard<'_, Spare> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A buffer that the CPU reads. It is spare again when this is dropped.
pub struct Mapped {
    /// Some until this is dropped.
    view: Option<wgpu::BufferView>,
    buffer: Option<wgpu::Buffer>,
    pool: Arc<ReadbackPool>,
}

impl Mapped {
    /// The mapped part of a buffer.
    pub fn new(view: wgpu::BufferView, buffer: wgpu::Buffer, pool: &Arc<ReadbackPool>) -> Self {
        Self { view: Some(view), buffer: Some(buffer), pool: pool.clone() }
    }

    /// The bytes that were mapped.
    pub fn bytes(&self) -> &[u8] {
        self.view.as_deref().unwrap_or_default()
    }

    /// A range of the bytes as a picture's pixels; none of them where the range is beyond their end.
    pub fn pixels(mapped: &Arc<Self>, range: Range<usize>) -> Pixels {
        Pixels::shared(Arc::new(Part { mapped: mapped.clone(), range }))
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        let (view, buffer) = (self.view.take(), self.buffer.take());
        let unmap = || {
            // Before the buffer is unmapped.
            drop(view);
            if let Some(buffer) = buffer {
                buffer.unmap();
                self.pool.give_back(buffer);
            }
        };
        // wgpu may panic if the device is lost.
        let _ = catch_unwind(AssertUnwindSafe(unmap));
    }
}

/// A picture's part of a mapped buffer.
struct Part {
    mapped: Arc<Mapped>,
    range: Range<usize>,
}

impl SharedMemory for Part {
    fn bytes(&self) -> &[u8] {
        self.mapped.bytes().get(self.range.clone()).unwrap_or_default()
    }
}
