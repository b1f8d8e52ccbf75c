//! Counts the workers that do not stop when the time of their job is up, and the meshes with which
//! that happens. A bug keeps such a worker busy, and nothing can end a thread from outside.
//!
//! After a grace, `clock.rs` reports such a worker and starts another in its place, unless the
//! number of stuck ones is more than twice that of workers in the settings. If its job ends after
//! all, the worker ends itself, or goes on in the place of a stuck one that was not replaced.
//!
//! A mesh that has kept a worker busy in this way twice is refused from then on. So is the comparison of two meshes, but
//! not each of them. The last 1024 meshes and pairs that have done so at least once are remembered, until the server ends.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::job::Job;
use crate::digest::Digest;
use meshsnap_render::import::Bundle;

/// Workers that a mesh may keep busy before it is refused.
const STRIKES: u32 = 2;

/// Most meshes that are remembered. One that is evil can be changed by a byte each time, so that no list is complete.
const MESHES_MAX: usize = 1024;

/// A job that occupies a worker.
pub struct Running {
    /// The job.
    pub job: Arc<Job>,
    /// Its mesh, and the newer one of a comparison.
    pub meshes: Vec<Bundle>,
    /// The moment at which the worker has begun it.
    pub since: Instant,
}

impl Running {
    /// Time until it ends, as far as is known. A job that takes longer than its estimate is expected to
    /// take as long again as it is late. It stops when its time is up.
    pub fn remaining(&self, limit: Duration) -> Duration {
        let so_far = self.since.elapsed();
        so_far.abs_diff(self.job.estimate).min(limit.saturating_sub(so_far))
    }
}

/// The workers that are busy for too long.
#[derive(Default)]
pub struct Overdue {
    /// Serial numbers of their jobs.
    jobs: HashSet<u64>,
    /// Those in whose place there is no other.
    unreplaced: usize,
}

impl Overdue {
    /// A worker is busy for too long. True if another is to take its place: where many are stuck, more threads would
    /// take the machine from those that work.
    pub fn add(&mut self, job: &Job, workers: usize) -> bool {
        self.jobs.insert(job.serial);
        let is_replaced = self.jobs.len() <= workers.saturating_mul(2);
        self.unreplaced += usize::from(!is_replaced);
        is_replaced
    }

    /// A worker has ended a job. True if it goes on: another may have taken its place.
    pub fn ended(&mut self, job: &Job) -> bool {
        if !self.jobs.remove(&job.serial) {
            return true;
        }
        let goes_on = self.unreplaced > 0;
        self.unreplaced -= usize::from(goes_on);
        goes_on
    }

    /// Number of workers that are stuck, and of those that have no replacement.
    pub fn counts(&self) -> (usize, usize) {
        (self.jobs.len(), self.unreplaced)
    }
}

/// The meshes, and pairs of compared meshes, that keep workers busy.
#[derive(Default)]
pub struct Quarantine(Mutex<HashMap<Digest, Entry>>);

struct Entry {
    strikes: u32,
    bytes: u64,
    last: Instant,
}

impl Quarantine {
    /// A worker is stuck with this mesh, or with two that it compares. Which of two is to blame is not known, so they
    /// count as a pair and not each by itself. Returns the digest, and how often that has happened.
    pub fn strike(&self, meshes: &[Bundle]) -> (Digest, u32) {
        let (digest, bytes, last) = (digest(meshes), bytes_of(meshes), Instant::now());
        let mut entries = self.lock();
        if entries.len() >= MESHES_MAX
            && !entries.contains_key(&digest)
            && let Some(oldest) = entries.iter().min_by_key(|(_, entry)| entry.last).map(|(digest, _)| *digest)
        {
            entries.remove(&oldest);
        }
        let entry = entries.entry(digest).or_insert(Entry { strikes: 0, bytes, last });
        entry.strikes += 1;
        entry.last = last;
        (digest, entry.strikes)
    }

    /// The digest of a mesh, or of two that are compared, if that is refused.
    pub fn holds(&self, meshes: &[Bundle]) -> Option<Digest> {
        let bytes = bytes_of(meshes);
        // Hashing takes a while, and hardly ever is there anything to compare with.
        if !self.lock().values().any(|entry| entry.bytes == bytes && entry.strikes >= STRIKES) {
            return None;
        }
        let digest = digest(meshes);
        self.lock().get(&digest).is_some_and(|entry| entry.strikes >= STRIKES).then_some(digest)
    }

    /// Number of meshes that are refused.
    pub fn count(&self) -> usize {
        self.lock().values().filter(|entry| entry.strikes >= STRIKES).count()
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Digest, Entry>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn bytes_of(meshes: &[Bundle]) -> u64 {
    meshes.iter().map(Bundle::bytes_len).sum()
}

/// The name of a mesh, as the store of meshes has it. Of two, the digest of both names.
fn digest(meshes: &[Bundle]) -> Digest {
    let name = |bundle: &Bundle| match bundle.files() {
        [one] => Digest::of(&one.bytes),
        files => Digest::of_files(files),
    };
    match meshes {
        [one] => name(one),
        several => Digest::of(&several.iter().flat_map(|bundle| *name(bundle).as_bytes()).collect::<Vec<_>>()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strikes_of_a_mesh_add_up_where_all_places_are_taken() {
        let quarantine = Quarantine::default();
        let mesh = |i: usize| [Bundle::of_one(i.to_string().into_bytes())];
        for i in 0..MESHES_MAX {
            assert_eq!(quarantine.strike(&mesh(i)).1, 1);
        }
        assert_eq!(quarantine.strike(&mesh(0)).1, 2, "the oldest one");
        assert_eq!(quarantine.strike(&mesh(MESHES_MAX)).1, 1, "a new one, which takes the place of another");
        assert_eq!(quarantine.strike(&mesh(0)).1, 3);
    }

    #[test]
    fn two_compared_meshes_count_as_a_pair() {
        let quarantine = Quarantine::default();
        let [good, evil] = [b"good", b"evil"].map(|bytes| Bundle::of_one(bytes.to_vec()));
        let pair = [good.clone(), evil.clone()];
        for strikes in 1..=2 {
            assert_eq!(quarantine.strike(&pair).1, strikes);
        }
        assert!(quarantine.holds(&pair).is_some());
        assert_eq!([[good.clone()], [evil.clone()]].map(|mesh| quarantine.holds(&mesh)), [None, None]);
        assert_eq!(quarantine.holds(&[evil, good]), None, "the other way round");
    }
}
