//! The work of a job, in units that other load on the machine cannot change: bytes allocated
//! and deadline polls. Times belong into benches.

use meshsnap_render::limits::Deadline;

use super::allocations;

/// Runs `job` and gives what it allocated on this thread, bytes.
pub fn allocated_bytes<T>(job: impl FnOnce() -> T) -> (T, u64) {
    let before = allocations::of_this_thread_bytes();
    let out = job();
    (out, allocations::of_this_thread_bytes() - before)
}

/// Runs `job`, which may allocate at most `bytes_max`.
#[track_caller]
pub fn within_bytes<T>(bytes_max: u64, what: &str, job: impl FnOnce() -> T) -> T {
    let (out, bytes) = allocated_bytes(job);
    assert!(bytes <= bytes_max, "{what}: {bytes} bytes allocated, and {bytes_max} are allowed");
    out
}

/// Counts the polls of `job`'s deadline until it ends by itself.
pub fn polls<T>(job: impl FnOnce(&Deadline) -> T) -> u64 {
    let deadline = Deadline::after_polls(u64::MAX);
    job(&deadline);
    deadline.polls()
}

/// Stops `job` at `moments` polls spread over all that it makes, and fails unless it ends each time
/// within `more_max` further polls. Every run of `job` must do the same work. Gives the number of polls of the
/// whole job.
pub fn assert_stops_at_any_poll<T>(moments: u64, more_max: u64, mut job: impl FnMut(&Deadline) -> Option<T>) -> u64 {
    let whole = polls(|deadline| assert!(job(deadline).is_some(), "it stops without being told"));
    for moment in 0..moments {
        let at = 1 + whole * moment / moments;
        let deadline = Deadline::after_polls(at);
        assert!(job(&deadline).is_none(), "it went on after poll {at} of {whole}");
        let more = deadline.polls() - at;
        assert!(more <= more_max, "{more} polls more after the stop at poll {at} of {whole}");
    }
    whole
}
