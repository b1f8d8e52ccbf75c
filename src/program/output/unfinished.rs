//! The list of the files that are being written, under their temporary names. If the program is
//! ended by SIGHUP, SIGINT or SIGTERM, or by Ctrl-C on systems other than Unix, they are removed first.

use std::collections::BTreeSet;
use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use tempfile::NamedTempFile;

/// The paths of the files. Signals belong to the process, and so does this.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Makes a file that is taken away if a signal ends the program.
pub fn create(make: impl FnOnce() -> io::Result<NamedTempFile>) -> io::Result<NamedTempFile> {
    remove_when_interrupted();
    // The lock is held so that a signal finds the file in the list, or finds no file.
    let mut unfinished = lock();
    let file = make()?;
    unfinished.insert(file.path().to_owned());
    Ok(file)
}

/// Gives the file its own name by `persist`, or removes it if that fails.
pub fn finish(file: NamedTempFile, persist: impl FnOnce(NamedTempFile) -> io::Result<()>) -> io::Result<()> {
    let path = file.path().to_owned();
    let result = persist(file);
    lock().remove(&path);
    result
}

/// Installs the handler of the signals that end programs, once. Without it (the system may refuse) a
/// signal ends the program as ever, and may leave a file.
fn remove_when_interrupted() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(install);
}

#[cfg(unix)]
fn install() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    let Ok(mut signals) = Signals::new([SIGHUP, SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let _no_more = remove_all();
            // The shell sees which signal ended the program.
            let _ = emulate_default_handler(signal);
        }
    });
}

#[cfg(not(unix))]
fn install() {
    /// The exit code of a program that was interrupted, as shells have it.
    const INTERRUPTED: i32 = 130;
    let _ = ctrlc::set_handler(|| {
        let _no_more = remove_all();
        std::process::exit(INTERRUPTED);
    });
}

/// Removes the files. While the lock is held, no thread begins another.
fn remove_all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    let unfinished = lock();
    for path in unfinished.iter() {
        let _ = std::fs::remove_file(path);
    }
    unfinished
}

fn lock() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}
