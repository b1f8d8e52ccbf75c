//! The store of meshes. A mesh is named by the digest of its content, so that clients send it once
//! and draw it often. The store is in memory; where there is a data folder, the same meshes are in it, for the
//! next start.
//!
//! Architecture invariants: a stored mesh never changes. One cap holds for the bytes of all stored
//! meshes together with those that were removed and are still being drawn. Nothing here knows HTTP,
//! waits, or parses.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

use crate::digest::Digest;
use crate::durable::{Change, Durable, Hold};
use crate::jobs::Owner;
use crate::keys::Access;
use crate::memory::{Account, Memory, MemoryFull, MemoryShare};
use meshsnap_render::import::{Bundle, Format};

/// The way in which a bundle is read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// The mesh's format. None: found from the bytes.
    pub format_in: Option<Format>,
    /// The file that is the mesh. None: found from the files.
    pub entry: Option<String>,
}

/// A mesh to be stored.
#[derive(Clone, Debug)]
pub struct NewMesh {
    /// The mesh's name.
    pub digest: Digest,
    /// The mesh's files.
    pub bundle: Bundle,
    /// The way in which it was read for the report.
    pub reading: Reading,
    /// The report on its content, as JSON.
    pub report: Bytes,
    /// The parties that have stored it.
    pub owners: Vec<Owner>,
}

/// A mesh that is stored, or was stored when it was found.
#[derive(Debug)]
pub struct StoredMesh {
    /// The mesh itself.
    pub mesh: NewMesh,
    /// The memory of its bytes. Every holder of the bytes holds a clone, and the memory counts
    /// until the last clone is dropped.
    pub memory: Arc<MemoryShare>,
    /// Its files in the data folder, in the bundle's order, and its report. Empty without a data folder.
    pub holds: Arc<[Arc<Hold>]>,
}

/// Reasons why a mesh was not stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The mesh would not fit into an empty store.
    #[error(
        "the mesh takes {bytes} bytes with its report, and all stored meshes may take {limit} (raise the limit with --mesh-bytes)"
    )]
    TooLarge {
        /// Bytes of the mesh and its report.
        bytes: u64,
        /// The cap in bytes.
        limit: u64,
    },
    /// Meshes that are being drawn take all the room.
    #[error("meshes that are being drawn take all the room for stored meshes; try again shortly")]
    Busy {
        /// The flag that raises the cap.
        flag: &'static str,
    },
    /// Other uses of memory take all the room.
    #[error("the server's memory is in use; try again shortly")]
    Full,
}

/// The content of the store at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreLoad {
    /// Number of meshes that can be found.
    pub count: usize,
    /// Their bytes, and those of removed meshes that are still being drawn.
    pub bytes: u64,
}

/// The stored meshes. To make room for a new one, the store removes the least recently used mesh
/// that is not being drawn.
#[derive(Debug)]
pub struct Store {
    /// The data folder, which has the same meshes.
    durable: Option<Durable>,
    memory: Arc<Memory>,
    count: usize,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    meshes: HashMap<Digest, Entry>,
    /// The names of the meshes, ordered by last use.
    by_use: BTreeMap<u64, Digest>,
    serial: u64,
}

#[derive(Debug)]
struct Entry {
    stored: Arc<StoredMesh>,
    used: u64,
    /// The parties that have stored it. Content has one name, so that several may have one mesh.
    owners: BTreeSet<Owner>,
}

/// What became of a mesh that a party has deleted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removed {
    /// The party did not have it.
    Unknown,
    /// Others have it still.
    OfOthers,
    /// It is gone.
    Gone,
}

impl Store {
    /// A store for at most `count` meshes, with the bytes that their account may have, and perhaps a data folder.
    pub fn new(durable: Option<Durable>, memory: Arc<Memory>, count: usize) -> Self {
        Self { durable, memory, count: count.max(1), inner: Mutex::default() }
    }

    /// Finds a mesh that the party sees, which counts as a use of it.
    pub fn find(&self, digest: Digest, access: &Access) -> Option<Arc<StoredMesh>> {
        let mut inner = self.lock();
        inner.meshes.get(&digest).filter(|entry| entry.is_seen_by(access))?;
        inner.touch(digest)
    }

    /// Stores a mesh. One of its name that is stored already stays as it is, and gets the owners. False if they have it
    /// already. `holds` are its bytes in the data folder.
    pub fn insert(&self, mesh: NewMesh, holds: Arc<[Arc<Hold>]>) -> Result<bool, StoreError> {
        let bytes = mesh.size_bytes();
        self.check_size(bytes)?;
        let memory = self.memory.share(Account::Meshes);
        // Caches may make room, so that the lock is not held.
        let reserved = memory.grow(bytes);
        let mut inner = self.lock();
        if inner.touch(mesh.digest).is_some() {
            let entry = inner.meshes.get_mut(&mesh.digest);
            return Ok(entry.is_some_and(|entry| {
                let before = entry.owners.len();
                entry.owners.extend(mesh.owners);
                entry.owners.len() > before
            }));
        }
        while inner.meshes.len() >= self.count {
            self.forget(inner.evict().ok_or(StoreError::Busy { flag: "--mesh-count" })?);
        }
        match reserved {
            Ok(()) => {}
            Err(MemoryFull::Process { .. }) => return Err(StoreError::Full),
            Err(MemoryFull::Account { .. }) => loop {
                self.forget(inner.evict().ok_or(StoreError::Busy { flag: "--mesh-bytes" })?);
                match memory.grow_now(bytes) {
                    Ok(()) => break,
                    Err(None) => {}
                    Err(Some(_)) => return Err(StoreError::Full),
                }
            },
        }
        inner.add(StoredMesh { mesh, memory: Arc::new(memory), holds });
        Ok(true)
    }

    /// Removes a mesh for a party; it goes with its last owner. Jobs that already draw it go on.
    pub fn remove(&self, digest: Digest, access: &Access) -> Removed {
        let mut inner = self.lock();
        let Some(entry) = inner.meshes.get_mut(&digest).filter(|entry| entry.is_seen_by(access)) else {
            return Removed::Unknown;
        };
        entry.owners.remove(&access.owner);
        if !entry.owners.is_empty() && !access.sees_all() {
            if let Some(durable) = &self.durable {
                durable.store_soon(vec![Change::MeshDisowned(digest, access.owner.to_string())], Vec::new());
            }
            return Removed::OfOthers;
        }
        let Some(entry) = inner.meshes.remove(&digest) else { return Removed::Unknown };
        inner.by_use.remove(&entry.used);
        self.forget(entry);
        Removed::Gone
    }

    /// Removes a mesh from the data folder. The lock is held, so that a mesh that is stored anew is stored after
    /// that.
    fn forget(&self, entry: Entry) {
        if let Some(durable) = &self.durable {
            let change = Change::MeshRemoved(entry.stored.mesh.digest);
            durable.store_soon(vec![change], entry.stored.holds.to_vec());
        }
    }

    /// Refuses a mesh that would not fit into an empty store.
    pub fn check_size(&self, bytes: u64) -> Result<(), StoreError> {
        let limit = self.memory.cap(Account::Meshes);
        if bytes > limit { Err(StoreError::TooLarge { bytes, limit }) } else { Ok(()) }
    }

    /// The content of the store at this moment.
    pub fn load(&self) -> StoreLoad {
        StoreLoad { count: self.lock().meshes.len(), bytes: self.memory.used(Account::Meshes) }
    }

    /// Most bytes and most meshes.
    pub fn limits(&self) -> (u64, usize) {
        (self.memory.cap(Account::Meshes), self.count)
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl NewMesh {
    /// The memory of its files, their names, its report, and the entry's name.
    pub fn size_bytes(&self) -> u64 {
        let names = self.bundle.files().iter().map(|file| file.path.len());
        let entry = self.reading.entry.as_ref().map_or(0, String::len);
        self.bundle.bytes_len() + (names.sum::<usize>() + entry + self.report.len()) as u64
    }
}

impl Entry {
    fn is_seen_by(&self, access: &Access) -> bool {
        access.sees_all() || self.owners.contains(&access.owner)
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

    fn add(&mut self, mut stored: StoredMesh) {
        let owners = std::mem::take(&mut stored.mesh.owners).into_iter().collect();
        self.serial += 1;
        self.by_use.insert(self.serial, stored.mesh.digest);
        self.meshes.insert(stored.mesh.digest, Entry { stored: Arc::new(stored), used: self.serial, owners });
    }

    /// Removes the least recently used mesh that is not held elsewhere. Removing a held one would
    /// free no memory. None if all are held.
    fn evict(&mut self) -> Option<Entry> {
        // These counts cannot grow from 1 meanwhile: new holders need this lock.
        let is_held =
            |entry: &Entry| Arc::strong_count(&entry.stored) > 1 || Arc::strong_count(&entry.stored.memory) > 1;
        let is_free = |digest: &Digest| self.meshes.get(digest).is_none_or(|entry| !is_held(entry));
        let (used, digest) =
            self.by_use.iter().find(|(_, digest)| is_free(digest)).map(|(used, digest)| (*used, *digest))?;
        self.by_use.remove(&used);
        self.meshes.remove(&digest)
    }
}
