//! Buffers that the CPU reads pictures from, in place, while other jobs draw into others.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use crate::image::{LentMemory, Pixels};

/// Largest memory of the spare buffers, bytes: on a software implementation it is the process's memory.
const KEPT_BYTES_MAX: u64 = 256 << 20;

/// Buffers that no job uses.
///
/// A job takes one, and its picture keeps it until the last reader of its pixels is done. So there are as many as
/// pictures are drawn and encoded at a time.
#[derive(Default)]
pub struct SpareStagings(Mutex<Vec<wgpu::Buffer>>);

impl SpareStagings {
    /// The smallest buffer of at least `size` bytes.
    pub fn take(&self, size: u64) -> Option<wgpu::Buffer> {
        let mut spare = self.lock();
        let fits = spare.iter().enumerate().filter(|(_, buffer)| buffer.size() >= size);
        let (at, _) = fits.min_by_key(|(_, buffer)| buffer.size())?;
        Some(spare.remove(at))
    }

    /// Takes back a buffer that is not mapped. The oldest go where all together would be too much.
    pub fn give_back(&self, buffer: wgpu::Buffer) {
        let mut spare = self.lock();
        spare.push(buffer);
        let mut kept: u64 = spare.iter().map(wgpu::Buffer::size).sum();
        let mut oldest = 0;
        while kept > KEPT_BYTES_MAX && oldest < spare.len() {
            kept -= spare[oldest].size();
            oldest += 1;
        }
        let freed: Vec<_> = spare.drain(..oldest).collect();
        drop(spare);
        drop(freed);
    }

    /// Frees all.
    pub fn clear(&self) {
        let freed = std::mem::take(&mut *self.lock());
        drop(freed);
    }

    /// Memory of all, bytes.
    pub fn bytes(&self) -> u64 {
        self.lock().iter().map(wgpu::Buffer::size).sum()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<wgpu::Buffer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A buffer that the CPU reads. It is spare again when this is dropped.
pub struct Mapped {
    /// Some until this is dropped.
    view: Option<wgpu::BufferView>,
    buffer: Option<wgpu::Buffer>,
    spare: Arc<SpareStagings>,
}

impl Mapped {
    /// What the CPU reads of a buffer, which is mapped.
    pub fn new(view: wgpu::BufferView, buffer: wgpu::Buffer, spare: &Arc<SpareStagings>) -> Self {
        Self { view: Some(view), buffer: Some(buffer), spare: spare.clone() }
    }

    /// The bytes that were mapped.
    pub fn bytes(&self) -> &[u8] {
        self.view.as_deref().unwrap_or_default()
    }

    /// A range of the bytes as a picture's pixels; none of them where the range is beyond their end.
    pub fn pixels(mapped: &Arc<Self>, range: Range<usize>) -> Pixels {
        Pixels::lent(Arc::new(Part { mapped: mapped.clone(), range }))
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        // Before the buffer is unmapped.
        self.view = None;
        if let Some(buffer) = self.buffer.take() {
            buffer.unmap();
            self.spare.give_back(buffer);
        }
    }
}

/// A picture's part of a mapped buffer.
struct Part {
    mapped: Arc<Mapped>,
    range: Range<usize>,
}

impl LentMemory for Part {
    fn bytes(&self) -> &[u8] {
        self.mapped.bytes().get(self.range.clone()).unwrap_or_default()
    }
}
