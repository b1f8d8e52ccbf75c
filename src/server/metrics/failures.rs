//! Failures of late, by kind: refused requests and failed jobs, for operators. A kind that comes again is counted, so one
//! client that fails all the time does not push out what others met.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// The most kinds that are kept. The one that was met the longest ago goes first.
const KINDS_MAX: usize = 50;

/// A kind of failure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The method and the route of the request, or `job`.
    pub place: String,
    /// The status of the answer. None: a job whose client fetches its end later.
    pub status: Option<u16>,
    /// The code of the error.
    pub code: &'static str,
    /// Number of times since the server started, or since the kind was last pushed out.
    pub count: u64,
    /// The last time.
    pub last: SystemTime,
}

/// Failures of late; the last one is at the end.
#[derive(Debug, Default)]
pub struct Failures(Mutex<Vec<Failure>>);

impl Failures {
    /// Counts a failure.
    pub fn add(&self, place: &str, status: Option<u16>, code: &'static str) {
        let mut all = self.lock();
        let known = all.iter().position(|f| f.place == place && f.status == status && f.code == code);
        let mut failure = match known {
            Some(i) => all.remove(i),
            None => Failure { place: place.to_owned(), status, code, count: 0, last: SystemTime::UNIX_EPOCH },
        };
        failure.count = failure.count.saturating_add(1);
        failure.last = SystemTime::now();
        if all.len() == KINDS_MAX {
            all.remove(0);
        }
        all.push(failure);
    }

    /// All kinds, the last one first.
    pub fn list(&self) -> Vec<Failure> {
        self.lock().iter().rev().cloned().collect()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Failure>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_counted_by_kind_and_the_oldest_kind_goes_first() {
        let failures = Failures::default();
        for _ in 0..3 {
            failures.add("POST /v1/render", Some(400), "unknown_key");
            failures.add("POST /v1/render", Some(415), "mesh_unrecognised");
        }
        failures.add("job", None, "unknown_key");
        failures.add("POST /v1/render", Some(400), "unknown_key");
        let kinds = |failures: &Failures| -> Vec<_> {
            failures.list().into_iter().map(|f| (f.place, f.status, f.code, f.count)).collect()
        };
        let render = || "POST /v1/render".to_owned();
        let want = [
            (render(), Some(400), "unknown_key", 4),
            ("job".to_owned(), None, "unknown_key", 1),
            (render(), Some(415), "mesh_unrecognised", 3),
        ];
        assert_eq!(kinds(&failures), want);
        (1..2 * KINDS_MAX as u16).for_each(|status| failures.add("GET /", Some(status), "not_found"));
        let last = kinds(&failures);
        assert_eq!((last.len(), last[0].1, last[KINDS_MAX - 1].1), (KINDS_MAX, Some(99), Some(50)));
    }
}
