use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use redb::{Builder, StorageBackend};

use super::log::Contents;
use super::*;

/// Numbers that look random: xorshift64, Marsaglia 2003.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 16) as usize % end
    }
}

/// A disk that loses its power: what was written since the last sync reaches it in part.
#[derive(Clone, Debug)]
struct Disk(Arc<Mutex<DiskState>>);

#[derive(Debug, Default)]
struct DiskState {
    /// What survives a cut.
    synced: Vec<u8>,
    /// What the process reads.
    seen: Vec<u8>,
    unsynced: Vec<Write>,
    /// Writes and syncs until the power goes; None while it does not.
    left: Option<usize>,
    is_full: bool,
}

#[derive(Clone, Debug)]
enum Write {
    Bytes(usize, Vec<u8>),
    Length(usize),
}

impl Disk {
    fn new() -> Self {
        Self(Arc::default())
    }

    fn log(&self) -> io::Result<RedbLog> {
        let disk = self.clone();
        RedbLog::with(Box::new(move || Builder::new().set_cache_size(1 << 20).create_with_backend(disk.clone())))
    }

    /// The power goes after so many writes and syncs.
    fn cut_after(&self, count: usize) {
        self.lock().left = Some(count);
    }

    /// The power is back. Of each write since the last sync, all, nothing, or some sectors have come through.
    fn restart(&self, random: &mut Random) {
        let mut state = self.lock();
        let mut bytes = std::mem::take(&mut state.synced);
        for write in std::mem::take(&mut state.unsynced) {
            match write {
                Write::Length(length) if random.below(2) == 0 => bytes.resize(length, 0),
                Write::Length(_) => {}
                Write::Bytes(at, content) => {
                    let how = random.below(3);
                    for (sector, part) in content.chunks(512).enumerate() {
                        if how == 0 || how == 1 && random.below(2) == 0 {
                            let (begin, end) = (at + sector * 512, at + sector * 512 + part.len());
                            bytes.resize(bytes.len().max(end), 0);
                            bytes[begin..end].copy_from_slice(part);
                        }
                    }
                }
            }
        }
        *state = DiskState { synced: bytes.clone(), seen: bytes, ..DiskState::default() };
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, DiskState> {
        self.0.lock().unwrap()
    }
}

impl DiskState {
    fn spend(&mut self) -> Result<(), io::Error> {
        match &mut self.left {
            Some(0) => Err(io::Error::other("no power")),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
            None if self.is_full => Err(io::ErrorKind::StorageFull.into()),
            None => Ok(()),
        }
    }
}

impl StorageBackend for Disk {
    fn len(&self) -> Result<u64, io::Error> {
        Ok(self.lock().seen.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), io::Error> {
        let state = self.lock();
        let at = offset as usize;
        let part = state.seen.get(at..at + out.len()).ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?;
        out.copy_from_slice(part);
        Ok(())
    }

    fn set_len(&self, length: u64) -> Result<(), io::Error> {
        let mut state = self.lock();
        state.spend()?;
        state.seen.resize(length as usize, 0);
        state.unsynced.push(Write::Length(length as usize));
        Ok(())
    }

    fn sync_data(&self) -> Result<(), io::Error> {
        let mut state = self.lock();
        state.spend()?;
        state.unsynced.clear();
        state.synced = state.seen.clone();
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> Result<(), io::Error> {
        let mut state = self.lock();
        let at = offset as usize;
        if let Err(error) = state.spend() {
            // The write that the cut falls into may have come through as well.
            state.unsynced.push(Write::Bytes(at, data.to_vec()));
            return Err(error);
        }
        let end = state.seen.len().max(at + data.len());
        state.seen.resize(end, 0);
        state.seen[at..at + data.len()].copy_from_slice(data);
        state.unsynced.push(Write::Bytes(at, data.to_vec()));
        Ok(())
    }
}

pub(super) fn job(key: JobKey, file: &[u8]) -> JobRecord {
    let request = RequestRecord {
        document: None,
        names_mesh: false,
        overrides: Vec::new(),
        format: "png".into(),
        kind: RequestKind::Draw,
        upload: None,
    };
    let files = vec![FileRecord { path: "mesh".into(), digest: Digest::of(file) }];
    JobRecord { key, accepted_unix_ms: 1, request, files, ..JobRecord::default() }
}

pub(super) fn cancelled() -> Box<EndRecord> {
    Box::new(EndRecord { at_unix_ms: 2, ..EndRecord::default() })
}

/// What a log has, in a form that can be compared: keys of jobs with whether they have ended.
fn shown(contents: &Contents) -> BTreeMap<JobKey, bool> {
    contents.jobs.iter().map(|job| (job.record.key, job.end.is_some())).collect()
}

/// Two jobs in one transaction, and the end and the disappearance of earlier ones.
fn transaction(number: u128, random: &mut Random) -> Vec<Change> {
    let body = vec![number as u8; random.below(9000)];
    let mut changes = vec![
        Change::SmallStored(Digest::of(&body), body.clone().into()),
        Change::Accepted(Box::new(job(2 * number, &body))),
        Change::Accepted(Box::new(job(2 * number + 1, &body))),
    ];
    if number > 1 {
        changes.push(Change::Ended(2 * number - 2, cancelled()));
        changes.push(Change::Started(2 * number - 1));
    }
    if number > 4 {
        changes.push(Change::Forgotten(2 * (number - 4)));
    }
    changes
}

fn apply(state: &mut BTreeMap<JobKey, bool>, changes: &[Change]) {
    for change in changes {
        match change {
            Change::Accepted(record) => _ = state.insert(record.key, false),
            Change::Ended(key, _) => _ = state.entry(*key).and_modify(|ended| *ended = true),
            Change::Forgotten(key) => _ = state.remove(key),
            _ => {}
        }
    }
}

#[test]
fn a_cut_at_any_write_loses_nothing_that_was_committed() {
    let rounds = std::env::var("MESHSNAP_CUTS").ok().and_then(|n| n.parse().ok()).unwrap_or(150);
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut cuts, mut whole, mut commits) = (0, 0, 0);
    for _ in 0..rounds {
        let disk = Disk::new();
        let mut expected = BTreeMap::new();
        let mut number = 0_u128;
        // The same disk through several cuts, the first of which falls into its making, at times.
        for life in 0..4 {
            disk.cut_after(random.below(if life == 0 { 60 } else { 120 }));
            let mut next = None;
            if let Ok(mut log) = disk.log() {
                assert_eq!(shown(&log.load().unwrap_or_default()), expected, "when it opens");
                loop {
                    number += 1;
                    let changes = transaction(number, &mut random);
                    let mut after = expected.clone();
                    apply(&mut after, &changes);
                    if log.commit(&changes).is_err() {
                        next = Some(after);
                        break;
                    }
                    commits += 1;
                    expected = after;
                }
            }
            cuts += 1;
            disk.restart(&mut random);
            let mut log = match disk.log() {
                Ok(log) => log,
                // Only a file that never was whole may not open: in a folder it has no name yet.
                Err(_) if expected.is_empty() && number == 0 => break,
                Err(error) => panic!("after {commits} commits: {error}"),
            };
            let found = shown(&log.load().unwrap());
            if next.as_ref() == Some(&found) {
                whole += 1;
                expected = found;
            } else {
                assert_eq!(found, expected, "neither before nor after the transaction that was cut");
            }
            for record in log.load().unwrap().jobs {
                let digest = record.record.files[0].digest;
                let bytes = log.small(digest).unwrap().expect("the bytes of a job");
                assert_eq!(Digest::of(&bytes), digest);
            }
        }
    }
    println!("{cuts} cuts, {commits} commits kept, {whole} cut transactions whole");
    assert!(cuts > 2 * rounds && commits > rounds, "{cuts} cuts, {commits} commits");
}

#[test]
fn a_full_disk_is_an_error_until_there_is_room() {
    let disk = Disk::new();
    let (durable, _) = Durable::on(Box::new(disk.log().unwrap()), Arc::new(Shelf::default())).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    let accept = |key: JobKey| {
        let bytes = Bytes::from(vec![key as u8; 1000]);
        let hold = durable.hold(&bytes).unwrap();
        let changes = vec![Change::Accepted(Box::new(job(key, &bytes)))];
        (runtime.block_on(durable.store(changes, vec![hold.clone()])), hold)
    };
    let (stored, _first) = accept(1);
    assert_eq!(stored, Ok(()));
    disk.lock().is_full = true;
    assert_eq!(accept(2).0, Err(Unstored::Full));
    // The end of a job is owed until there is room.
    durable.store_soon(vec![Change::Ended(1, cancelled())], Vec::new());
    assert_eq!(accept(3).0, Err(Unstored::Full));
    disk.lock().is_full = false;
    let (stored, _fourth) = accept(4);
    assert_eq!(stored, Ok(()));
    durable.close();
    drop(durable);
    let contents = disk.log().unwrap().load().unwrap();
    assert_eq!(shown(&contents), BTreeMap::from([(1, true), (4, false)]));
}

/// Files in memory.
#[derive(Default)]
struct Shelf(Mutex<HashMap<Digest, Bytes>>);

impl Blobs for Shelf {
    fn put(&self, digest: Digest, bytes: &Bytes) -> io::Result<()> {
        self.0.lock().unwrap().insert(digest, bytes.clone());
        Ok(())
    }
    fn get(&self, digest: Digest) -> io::Result<Option<Bytes>> {
        Ok(self.0.lock().unwrap().get(&digest).cloned())
    }
    fn delete(&self, digest: Digest) -> io::Result<()> {
        self.0.lock().unwrap().remove(&digest);
        Ok(())
    }
    fn list(&self) -> io::Result<Vec<Digest>> {
        Ok(self.0.lock().unwrap().keys().copied().collect())
    }
}

#[test]
fn bytes_stay_as_long_as_somebody_holds_them() {
    let shelf = Arc::new(Shelf::default());
    let (durable, _) = Durable::on(Box::new(Disk::new().log().unwrap()), shelf.clone()).unwrap();
    let contents: Vec<Bytes> = (0..4).map(|i| vec![i; SMALL_BYTES_MAX + 1].into()).collect();
    let wrong = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (durable, contents, shelf, wrong) = (&durable, &contents, &shelf, &wrong);
            scope.spawn(move || {
                for round in 0..300 {
                    let bytes = &contents[(round + thread) % contents.len()];
                    let hold = durable.hold(bytes).unwrap();
                    if shelf.get(hold.digest()).unwrap().as_ref() != Some(bytes) {
                        wrong.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    assert_eq!(wrong.load(Ordering::Relaxed), 0, "times that held bytes were missing");
    durable.close();
    // What was dropped last may be asked for no more.
    let (again, _) = Durable::on(Box::new(Disk::new().log().unwrap()), shelf.clone()).unwrap();
    assert_eq!(shelf.list().unwrap(), [], "the next start removes what nothing names");
    drop(again);
}

/// A crash may come between the end of a record and the removal of its bytes.
#[test]
fn small_bytes_that_no_record_names_go_at_the_next_start() {
    let disk = Disk::new();
    let (named, other, compared) = (Bytes::from("named"), Bytes::from("other"), Bytes::from("compared"));
    let mut record = job(7, &named);
    let files = vec![FileRecord { path: "b".into(), digest: Digest::of(&compared) }];
    record.newer = Some(SideRecord { files, is_zip: false, mesh: None });
    let stored = [named, other, compared].map(|bytes| Change::SmallStored(Digest::of(&bytes), bytes));
    disk.log().unwrap().commit(&[&stored[..], &[Change::Accepted(Box::new(record))]].concat()).unwrap();
    let (durable, recovered) = Durable::on(Box::new(disk.log().unwrap()), Arc::new(Shelf::default())).unwrap();
    assert!(recovered.bytes(Digest::of(b"compared")).is_some(), "a job compares two meshes");
    // With the records, their bytes are held.
    durable.close();
    let mut left = disk.log().unwrap().small_digests().unwrap();
    left.sort_unstable();
    let mut expected = [Digest::of(b"named"), Digest::of(b"compared")];
    expected.sort_unstable();
    assert_eq!(left, expected);
    drop((durable, recovered));
}

#[test]
fn a_folder_is_opened_by_one_process_and_keeps_files_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let large = Bytes::from(vec![9; SMALL_BYTES_MAX + 1]);
    let digest = Digest::of(&large);
    let file = folder.path().join(BLOB_FOLDER).join(&digest.to_string()[..2]).join(digest.to_string());
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    {
        let (durable, _) = Durable::open(folder.path()).unwrap();
        assert!(matches!(Durable::open(folder.path()), Err(OpenError::InUse(_))));
        let hold = durable.hold(&large).unwrap();
        let changes = vec![Change::Accepted(Box::new(job(7, &large)))];
        runtime.block_on(durable.store(changes, vec![hold.clone()])).unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), large);
        durable.close();
    }
    // Files that no record names, and those that were not written to their end, go at the next start.
    let name = Digest::of(b"stray").to_string();
    let stray = folder.path().join(BLOB_FOLDER).join(&name[..2]).join(name);
    std::fs::create_dir_all(stray.parent().unwrap()).unwrap();
    let unfinished = file.with_file_name(format!("{digest}#1"));
    std::fs::write(&stray, b"stray").unwrap();
    std::fs::write(&unfinished, b"half").unwrap();
    let (durable, recovered) = Durable::open(folder.path()).unwrap();
    assert_eq!(recovered.bytes(digest).map(|(bytes, _)| bytes), Some(large));
    assert!(!stray.exists() && !unfinished.exists());
    assert_eq!(recovered.jobs.len(), 1);
    durable.close();
    drop((durable, recovered));
    // What the disk has damaged is lost, and the folder opens.
    std::fs::write(&file, b"damaged").unwrap();
    let (durable, recovered) = Durable::open(folder.path()).unwrap();
    assert_eq!((recovered.jobs.len(), recovered.bytes(digest).is_none()), (1, true));
    durable.close();
}

/// A log that counts its transactions.
struct Counted {
    log: RedbLog,
    commits: Arc<AtomicUsize>,
}

impl Log for Counted {
    fn load(&mut self) -> io::Result<Contents> {
        self.log.load()
    }
    fn small(&mut self, digest: Digest) -> io::Result<Option<Bytes>> {
        self.log.small(digest)
    }
    fn small_digests(&mut self) -> io::Result<Vec<Digest>> {
        self.log.small_digests()
    }
    fn commit(&mut self, changes: &[Change]) -> io::Result<()> {
        self.commits.fetch_add(1, Ordering::Relaxed);
        self.log.commit(changes)
    }
}

/// Prints the rate on this machine's disk. What can be asserted anywhere is that commits share transactions.
#[test]
fn commits_that_arrive_together_share_a_transaction() {
    let folder = tempfile::tempdir().unwrap();
    let commits = Arc::new(AtomicUsize::new(0));
    let log = Counted { log: RedbLog::open(&folder.path().join("jobs.redb")).unwrap(), commits: commits.clone() };
    let (durable, _) = Durable::on(Box::new(log), Arc::new(Shelf::default())).unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build().unwrap();
    let (clients, each) = (64_u128, 40_u128);
    let began = Instant::now();
    let is_wrong = Arc::new(AtomicBool::new(false));
    let tasks: Vec<_> = (0..clients)
        .map(|client| {
            let (durable, is_wrong) = (durable.clone(), is_wrong.clone());
            runtime.spawn(async move {
                let mut holds = Vec::new();
                for round in 0..each {
                    let key = client * each + round;
                    let bytes = Bytes::from(format!("mesh {key}").repeat(100));
                    let hold = durable.hold(&bytes).unwrap();
                    let changes = vec![Change::Accepted(Box::new(job(key, &bytes)))];
                    let stored = durable.store(changes, vec![hold.clone()]).await;
                    is_wrong.fetch_or(stored.is_err(), Ordering::Relaxed);
                    holds.push(hold);
                }
                holds
            })
        })
        .collect();
    let holds: Vec<_> = tasks.into_iter().map(|task| runtime.block_on(task).unwrap()).collect();
    let took = began.elapsed();
    let (accepted, commits) = ((clients * each) as usize, commits.load(Ordering::Relaxed));
    println!("{accepted} commits in {commits} transactions, {:.0} a second", accepted as f64 / took.as_secs_f64());
    assert!(!is_wrong.load(Ordering::Relaxed));
    assert!(commits * 4 < accepted, "{accepted} commits in {commits} transactions");
    durable.close();
    drop(durable);
    let keys: BTreeSet<JobKey> = RedbLog::open(&folder.path().join("jobs.redb"))
        .unwrap()
        .load()
        .unwrap()
        .jobs
        .iter()
        .map(|j| j.record.key)
        .collect();
    assert_eq!(keys.len(), accepted);
    assert!(took > Duration::ZERO && holds.len() == clients as usize);
}
