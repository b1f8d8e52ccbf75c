//! What a daemon knows of the others of its service: how many there are, and whether they have a GPU.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two messages of a daemon that has nothing to tell, of few daemons. Of more than [`FEW_SERVERS`] it is as many
/// times longer.
const ANNOUNCE_EVERY: Duration = Duration::from_secs(10);

const FEW_SERVERS: u32 = 100;

/// Messages that may be missed in a row until a daemon is taken for gone.
const MISSED_MAX: u32 = 3;

/// Time beyond [`ANNOUNCE_EVERY`] in which a message arrives.
const LATE: Duration = Duration::from_secs(1);

/// What this daemon knows of the others.
#[derive(Default)]
pub struct Others {
    known: Mutex<HashMap<String, Other>>,
    listens_since: Mutex<Option<Instant>>,
    lacks_gpu: AtomicBool,
}

struct Other {
    heard: Instant,
    has_gpu: bool,
}

impl Others {
    /// The number of daemons of the service, this one too.
    pub fn count(&self) -> u32 {
        let mut known = lock(&self.known);
        let time = announce_every(number(known.len())) * (MISSED_MAX + 1);
        known.retain(|_, other| other.heard.elapsed() < time);
        number(known.len()).saturating_add(1)
    }

    /// This daemon hears the others from now on.
    pub fn listens(&self) {
        lock(&self.listens_since).get_or_insert_with(Instant::now);
    }

    /// Another daemon is there.
    pub fn heard(&self, server: &str, has_gpu: bool) {
        lock(&self.known).insert(server.to_owned(), Other { heard: Instant::now(), has_gpu });
    }

    /// True if others have a GPU, or have not tried to draw with one, or have not been heard of yet.
    pub fn may_have_gpu(&self) -> bool {
        self.count();
        let is_new = lock(&self.listens_since).is_none_or(|since| since.elapsed() < ANNOUNCE_EVERY + LATE);
        is_new || lock(&self.known).values().any(|other| other.has_gpu)
    }

    /// True if this daemon was asked for a GPU, and has none.
    pub fn lacks_gpu(&self) -> bool {
        self.lacks_gpu.load(Ordering::Relaxed)
    }

    /// This daemon was asked for a GPU, and has none.
    pub fn note_no_gpu(&self) {
        self.lacks_gpu.store(true, Ordering::Relaxed);
    }
}

/// The time between two messages of a daemon that has nothing to tell.
pub fn announce_every(count: u32) -> Duration {
    ANNOUNCE_EVERY * (count / FEW_SERVERS).max(1)
}

fn number(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
