//! Holds: counted references to bytes in the data folder, which are named by their SHA-256. The records
//! of jobs and meshes that need the same bytes share one hold. When its last reference is dropped, the
//! thread `committer` removes the bytes, unless they are held anew by then.
//!
//! `Index` finds the hold that exists for given bytes, so that equal bytes are stored once.

use std::collections::HashMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use bytes::Bytes;

use crate::digest::Digest;

/// Bytes that nothing holds any more.
#[derive(Clone, Copy, Debug)]
pub struct Dropped {
    /// Their name.
    pub digest: Digest,
    /// They are in the log.
    pub is_small: bool,
}

/// Hears of bytes that nothing holds any more.
pub type OnDrop = Arc<dyn Fn(Dropped) + Send + Sync>;

/// A record's share in stored bytes. Holders of equal bytes share one hold. When the last is
/// dropped, the bytes are removed.
pub struct Hold {
    digest: Digest,
    is_small: bool,
    is_stored: AtomicBool,
    /// Small bytes that are not stored yet.
    bytes: Mutex<Option<Bytes>>,
    on_drop: OnDrop,
}

/// The holds that exist. Bytes are removed under its lock, so that none are that were asked for anew.
#[derive(Default)]
pub struct Index(Mutex<HashMap<Digest, Weak<Hold>>>);

impl Hold {
    /// The name of the bytes.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// True if they are kept in the log, false if they have a file.
    pub(super) fn is_small(&self) -> bool {
        self.is_small
    }

    /// True once they are on the disk.
    pub(super) fn is_stored(&self) -> bool {
        self.is_stored.load(Ordering::Acquire)
    }

    /// The bytes are on the disk.
    pub(super) fn set_stored(&self) {
        self.is_stored.store(true, Ordering::Release);
        self.lock().take();
    }

    /// Bytes that a transaction has to bring along.
    pub(super) fn unstored_bytes(&self) -> Option<Bytes> {
        if self.is_stored() { None } else { self.lock().clone() }
    }

    fn lock(&self) -> MutexGuard<'_, Option<Bytes>> {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        (self.on_drop)(Dropped { digest: self.digest, is_small: self.is_small });
    }
}

impl fmt::Debug for Hold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Hold").field(&self.digest).finish()
    }
}

impl Index {
    /// The hold on these bytes; a new one if there is none.
    pub fn hold(&self, bytes: &Bytes, small_max: usize, on_drop: &OnDrop) -> Arc<Hold> {
        let digest = Digest::of(bytes);
        let is_small = bytes.len() <= small_max;
        // The bytes may be part of a larger allocation.
        let small = || Bytes::copy_from_slice(bytes);
        self.get_or(digest, || Hold {
            digest,
            is_small,
            is_stored: AtomicBool::new(false),
            bytes: Mutex::new(is_small.then(small)),
            on_drop: on_drop.clone(),
        })
    }

    /// The hold on bytes that are on the disk already.
    pub fn hold_stored(&self, digest: Digest, is_small: bool, on_drop: &OnDrop) -> Arc<Hold> {
        let (is_stored, bytes) = (AtomicBool::new(true), Mutex::default());
        self.get_or(digest, || Hold { digest, is_small, is_stored, bytes, on_drop: on_drop.clone() })
    }

    /// Calls `remove` if nothing holds the bytes. Meanwhile, nothing can.
    pub fn if_free<T>(&self, digest: Digest, remove: impl FnOnce() -> T) -> Option<T> {
        let mut holds = self.lock();
        if holds.get(&digest).is_some_and(|hold| hold.strong_count() > 0) {
            return None;
        }
        holds.remove(&digest);
        Some(remove())
    }

    fn get_or(&self, digest: Digest, make: impl FnOnce() -> Hold) -> Arc<Hold> {
        let mut holds = self.lock();
        if let Some(hold) = holds.get(&digest).and_then(Weak::upgrade) {
            return hold;
        }
        let hold = Arc::new(make());
        holds.insert(digest, Arc::downgrade(&hold));
        hold
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Digest, Weak<Hold>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
