//! Meshes that stay: named by what is in them, so that clients send each once and draw it often.
//!
//! Architecture invariants: what is stored never changes, only comes and goes. The bytes of everything that is stored, and of
//! what was but is still being drawn, are within one cap. Nothing here knows HTTP, waits, or parses.
//!
//! In memory alone; the rest of the program sees [`Store`], whose methods would be the same over a folder.

mod digest;
#[cfg(test)]
mod tests;

pub use digest::Digest;

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

use crate::import::{Bundle, Format};
use crate::service::jobs::{Reservation, UploadBudget};

/// How a bundle is read: what is said of it beside its bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// Overrides sniffing.
    pub format_in: Option<Format>,
    /// Which file is the mesh.
    pub entry: Option<String>,
}

/// A mesh to be stored.
#[derive(Clone, Debug)]
pub struct NewMesh {
    /// Its name.
    pub digest: Digest,
    /// Its files.
    pub bundle: Bundle,
    /// How it was read for the report.
    pub reading: Reading,
    /// What is in it: JSON.
    pub report: Bytes,
}

/// A mesh that is stored, or was when it was found.
#[derive(Debug)]
pub struct StoredMesh {
    /// What was stored.
    pub mesh: NewMesh,
    /// The memory that its bytes take. Whoever holds the bytes holds a clone: while there is one, the memory counts.
    pub memory: Arc<Reservation>,
}

/// Why a mesh was not stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// It would not fit into an empty store.
    #[error(
        "the mesh takes {bytes} bytes with its report, and all stored meshes may take {limit} (raise the limit with --mesh-bytes)"
    )]
    TooLarge {
        /// What it takes.
        bytes: u64,
        /// What there is.
        limit: u64,
    },
    /// What is being drawn takes the room.
    #[error("meshes that are being drawn take all the room for stored meshes; try again shortly")]
    Busy {
        /// The flag that gives more.
        flag: &'static str,
    },
}

/// What the store holds at this moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreLoad {
    /// Meshes that can be found.
    pub count: usize,
    /// Their bytes, and those of meshes that are gone but still being drawn.
    pub bytes: u64,
}

/// The meshes. When there is no room for another, the least recently used that nobody holds goes.
#[derive(Debug)]
pub struct Store {
    memory: Arc<UploadBudget>,
    bytes: u64,
    count: usize,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    meshes: HashMap<Digest, Entry>,
    /// Their names by last use.
    by_use: BTreeMap<u64, Digest>,
    serial: u64,
}

#[derive(Debug)]
struct Entry {
    stored: Arc<StoredMesh>,
    used: u64,
}

impl Store {
    /// Room for `count` meshes that take `bytes` together.
    pub fn new(bytes: u64, count: usize) -> Self {
        Self { memory: UploadBudget::new(bytes), bytes, count: count.max(1), inner: Mutex::default() }
    }

    /// The mesh of this name, used now.
    pub fn find(&self, digest: Digest) -> Option<Arc<StoredMesh>> {
        self.lock().touch(digest)
    }

    /// Stores a mesh. Whether it is new; if not, what is stored stays as it is.
    pub fn insert(&self, mesh: NewMesh) -> Result<bool, StoreError> {
        let bytes = mesh.size_bytes();
        self.check_size(bytes)?;
        let mut inner = self.lock();
        if inner.touch(mesh.digest).is_some() {
            return Ok(false);
        }
        while inner.meshes.len() >= self.count {
            inner.evict().ok_or(StoreError::Busy { flag: "--mesh-count" })?;
        }
        let mut memory = self.memory.reserve();
        while memory.grow(bytes).is_err() {
            inner.evict().ok_or(StoreError::Busy { flag: "--mesh-bytes" })?;
        }
        inner.add(StoredMesh { mesh, memory: Arc::new(memory) });
        Ok(true)
    }

    /// Forgets a mesh; whether it was there. Who draws it can go on.
    pub fn remove(&self, digest: Digest) -> bool {
        let mut inner = self.lock();
        let Some(entry) = inner.meshes.remove(&digest) else { return false };
        inner.by_use.remove(&entry.used);
        true
    }

    /// Refuses what would not fit into an empty store.
    pub fn check_size(&self, bytes: u64) -> Result<(), StoreError> {
        if bytes > self.bytes { Err(StoreError::TooLarge { bytes, limit: self.bytes }) } else { Ok(()) }
    }

    /// What there is.
    pub fn load(&self) -> StoreLoad {
        StoreLoad { count: self.lock().meshes.len(), bytes: self.memory.used_bytes() }
    }

    /// Bytes and meshes that there is room for.
    pub fn limits(&self) -> (u64, usize) {
        (self.bytes, self.count)
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl NewMesh {
    /// The memory that it takes: its files, their names and its report, and a name that the client chose.
    fn size_bytes(&self) -> u64 {
        let names = self.bundle.files().iter().map(|file| file.path.len());
        let entry = self.reading.entry.as_ref().map_or(0, String::len);
        self.bundle.bytes_len() + (names.sum::<usize>() + entry + self.report.len()) as u64
    }
}

impl Inner {
    fn touch(&mut self, digest: Digest) -> Option<Arc<StoredMesh>> {
        let entry = self.meshes.get_mut(&digest)?;
        self.by_use.remove(&entry.used);
        self.serial += 1;
        entry.used = self.serial;
        self.by_use.insert(self.serial, digest);
        Some(entry.stored.clone())
    }

    fn add(&mut self, stored: StoredMesh) {
        self.serial += 1;
        self.by_use.insert(self.serial, stored.mesh.digest);
        self.meshes.insert(stored.mesh.digest, Entry { stored: Arc::new(stored), used: self.serial });
    }

    /// Forgets the least recently used mesh that nobody holds: another one's memory would not come back. None if there is none.
    fn evict(&mut self) -> Option<()> {
        // Who holds neither now can come to hold one only through this lock.
        let is_held =
            |entry: &Entry| Arc::strong_count(&entry.stored) > 1 || Arc::strong_count(&entry.stored.memory) > 1;
        let is_free = |digest: &Digest| self.meshes.get(digest).is_none_or(|entry| !is_held(entry));
        let (used, digest) =
            self.by_use.iter().find(|(_, digest)| is_free(digest)).map(|(used, digest)| (*used, *digest))?;
        self.by_use.remove(&used);
        self.meshes.remove(&digest);
        Some(())
    }
}
