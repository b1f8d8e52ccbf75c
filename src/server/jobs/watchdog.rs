//! Counts the workers that do not stop when the time of their job is up, and the meshes with which
//! that happens. A bug keeps such a worker busy, and nothing can end a thread from outside.
//!
//! After a grace, `clock.rs` reports such a worker and starts another in its place, unless the
//! number of stuck ones is more than twice that of workers in the settings. If its job ends after
//! all, the worker ends itself, or goes on in the place of a stuck one that was not replaced.
//!
//! A mesh that has kept a worker busy in this way twice is refused from then on. Which mesh of a comparison is to
//! blame is not known. So a mesh of two such comparisons is refused in comparisons alone. The last 1024 meshes that
//! were in such a job are remembered, until the server ends.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::job::Job;
use crate::digest::Digest;
use meshsnap_render::import::Bundle;

/// Workers that a mesh, or comparisons with it, may keep busy before that is refused.
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

/// The meshes that keep workers busy.
#[derive(Default)]
pub struct Quarantine(Mutex<HashMap<Digest, Entry>>);

/// The numbers of workers that were stuck with a mesh.
struct Entry {
    /// With the mesh by itself.
    alone: u32,
    /// With comparisons of it.
    compared: u32,
    bytes: u64,
    last: Instant,
}

impl Entry {
    fn is_refused(&self, is_compared: bool) -> bool {
        self.alone >= STRIKES || is_compared && self.compared >= STRIKES
    }
}

impl Quarantine {
    /// A worker is stuck with this mesh, or with the comparison of these. Returns their digests, each with how often that
    /// has happened.
    pub fn strike(&self, meshes: &[Bundle]) -> Vec<(Digest, u32)> {
        let mut names: Vec<(Digest, u64)> = meshes.iter().map(|mesh| (digest(mesh), mesh.bytes_len())).collect();
        // A mesh that is compared with itself is to blame.
        names.dedup();
        let is_compared = names.len() > 1;
        names.into_iter().map(|(name, bytes)| (name, self.strike_one(name, bytes, is_compared))).collect()
    }

    fn strike_one(&self, name: Digest, bytes: u64, is_compared: bool) -> u32 {
        let mut meshes = self.lock();
        if meshes.len() >= MESHES_MAX
            && !meshes.contains_key(&name)
            && let Some(oldest) = meshes.iter().min_by_key(|(_, entry)| entry.last).map(|(name, _)| *name)
        {
            meshes.remove(&oldest);
        }
        let last = Instant::now();
        let entry = meshes.entry(name).or_insert(Entry { alone: 0, compared: 0, bytes, last });
        entry.last = last;
        let strikes = if is_compared { &mut entry.compared } else { &mut entry.alone };
        *strikes += 1;
        *strikes
    }

    /// The digest of a mesh of a job that is refused.
    pub fn holds(&self, meshes: &[Bundle]) -> Option<Digest> {
        let is_compared = meshes.len() > 1;
        meshes.iter().find_map(|mesh| {
            let bytes = mesh.bytes_len();
            // Hashing takes a while, and hardly ever is there anything to compare with.
            if !self.lock().values().any(|entry| entry.bytes == bytes && entry.is_refused(is_compared)) {
                return None;
            }
            let name = digest(mesh);
            self.lock().get(&name).is_some_and(|entry| entry.is_refused(is_compared)).then_some(name)
        })
    }

    /// Number of meshes that are refused, by themselves or in comparisons.
    pub fn count(&self) -> usize {
        self.lock().values().filter(|entry| entry.is_refused(true)).count()
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Digest, Entry>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The name of a mesh, as the store of meshes has it.
fn digest(bundle: &Bundle) -> Digest {
    match bundle.files() {
        [one] => Digest::of(&one.bytes),
        files => Digest::of_files(files),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(name: &str) -> Bundle {
        Bundle::of_one(name.as_bytes().to_vec())
    }

    #[test]
    fn strikes_of_a_mesh_add_up_where_all_places_are_taken() {
        let quarantine = Quarantine::default();
        let strike = |i: usize| quarantine.strike(&[mesh(&i.to_string())])[0].1;
        for i in 0..MESHES_MAX {
            assert_eq!(strike(i), 1);
        }
        assert_eq!(strike(0), 2, "the oldest one");
        assert_eq!(strike(MESHES_MAX), 1, "a new one, which takes the place of another");
        assert_eq!(strike(0), 3);
    }

    #[test]
    fn a_mesh_of_two_stuck_comparisons_is_refused_in_comparisons_alone() {
        let quarantine = Quarantine::default();
        let holds = |names: &[&str]| quarantine.holds(&names.iter().map(|name| mesh(name)).collect::<Vec<_>>());
        let [evil, stuck] = ["evil", "stuck"].map(|name| Some(Digest::of(name.as_bytes())));
        quarantine.strike(&[mesh("good"), mesh("evil")]);
        assert_eq!(holds(&["good", "evil"]), None);
        quarantine.strike(&[mesh("evil"), mesh("fine")]);
        assert_eq!([holds(&["good", "evil"]), holds(&["evil", "new"])], [evil; 2]);
        assert_eq!([holds(&["good", "fine"]), holds(&["evil"])], [None; 2]);
        // One that is stuck by itself is refused everywhere; so is one that was compared with itself.
        quarantine.strike(&[mesh("stuck")]);
        quarantine.strike(&[mesh("stuck"), mesh("stuck")]);
        assert_eq!([holds(&["stuck"]), holds(&["good", "stuck"])], [stuck; 2]);
        assert_eq!(quarantine.count(), 2);
    }
}
