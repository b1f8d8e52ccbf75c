//! The pause after a GPU was lost in several jobs in a row: for a minute, jobs whose back-end is `auto` are drawn by
//! the CPU, then the GPU is tried again. If that fails too, the next pause is twice as long, up to an hour.

use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Jobs in a row that lost the device, after which it rests.
const LOSSES_MAX: u32 = 3;

/// The first rest.
const REST: Duration = Duration::from_secs(60);

/// The longest rest.
const REST_MAX: Duration = Duration::from_secs(3600);

/// The time since some moment.
pub type Clock = dyn Fn() -> Duration + Send + Sync;

/// Counts losses, and says when the GPU rests.
pub struct Recovery {
    now: Box<Clock>,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    /// Jobs in a row that lost the device.
    losses: u32,
    /// The last rest; zero before the first one.
    rest: Duration,
    /// The end of the rest, and its reason.
    until: Option<(Duration, String)>,
}

impl Default for Recovery {
    fn default() -> Self {
        let began = Instant::now();
        Self::with_clock(Box::new(move || began.elapsed()))
    }
}

impl Recovery {
    /// Takes the time from `now`.
    pub fn with_clock(now: Box<Clock>) -> Self {
        Self { now, inner: Mutex::default() }
    }

    /// The reason of the rest, if the GPU rests now.
    pub fn resting(&self) -> Option<String> {
        let inner = self.lock();
        inner.until.as_ref().filter(|(until, _)| (self.now)() < *until).map(|(_, reason)| reason.clone())
    }

    /// Counts a job that lost the device. Returns the reason of the rest that begins with it.
    pub fn lost(&self, why: &str) -> Option<String> {
        let mut inner = self.lock();
        let now = (self.now)();
        if inner.until.as_ref().is_some_and(|(until, _)| now < *until) {
            return None;
        }
        inner.losses += 1;
        if inner.losses < LOSSES_MAX && inner.rest.is_zero() {
            return None;
        }
        inner.rest = if inner.rest.is_zero() { REST } else { (inner.rest * 2).min(REST_MAX) };
        let lost = match inner.losses {
            1 => "the GPU was lost again when it was tried".to_owned(),
            times => format!("the GPU was lost in {times} jobs in a row"),
        };
        let reason = format!("{lost}, at last because: {why}; it is tried again after {} s", inner.rest.as_secs());
        inner.losses = 0;
        inner.until = Some((now + inner.rest, reason.clone()));
        Some(reason)
    }

    /// Counts a job that the device drew. During a rest it says nothing about jobs that choose for themselves. True if
    /// the GPU has recovered by it.
    pub fn drawn(&self) -> bool {
        let mut inner = self.lock();
        if inner.until.as_ref().is_some_and(|(until, _)| (self.now)() < *until) {
            return false;
        }
        let has_recovered = !inner.rest.is_zero();
        *inner = Inner::default();
        has_recovered
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Recovery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recovery").field("resting", &self.resting()).finish_non_exhaustive()
    }
}
