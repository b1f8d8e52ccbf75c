//! The data folder: what outlives the process. The records of jobs and meshes are in a database ([`log`]). The bytes
//! that they need are named by their SHA-256: small ones are in the database, too, larger ones in files ([`blobs`]).
//!
//! One thread writes the database ([`committer`]): changes that arrive while it waits for the disk share its next
//! transaction. A [`Hold`] is a counted reference of records to bytes: when the last one is dropped, the bytes are
//! removed.
//!
//! Architecture invariants: what [`Durable::store`] has answered with Ok survives a crash at any instant. Nothing
//! here depends on what a job does, nor on HTTP.

mod blobs;
mod committer;
mod hold;
mod log;
mod record;
mod snapshot;
#[cfg(test)]
mod tests;

pub use blobs::{Blobs, FolderBlobs};
pub use hold::Hold;
pub use log::{Contents, Log, RedbLog};
pub use record::{
    Change, ClaimRecord, EndRecord, ErrorRecord, FileRecord, JobKey, JobRecord, MeshRecord, PictureRecord,
};
pub use record::{RequestKind, RequestRecord, SelectionRecord, SideRecord, WarningRecord};
pub use snapshot::read;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use tokio::sync::oneshot;

use super::digest::Digest;
use committer::{Commit, Message};
use hold::{Index, OnDrop};

/// Bytes up to which content is kept in the log itself: its transaction makes it durable, too, while a
/// file takes syncs of its own.
const SMALL_BYTES_MAX: usize = 64 << 10;

/// The name of the log in the data folder.
const LOG_FILE: &str = "jobs.redb";

/// The name of the folder of files in it.
const BLOB_FOLDER: &str = "blobs";

/// The error of a write to the data folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unstored {
    /// No room is left.
    #[error("the disk of this server is full, so nothing that must be stored is accepted")]
    Full,
    /// The disk cannot be written to.
    #[error("the disk of this server cannot be written to, so nothing that must be stored is accepted")]
    Failed,
}

/// Reasons why a data folder was not opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process has it open.
    #[error("the data folder {0} is used by another meshsnap; give each its own --data-dir, or say --ephemeral")]
    InUse(PathBuf),
    /// It was written by a version that this one does not know.
    #[error("the data folder {0} was written by a newer meshsnap; use that one, or another --data-dir")]
    Newer(PathBuf),
    /// It cannot be read or written.
    #[error("the data folder {folder} cannot be used: {error}; say --data-dir DIR, or --ephemeral to store nothing")]
    Io {
        /// The folder.
        folder: PathBuf,
        /// The cause.
        error: io::Error,
    },
}

/// A handle to the data folder. Clones share it.
#[derive(Clone)]
pub struct Durable(Arc<Inner>);

impl std::fmt::Debug for Durable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Durable").finish_non_exhaustive()
    }
}

struct Inner {
    blobs: Arc<dyn Blobs>,
    index: Arc<Index>,
    inbox: Sender<Message>,
    on_drop: OnDrop,
    health: Arc<Health>,
    committer: Mutex<Option<JoinHandle<()>>>,
}

/// The outcome of the last write.
#[derive(Default)]
struct Health {
    trouble: Mutex<Option<Unstored>>,
    is_probing: AtomicBool,
}

impl Health {
    fn set(&self, outcome: Result<(), Unstored>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = outcome.err();
    }

    fn trouble(&self) -> Option<Unstored> {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The content of a data folder when it was opened.
#[derive(Default)]
pub struct Recovered {
    /// The jobs, in the order of acceptance.
    pub jobs: Vec<RecoveredJob>,
    /// The stored meshes.
    pub meshes: Vec<MeshRecord>,
    blobs: HashMap<Digest, (Bytes, Arc<Hold>)>,
}

/// A job of a process that ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RecoveredJob {
    /// The job as it was accepted.
    pub record: JobRecord,
    /// How often a worker has begun it.
    pub starts: u32,
    /// Its end, if it had ended.
    pub end: Option<EndRecord>,
}

impl Recovered {
    /// Bytes that a record names. None if they are lost.
    pub fn bytes(&self, digest: Digest) -> Option<(Bytes, Arc<Hold>)> {
        self.blobs.get(&digest).cloned()
    }
}

impl Durable {
    /// Opens a data folder, which is made if it is missing.
    pub fn open(folder: &Path) -> Result<(Self, Recovered), OpenError> {
        let io = |error| OpenError::Io { folder: folder.to_owned(), error };
        std::fs::create_dir_all(folder.join(BLOB_FOLDER)).map_err(io)?;
        let log = RedbLog::open(&folder.join(LOG_FILE)).map_err(|error| match error.kind() {
            io::ErrorKind::ResourceBusy => OpenError::InUse(folder.to_owned()),
            io::ErrorKind::Unsupported => OpenError::Newer(folder.to_owned()),
            _ => io(error),
        })?;
        let blobs = FolderBlobs::open(&folder.join(BLOB_FOLDER)).map_err(io)?;
        Self::on(Box::new(log), Arc::new(blobs)).map_err(io)
    }

    /// Opens a log and its files, and starts the thread that writes.
    pub fn on(mut log: Box<dyn Log>, blobs: Arc<dyn Blobs>) -> io::Result<(Self, Recovered)> {
        let contents = log.load()?;
        let (inbox, outbox) = mpsc::channel();
        let index = Arc::new(Index::default());
        let dropped = inbox.clone();
        let on_drop: OnDrop = Arc::new(move |bytes| _ = dropped.send(Message::Dropped(bytes)));
        let mut found = HashMap::new();
        for digest in contents.digests() {
            let bytes = match log.small(digest)? {
                Some(bytes) => Some((bytes, true)),
                None => blobs.get(digest)?.map(|bytes| (bytes, false)),
            };
            // What the disk has damaged is lost, and its job says so.
            if let Some((bytes, is_small)) = bytes.filter(|(bytes, _)| Digest::of(bytes) == digest) {
                found.insert(digest, (bytes, index.hold_stored(digest, is_small, &on_drop)));
            }
        }
        sweep(&mut *log, &*blobs, &found)?;
        let (writer_blobs, writer_index, health) = (blobs.clone(), index.clone(), Arc::new(Health::default()));
        let writer_health = health.clone();
        let committer = std::thread::Builder::new().name("committer".into()).spawn(move || {
            committer::run(log, &*writer_blobs, &writer_index, &outbox, &|outcome| writer_health.set(outcome))
        })?;
        let inner = Inner { blobs, index, inbox, on_drop, health, committer: Mutex::new(Some(committer)) };
        let Contents { jobs, meshes } = contents;
        Ok((Self(Arc::new(inner)), Recovered { jobs, meshes, blobs: found }))
    }

    /// Holds bytes for a record that is to be stored with [`Durable::store`]. Writes large ones to
    /// their file, so it may take long.
    pub fn hold(&self, bytes: &Bytes) -> Result<Arc<Hold>, Unstored> {
        let hold = self.0.index.hold(bytes, SMALL_BYTES_MAX, &self.0.on_drop);
        if !hold.is_small() && !hold.is_stored() {
            let put = self.0.blobs.put(hold.digest(), bytes).map_err(|error| unstored(&error));
            self.0.health.set(put);
            put?;
            hold.set_stored();
        }
        Ok(hold)
    }

    /// Stores changes, and the bytes that they name, in one transaction. Returns once they are on the disk.
    pub async fn store(&self, changes: Vec<Change>, holds: Vec<Arc<Hold>>) -> Result<(), Unstored> {
        let (sender, receiver) = oneshot::channel();
        let done = Box::new(move |stored| _ = sender.send(stored));
        self.send(Commit { changes, holds, releases: Vec::new(), must: false, done: Some(done) });
        receiver.await.unwrap_or(Err(Unstored::Failed))
    }

    /// As [`Durable::store`], with an answer on another thread. What the disk refuses now is tried again until it
    /// is stored. `releases` are let go then.
    pub fn store_surely(
        &self,
        changes: Vec<Change>,
        holds: Vec<Arc<Hold>>,
        releases: Vec<Arc<Hold>>,
        done: impl FnOnce(Result<(), Unstored>) + Send + 'static,
    ) {
        self.send(Commit { changes, holds, releases, must: true, done: Some(Box::new(done)) });
    }

    /// Stores changes soon. `releases` are let go then.
    pub fn store_soon(&self, changes: Vec<Change>, releases: Vec<Arc<Hold>>) {
        self.store_surely(changes, Vec::new(), releases, |_| ());
    }

    /// The error of the last write, if it failed. Then something is written again, so that the next call knows whether
    /// the disk has recovered. Waits for nothing.
    pub fn trouble(&self) -> Option<Unstored> {
        let trouble = self.0.health.trouble()?;
        if !self.0.health.is_probing.swap(true, Ordering::Relaxed) {
            let health = self.0.health.clone();
            let done = Box::new(move |_| health.is_probing.store(false, Ordering::Relaxed));
            self.send(Commit {
                changes: Vec::new(),
                holds: Vec::new(),
                releases: Vec::new(),
                must: false,
                done: Some(done),
            });
        }
        Some(trouble)
    }

    /// Writes what is outstanding and ends the thread that writes. Nothing is stored after that.
    pub fn close(&self) {
        let committer = self.0.committer.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(committer) = committer {
            let _ = self.0.inbox.send(Message::Close);
            let _ = committer.join();
        }
    }

    fn send(&self, commit: Commit) {
        if let Err(mpsc::SendError(Message::Commit(commit))) = self.0.inbox.send(Message::Commit(commit)) {
            commit.answer(Err(Unstored::Failed));
        }
    }
}

/// Removes bytes that no record names: a crash came between the bytes and their record, or between the end of a record
/// and the removal of its bytes.
fn sweep(log: &mut dyn Log, blobs: &dyn Blobs, found: &HashMap<Digest, (Bytes, Arc<Hold>)>) -> io::Result<()> {
    let is_unnamed = |digest: &Digest| !found.contains_key(digest);
    for digest in blobs.list()?.into_iter().filter(is_unnamed) {
        blobs.delete(digest)?;
    }
    let small: Vec<Change> = log.small_digests()?.into_iter().filter(is_unnamed).map(Change::SmallRemoved).collect();
    if let Err(error) = log.commit(&small) {
        tracing::warn!(%error, "bytes that no record names stay in the log until the next start");
    }
    Ok(())
}

/// The error for the client. The cause is in the log.
fn unstored(error: &io::Error) -> Unstored {
    tracing::error!(%error, "the data folder cannot be written to");
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => Unstored::Full,
        _ => Unstored::Failed,
    }
}
