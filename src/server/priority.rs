//! The priority of the threads that draw. On Linux it is lower than that of the threads that answer
//! requests. Otherwise, where all cores are busy, even an answer about health would wait for a core
//! behind pictures, each time that its thread wakes.

/// Steps by which it is lower: threads that answer get about three times as much of a busy core.
#[cfg(target_os = "linux")]
const STEPS: i32 = 5;

/// The lowest priority that there is.
#[cfg(target_os = "linux")]
const LOWEST: i32 = 19;

/// Lowers the priority of this thread, and of threads that it makes from now on.
#[cfg(target_os = "linux")]
pub fn lower() {
    // On Linux, no process means this thread. Without leave, it stays as it is.
    let lowered = rustix::process::getpriority_process(None)
        .and_then(|now| rustix::process::setpriority_process(None, (now + STEPS).min(LOWEST)));
    if let Err(error) = lowered {
        tracing::debug!(%error, "the priority of a thread is not lowered");
    }
}

/// Elsewhere, threads have one priority.
#[cfg(not(target_os = "linux"))]
pub fn lower() {}

/// Makes something whose threads have the lower priority.
pub fn with_low_threads<T: Send>(make: impl Fn() -> T + Sync) -> T {
    let on_low_thread = || {
        lower();
        make()
    };
    // A panic is the caller's, then.
    std::thread::scope(|scope| scope.spawn(on_low_thread).join()).unwrap_or_else(|_| make())
}

#[cfg(test)]
mod tests {
    #[test]
    #[cfg(target_os = "linux")]
    fn threads_that_are_made_so_are_low_and_others_are_not() {
        use crate::priority::{LOWEST, STEPS, with_low_threads};
        let of_this_thread = || rustix::process::getpriority_process(None).unwrap();
        let usual = of_this_thread();
        let inner = with_low_threads(|| std::thread::spawn(of_this_thread).join().unwrap());
        assert_eq!((inner, of_this_thread()), ((usual + STEPS).min(LOWEST), usual));
    }
}
