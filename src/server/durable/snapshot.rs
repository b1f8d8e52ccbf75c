//! A reader of the jobs and meshes of a data folder that a server may be using, for `meshsnap jobs`. It
//! changes nothing in the folder.
//!
//! While the server has its database open, no other process can open it. So `read` copies the database
//! into memory, and opens the copy. The server may write meanwhile, so a copy can mix several states of
//! the database. redb checks the pages of the copy. If it finds a mix, the database is copied anew, for
//! about 10 s.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use redb::backends::InMemoryBackend;
use redb::{DatabaseError, StorageBackend as _, StorageError};

use super::log::{Contents, Log as _, RedbLog, builder};
use super::{LOG_FILE, OpenError};

/// Time for which a log that changes is copied anew.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time between two copies.
const PAUSE: Duration = Duration::from_millis(5);

/// Bytes at the start of a log in which each commit changes something.
const HEADER_BYTES: usize = 512;

/// The bytes with which each database of redb begins.
const MAGIC: [u8; 9] = *b"redb\x1A\x0A\xA9\x0D\x0A";

/// Bytes that are read at a time.
const PART_BYTES: usize = 1 << 20;

/// The jobs and meshes in a data folder. Nothing in it is changed, not even what a crash has left unfinished. Takes as much
/// memory as the log has. `ResourceBusy`: it was written to without a pause.
pub fn read(folder: &Path) -> Result<Contents, OpenError> {
    read_within(folder, PATIENCE, &mut || ()).map_err(|error| match error.kind() {
        io::ErrorKind::Unsupported => OpenError::Newer(folder.to_owned()),
        _ => OpenError::Io { folder: folder.to_owned(), error },
    })
}

/// As [`read`]. `after_part` is called after each part that is copied.
fn read_within(folder: &Path, patience: Duration, after_part: &mut dyn FnMut()) -> io::Result<Contents> {
    let path = folder.join(LOG_FILE);
    let began = Instant::now();
    loop {
        let before = header(&path)?;
        if !before.is_empty() && !before.starts_with(&MAGIC) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("{LOG_FILE} is no log of meshsnap")));
        }
        let error = match copy(&path, PART_BYTES, after_part).and_then(contents_of) {
            Ok(contents) => return Ok(contents),
            Err(error) => error,
        };
        // A log that did not change meanwhile will not be better another time.
        if error.kind() == io::ErrorKind::Unsupported || header(&path)? == before {
            return Err(error);
        }
        if began.elapsed() > patience {
            return Err(io::ErrorKind::ResourceBusy.into());
        }
        std::thread::sleep(PAUSE);
    }
}

fn header(path: &Path) -> io::Result<Vec<u8>> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{LOG_FILE} is no file")));
    }
    let mut header = Vec::new();
    File::open(path)?.take(HEADER_BYTES as u64).read_to_end(&mut header)?;
    Ok(header)
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
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::digest::Digest;
    use crate::durable::tests::{cancelled, job};
    use crate::durable::{Change, RedbLog};

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
        // Some megabytes, so that commits come while it is copied.
        let filler: Vec<_> = (0..200_u32).map(|i| i.to_le_bytes().repeat(10_000)).collect();
        let stored = filler.iter().map(|bytes| Change::SmallStored(Digest::of(bytes), bytes.clone().into()));
        log.commit(&stored.collect::<Vec<_>>()).unwrap();
        commit_pair(&mut log, 0);
        let is_over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for pair in (1..).take_while(|_| !is_over.load(Ordering::Relaxed)) {
                    commit_pair(&mut log, pair);
                }
            });
            for _ in 0..5 {
                let contents = read(folder.path());
                is_over.store(contents.is_err(), Ordering::Relaxed);
                assert_eq!(contents.unwrap().jobs.len() % 2, 0);
            }
            is_over.store(true, Ordering::Relaxed);
        });
    }

    #[test]
    fn a_log_that_never_rests_is_said_to_be_busy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOG_FILE);
        drop(RedbLog::open(&path).unwrap());
        let mut bytes = std::fs::read(&path).unwrap();
        // A log whose pages are gone.
        bytes[4096..].fill(0xEE);
        std::fs::write(&path, &bytes).unwrap();
        let patience = Duration::from_millis(50);
        let kind = |after_part: &mut dyn FnMut()| {
            read_within(folder.path(), patience, after_part).err().map(|error| error.kind())
        };
        assert_eq!(kind(&mut || ()), Some(io::ErrorKind::Other));
        let mut copies = 0;
        let mut commit = || {
            copies += 1;
            bytes[HEADER_BYTES - 1] ^= 1;
            std::fs::write(&path, &bytes).unwrap();
        };
        assert_eq!(kind(&mut commit), Some(io::ErrorKind::ResourceBusy));
        assert!(copies > 1, "{copies}");
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
