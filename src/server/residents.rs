//! A cache of stored meshes in the form in which they are drawn, so that the next picture of a mesh need not read its file
//! again. Where room is short, those that are used least go first.
//!
//! Invariant: no picture, warning or refusal depends on what is kept.

use std::sync::Arc;
use std::time::Duration;

use quick_cache::sync::GuardResult;

use super::cache::{ByteCache, Weighed, shrink_for, with_room_for};
use super::memory::{Account, Memory, MemoryShare};
use meshsnap_render::limits::Deadline;
use meshsnap_render::pipeline::{Model, RenderError};

/// Bytes that a mesh takes in the cache beside its lists: their heads, the key, places in tables.
const OVERHEAD_BYTES: u64 = 4096;

/// The time between two looks at the deadline of a job that waits for another job's reading.
const WAIT: Duration = Duration::from_millis(10);

/// Bytes of a mesh on an average, to size tables.
const TYPICAL_BYTES: u64 = 1 << 20;

/// A mesh in memory.
#[derive(Debug)]
pub struct Resident {
    /// The mesh. Its budget is a job's after reading it, so that a job that reads nothing has as much left.
    pub model: Model,
    /// The bytes that it counts with as long as anything holds it. None: it is not kept, and is its job's memory.
    memory: MemoryShare,
}

/// A mesh that a job draws.
#[derive(Debug)]
pub struct FoundMesh {
    /// The mesh.
    pub resident: Arc<Resident>,
    /// True if it was in memory; false if this job has read it.
    pub was_kept: bool,
}

/// The meshes in memory. One cap holds for the bytes of all that are kept. What a picture adds to a mesh
/// counts from the picture's end on, and a mesh that a job draws when it has to make room is that job's
/// memory until the job ends.
#[derive(Debug)]
pub struct Residents {
    cache: Arc<ByteCache<Kept>>,
    memory: Arc<Memory>,
    bytes: u64,
}

/// The content of [`Residents`] at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResidentLoad {
    /// Number of meshes.
    pub count: usize,
    /// Their bytes.
    pub bytes: u64,
}

#[derive(Clone, Debug)]
struct Kept {
    resident: Arc<Resident>,
    /// The bytes that it counts with.
    bytes: u64,
}

impl Weighed for Kept {
    fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Residents {
    /// Room for meshes of so many bytes together. None are kept if it is 0.
    pub fn new(bytes: u64, memory: Arc<Memory>) -> Self {
        let cache = Arc::new(with_room_for(bytes, TYPICAL_BYTES));
        shrink_for(&memory, Account::Residents, &cache);
        Self { cache, memory, bytes }
    }

    /// The mesh of this key, read by `read` if it is not in memory. However many jobs ask at the same
    /// moment, one reads; if that fails, the next one tries.
    pub fn find(
        &self,
        key: &str,
        deadline: &Deadline,
        read: impl FnOnce() -> Result<Model, RenderError>,
    ) -> Result<FoundMesh, RenderError> {
        let read = || {
            let model = read()?.without_lender();
            Ok(Arc::new(Resident { model, memory: self.memory.share(Account::Residents) }))
        };
        if self.bytes == 0 {
            return read().map(|resident| FoundMesh { resident, was_kept: false });
        }
        loop {
            match self.cache.get_value_or_guard(key, Some(WAIT)) {
                GuardResult::Value(kept) => return Ok(FoundMesh { resident: kept.resident, was_kept: true }),
                GuardResult::Guard(guard) => {
                    let resident = read()?;
                    let kept = Kept::new(&resident);
                    // Without room it is dropped with its job. The error of `insert` says that it was removed in the meantime.
                    if kept.bytes <= self.bytes && resident.memory.grow(kept.bytes).is_ok() {
                        let _ = guard.insert(kept);
                    }
                    return Ok(FoundMesh { resident, was_kept: false });
                }
                GuardResult::Timeout => deadline.check()?,
            }
        }
    }

    /// Counts what a picture has added to a mesh. Others may have to make room for it.
    pub fn weigh(&self, key: &str, resident: &Arc<Resident>) {
        let now = Kept::new(resident);
        // Of two pictures that end together, the one that was weighed first must not win.
        let has_grown = |kept: &Kept| Arc::ptr_eq(&kept.resident, resident) && kept.bytes < now.bytes;
        let Some(kept) = self.cache.peek(key).filter(has_grown) else { return };
        let more = now.bytes - kept.bytes;
        drop(kept);
        if resident.memory.grow(more).is_err() {
            self.cache.remove(key);
        } else if self.cache.replace(key.to_owned(), now, true).is_err() {
            tracing::debug!(key, "a mesh in memory was dropped: with what a picture added it is too large to keep");
        }
    }

    /// Forgets the meshes whose keys begin with this.
    pub fn forget(&self, prefix: &str) {
        self.cache.retain(|key, _| !key.starts_with(prefix));
    }

    /// Most bytes.
    pub fn limit_bytes(&self) -> u64 {
        self.bytes
    }

    /// The content at this moment.
    pub fn load(&self) -> ResidentLoad {
        ResidentLoad { count: self.cache.len(), bytes: self.cache.weight() }
    }
}

impl Resident {
    /// True if it counts as a mesh in memory.
    pub fn is_counted(&self) -> bool {
        self.memory.bytes() > 0
    }
}

impl Kept {
    fn new(resident: &Arc<Resident>) -> Self {
        Self { resident: Arc::clone(resident), bytes: resident.model.bytes() + OVERHEAD_BYTES }
    }
}
