//! The content of a data folder that a server may be using: what `meshsnap jobs` lists.
//!
//! The log is copied into memory, and the copy is opened. Commits go on meanwhile, so a copy can have parts of several
//! states. redb checks every page of it, and a copy that is none of a single state is made anew.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use redb::backends::InMemoryBackend;
use redb::{DatabaseError, StorageBackend as _, StorageError};

use super::log::{Contents, Log as _, RedbLog, builder};
use super::{LOG_FILE, OpenError};

/// Copies that are made before the reader gives up.
const TRIES: u32 = 20;

/// Time between two copies.
const PAUSE: Duration = Duration::from_millis(25);

/// Bytes that are read at a time.
const PART_BYTES: usize = 1 << 20;

/// The jobs and meshes in a data folder. Nothing in it is changed, not even what a crash has left unfinished.
pub fn read(folder: &Path) -> Result<Contents, OpenError> {
    let path = folder.join(LOG_FILE);
    let mut tries = 0;
    loop {
        tries += 1;
        let error = match copy(&path, PART_BYTES, &mut || ()).and_then(contents_of) {
            Ok(contents) => return Ok(contents),
            Err(error) => error,
        };
        use io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied, Unsupported};
        match error.kind() {
            Unsupported => return Err(OpenError::Newer(folder.to_owned())),
            NotFound | PermissionDenied | NotADirectory | IsADirectory => {}
            _ if tries < TRIES => {
                std::thread::sleep(PAUSE);
                continue;
            }
            _ => {}
        }
        return Err(OpenError::Io { folder: folder.to_owned(), error });
    }
}

/// The file in memory. `after_part` is called after each part that is read.
fn copy(path: &Path, part_bytes: usize, after_part: &mut dyn FnMut()) -> io::Result<InMemoryBackend> {
    let mut file = File::open(path)?;
    let copy = InMemoryBackend::new();
    let mut part = vec![0; part_bytes];
    let mut length = 0;
    loop {
        let count = file.read(&mut part)?;
        if count == 0 {
            return Ok(copy);
        }
        let end = length + count as u64;
        copy.set_len(end)?;
        copy.write(length, &part[..count])?;
        length = end;
        after_part();
    }
}

fn contents_of(copy: InMemoryBackend) -> io::Result<Contents> {
    // It is opened once.
    let copy = Mutex::new(Some(copy));
    let mut log = RedbLog::with(Box::new(move || {
        let taken = copy.lock().ok().and_then(|mut copy| copy.take());
        let copy = taken.ok_or_else(|| DatabaseError::Storage(StorageError::Io(io::ErrorKind::Other.into())))?;
        builder().set_check_integrity_on_open(true).create_with_backend(copy)
    }))?;
    log.load()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::durable::tests::{cancelled, job};
    use crate::service::durable::{Change, RedbLog};

    /// Commits a pair of jobs, the first of which has ended, and forgets the pair that came 20 before it.
    fn commit_pair(log: &mut RedbLog, pair: u128) {
        let (first, second) = (2 * pair, 2 * pair + 1);
        let mut changes = vec![
            Change::Accepted(Box::new(job(first, b"a"))),
            Change::Accepted(Box::new(job(second, b"b"))),
            Change::Ended(first, cancelled()),
        ];
        if pair >= 20 {
            changes.extend([Change::Forgotten(first - 40), Change::Forgotten(second - 40)]);
        }
        log.commit(&changes).unwrap();
    }

    #[test]
    fn a_copy_of_several_states_is_not_taken_for_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOG_FILE);
        let mut log = RedbLog::open(&path).unwrap();
        let mut pair = 0;
        while pair < 20 {
            commit_pair(&mut log, pair);
            pair += 1;
        }
        let (mut whole, mut mixed) = (0, 0);
        for round in 0..60 {
            let mut part = 0;
            let copied = copy(&path, 4096, &mut || {
                part += 1;
                // Some copies are made while nothing is committed, or once.
                if round % 3 == 0 && part % 4 == 0 || round % 3 == 1 && part == round {
                    commit_pair(&mut log, pair);
                    pair += 1;
                }
            });
            let Ok(contents) = contents_of(copied.unwrap()) else {
                mixed += 1;
                continue;
            };
            whole += 1;
            let jobs: Vec<_> = contents.jobs.iter().map(|job| (job.record.key, job.end.is_some())).collect();
            assert_eq!(jobs.len(), 40, "{jobs:?}");
            for (two, first) in jobs.chunks(2).zip((jobs[0].0..).step_by(2)) {
                assert_eq!(two, [(first, true), (first + 1, false)], "{jobs:?}");
            }
        }
        assert!(whole >= 20 && mixed > 0, "{whole} copies were whole, {mixed} mixed");
    }

    #[test]
    fn a_log_is_read_while_it_is_written_to() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = RedbLog::open(&folder.path().join(LOG_FILE)).unwrap();
        for pair in 0..30 {
            commit_pair(&mut log, pair);
            assert_eq!(read(folder.path()).unwrap().jobs.len(), 2 * (pair as usize + 1).min(20));
        }
    }

    #[test]
    fn what_is_no_log_is_an_error_and_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(read(&folder.path().join("none")), Err(OpenError::Io { .. })));
        let path = folder.path().join(LOG_FILE);
        drop(RedbLog::open(&path).unwrap());
        let whole = std::fs::read(&path).unwrap();
        let cases = [Vec::new(), b"no log".repeat(10_000), whole[..whole.len() / 2].to_vec(), vec![0; whole.len()]];
        for (number, bytes) in cases.iter().enumerate() {
            std::fs::write(&path, bytes).unwrap();
            // An empty file is what `serve` takes for a new log.
            assert_eq!(read(folder.path()).is_ok(), bytes.is_empty(), "{number}");
            assert!(std::fs::read(&path).unwrap() == *bytes, "{number}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
