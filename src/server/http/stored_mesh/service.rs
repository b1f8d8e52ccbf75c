//! The store of a service of several daemons, and what this one has last seen in it. [`shared`](super::shared) uses both.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;

use crate::digest::Digest;
use crate::jobs::Owner;
use crate::keys::Access;
use crate::shared_store::SharedStore;

/// The time for which a mesh that is at hand is taken for stored, without another look at the store.
pub const KNOWN_FOR: Duration = Duration::from_secs(5);

/// Meshes whose last look is remembered, about.
const LOOKS_MAX: usize = 4096;

/// Pictures that are written to the store at a time. More are not written: they can be drawn again.
const WRITES_MAX: usize = 16;

/// The store, and what was last seen in it.
pub struct Shared {
    /// The store.
    pub store: Arc<SharedStore>,
    looks: Mutex<HashMap<(Digest, Owner), Look>>,
    /// A permit for each picture that is being written.
    pub writes: Arc<Semaphore>,
}

/// The time at which a mesh was last seen in the store. One request at a time looks; the others wait for it.
pub type Look = Arc<tokio::sync::Mutex<Option<Instant>>>;

impl Shared {
    /// Nothing was looked at yet.
    pub fn new(store: SharedStore) -> Self {
        Self { store: Arc::new(store), looks: Mutex::default(), writes: Arc::new(Semaphore::new(WRITES_MAX)) }
    }

    /// The last look at what a party has of a mesh.
    pub fn look(&self, digest: Digest, access: &Access) -> Look {
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        if looks.len() >= LOOKS_MAX {
            looks.retain(|_, look| Arc::strong_count(look) > 1 || look.try_lock().is_ok_and(|seen| is_recent(*seen)));
        }
        let owner = if access.sees_all() { Owner::default() } else { access.owner.clone() };
        looks.entry((digest, owner)).or_default().clone()
    }
}

/// True if a mesh that was seen then need not be looked at again.
pub fn is_recent(seen: Option<Instant>) -> bool {
    seen.is_some_and(|at| at.elapsed() < KNOWN_FOR)
}
