//! The other daemons of a service, as one of them knows them: their number, and whether they have a GPU.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two messages of a daemon that has nothing to tell, where there are few daemons. Where there are more than
/// [`FEW_SERVERS`], it is as many times longer.
const ANNOUNCE_EVERY: Duration = Duration::from_secs(10);

/// The number of daemons that are few.
const FEW_SERVERS: u32 = 100;

/// Messages that may be missed in a row until a daemon is taken for gone.
const MISSED_MAX: u32 = 3;

/// Time after which a GPU is no longer waited for of which nothing was heard. A server restarts, and connects again after
/// an outage of the queue, in less.
const GPU_WAIT: Duration = Duration::from_secs(120);

/// Most daemons that are known.
const SERVERS_MAX: usize = 10_000;

/// The other daemons of the service.
pub struct Others {
    /// The daemons, each with the moment at which it was last heard of.
    known: Mutex<HashMap<String, Instant>>,
    /// The moment at which a GPU was last heard of, or this daemon has begun to listen.
    gpu_heard: Mutex<Instant>,
    lacks_gpu: AtomicBool,
}

impl Default for Others {
    fn default() -> Self {
        Self { known: Mutex::default(), gpu_heard: Mutex::new(Instant::now()), lacks_gpu: AtomicBool::new(false) }
    }
}

impl Others {
    /// The number of daemons of the service, this one too.
    pub fn count(&self) -> u32 {
        let mut known = lock(&self.known);
        let time = announce_every(number(known.len())) * (MISSED_MAX + 1);
        known.retain(|_, heard| heard.elapsed() < time);
        number(known.len()).saturating_add(1)
    }

    /// This daemon hears the others from now on, and did not before.
    pub fn listens(&self) {
        *lock(&self.gpu_heard) = Instant::now();
    }

    /// Another daemon is there. `has_gpu`: it has a GPU, or has not tried to draw with one.
    pub fn heard(&self, server: &str, has_gpu: bool) {
        let mut known = lock(&self.known);
        if known.len() < SERVERS_MAX || known.contains_key(server) {
            known.insert(server.to_owned(), Instant::now());
        }
        drop(known);
        if has_gpu {
            *lock(&self.gpu_heard) = Instant::now();
        }
    }

    /// True if one of the others may have a GPU.
    pub fn may_have_gpu(&self) -> bool {
        lock(&self.gpu_heard).elapsed() < GPU_WAIT.max(2 * announce_every(self.count()))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn others_are_known_while_they_are_heard() {
        let others = Others::default();
        assert_eq!(others.count(), 1);
        others.heard("a", false);
        others.heard("b", true);
        others.heard("a", false);
        assert_eq!(others.count(), 3);
        let ago = |time| Instant::now().checked_sub(time).unwrap();
        lock(&others.known).insert("a".to_owned(), ago(ANNOUNCE_EVERY * 5));
        assert_eq!(others.count(), 2);
    }

    #[test]
    fn a_gpu_is_waited_for_for_a_while() {
        let others = Others::default();
        let lose = || *lock(&others.gpu_heard) = Instant::now().checked_sub(GPU_WAIT).unwrap();
        assert!(others.may_have_gpu(), "nothing was heard yet");
        lose();
        others.heard("a", false);
        assert!(!others.may_have_gpu());
        others.heard("b", true);
        assert!(others.may_have_gpu());
        lose();
        others.listens();
        assert!(others.may_have_gpu(), "after an outage");
    }

    #[test]
    fn many_daemons_speak_less_often() {
        assert_eq!([1, 199, 200, 1000].map(|count| announce_every(count).as_secs()), [10, 10, 20, 100]);
    }
}
