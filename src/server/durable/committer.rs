//! The thread that writes the database of the data folder (`log`), and removes stored bytes that no record needs any
//! more.
//!
//! Changes that arrive while the disk works are written together in the next transaction (group commit). Its syncs of
//! the disk then store the changes of many jobs, and hardly limit how many jobs are accepted per second.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use super::blobs::Blobs;
use super::hold::{Dropped, Hold, Index};
use super::log::Log;
use super::record::Change;
use super::{Unstored, unstored};
use crate::digest::Digest;

/// Most commits of one transaction.
const BATCH_MAX: usize = 1024;

/// Time after which what the disk has refused is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// What the thread is told.
#[derive(Debug)]
pub enum Message {
    /// Changes to be stored together.
    Commit(Commit),
    /// The last hold on these bytes was dropped.
    Dropped(Dropped),
    /// The process ends.
    Close,
}

/// Hears whether changes were stored.
pub type OnStored = Box<dyn FnOnce(Result<(), Unstored>) + Send>;

/// Changes that are stored together.
pub struct Commit {
    /// The changes.
    pub changes: Vec<Change>,
    /// The bytes that their records name.
    pub holds: Vec<Arc<Hold>>,
    /// What is let go once the changes are stored.
    pub releases: Vec<Arc<Hold>>,
    /// If the disk refuses them, they are tried again until it does not.
    pub must: bool,
    /// Hears of the first attempt.
    pub done: Option<OnStored>,
}

impl std::fmt::Debug for Commit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Commit").field("changes", &self.changes).field("must", &self.must).finish_non_exhaustive()
    }
}

impl Commit {
    /// Tells the outcome, once.
    pub fn answer(mut self, outcome: Result<(), Unstored>) -> Self {
        if let Some(done) = self.done.take() {
            done(outcome);
        }
        self
    }
}

/// Writes until it is told to close. `written` hears of the outcome of each transaction.
pub fn run(
    mut log: Box<dyn Log>,
    blobs: &dyn Blobs,
    index: &Index,
    inbox: &Receiver<Message>,
    written: &dyn Fn(Result<(), Unstored>),
) {
    let mut owed: Vec<Commit> = Vec::new();
    let mut dropped: Vec<Digest> = Vec::new();
    loop {
        let first = match owed.is_empty() && dropped.is_empty() {
            true => inbox.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => inbox.recv_timeout(RETRY),
        };
        let mut is_closing = matches!(first, Err(RecvTimeoutError::Disconnected));
        // What is only removed waits for a transaction that is needed, or for a while.
        let mut is_due = first.is_err();
        let mut batch = std::mem::take(&mut owed);
        let mut files = Vec::new();
        for message in first.into_iter().chain(std::iter::from_fn(|| inbox.try_recv().ok()).take(BATCH_MAX)) {
            match message {
                Message::Commit(commit) => {
                    is_due = true;
                    batch.push(commit);
                }
                Message::Dropped(Dropped { digest, is_small: true }) => dropped.push(digest),
                Message::Dropped(Dropped { digest, is_small: false }) => files.push(digest),
                Message::Close => is_closing = true,
            }
        }
        if is_due || is_closing {
            owed = write(&mut *log, batch, &mut dropped, index, written);
        } else {
            owed = batch;
        }
        remove(&files, blobs, index);
        if is_closing {
            return;
        }
    }
}

/// Writes a transaction, and tells its commits. Returns those that have to be tried again.
fn write(
    log: &mut dyn Log,
    batch: Vec<Commit>,
    dropped: &mut Vec<Digest>,
    index: &Index,
    written: &dyn Fn(Result<(), Unstored>),
) -> Vec<Commit> {
    match log.commit(&changes(&batch, dropped, index)) {
        Ok(()) => {
            written(Ok(()));
            dropped.clear();
            for commit in batch {
                commit.holds.iter().filter(|hold| hold.is_small()).for_each(|hold| hold.set_stored());
                drop(commit.answer(Ok(())).releases);
            }
            Vec::new()
        }
        Err(error) => {
            let cause = unstored(&error);
            written(Err(cause));
            batch.into_iter().map(|commit| commit.answer(Err(cause))).filter(|commit| commit.must).collect()
        }
    }
}

/// The changes of a transaction: those of all commits, the small bytes that they bring along, and the removal
/// of those that nothing holds any more.
fn changes(batch: &[Commit], dropped: &[Digest], index: &Index) -> Vec<Change> {
    let mut brought = HashSet::new();
    let mut changes: Vec<Change> = Vec::new();
    // First, because a commit may bring the same bytes anew.
    changes.extend(dropped.iter().filter_map(|&digest| index.if_free(digest, || Change::SmallRemoved(digest))));
    for commit in batch {
        let small = commit.holds.iter().filter_map(|hold| Some((hold.digest(), hold.unstored_bytes()?)));
        changes.extend(
            small.filter(|(digest, _)| brought.insert(*digest)).map(|(d, bytes)| Change::SmallStored(d, bytes)),
        );
        changes.extend(commit.changes.iter().cloned());
    }
    changes
}

/// Removes files. One that stays behind is removed at the next start.
fn remove(files: &[Digest], blobs: &dyn Blobs, index: &Index) {
    for &digest in files {
        if let Some(Err(error)) = index.if_free(digest, || blobs.delete(digest)) {
            tracing::warn!(%error, %digest, "a file in the data folder was not removed");
        }
    }
}
