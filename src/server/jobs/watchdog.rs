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
pub struct Quarantine {
    meshes: Mutex<HashMap<Digest, Entry>>,
    /// The strikes of which other servers of the same service were not told.
    untold: Mutex<Vec<Strikes>>,
}

/// The numbers of workers that were stuck with a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strikes {
    /// The mesh.
    pub mesh: Digest,
    /// The bytes of its files.
    pub bytes: u64,
    /// Workers that were stuck with the mesh by itself.
    pub alone: u32,
    /// Workers that were stuck with comparisons of it.
    pub compared: u32,
}

struct Entry {
    strikes: Strikes,
    last: Instant,
}

impl Strikes {
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
        let (alone, compared) = (u32::from(!is_compared), u32::from(is_compared));
        let strikes = names.into_iter().map(|(mesh, bytes)| Strikes { mesh, bytes, alone, compared });
        strikes
            .map(|strike| {
                let all = self.add(strike);
                let mut untold = lock(&self.untold);
                if untold.len() < MESHES_MAX {
                    untold.push(strike);
                }
                (strike.mesh, if is_compared { all.compared } else { all.alone })
            })
            .collect()
    }

    /// Counts strikes of a mesh. Returns all that it has.
    pub fn add(&self, more: Strikes) -> Strikes {
        self.change(more, u32::saturating_add)
    }

    /// A mesh has at least these strikes.
    pub fn learn(&self, known: Strikes) {
        self.change(known, u32::max);
    }

    fn change(&self, with: Strikes, both: impl Fn(u32, u32) -> u32) -> Strikes {
        let mut meshes = lock(&self.meshes);
        if meshes.len() >= MESHES_MAX
            && !meshes.contains_key(&with.mesh)
            && let Some(oldest) = meshes.iter().min_by_key(|(_, entry)| entry.last).map(|(name, _)| *name)
        {
            meshes.remove(&oldest);
        }
        let last = Instant::now();
        let none = Strikes { alone: 0, compared: 0, ..with };
        let entry = meshes.entry(with.mesh).or_insert(Entry { strikes: none, last });
        let (alone, compared) = (both(entry.strikes.alone, with.alone), both(entry.strikes.compared, with.compared));
        let strikes = Strikes { alone, compared, ..entry.strikes };
        if strikes != entry.strikes {
            *entry = Entry { strikes, last };
        }
        strikes
    }

    /// The strikes by this server's workers since the last call.
    pub fn take_untold(&self) -> Vec<Strikes> {
        std::mem::take(&mut *lock(&self.untold))
    }

    /// The strikes of all meshes, but for those of which the other servers will be told.
    pub fn told(&self) -> Vec<Strikes> {
        let untold = lock(&self.untold);
        let meshes = lock(&self.meshes);
        let told = meshes.values().map(|Entry { strikes, .. }| {
            let same = untold.iter().filter(|untold| untold.mesh == strikes.mesh);
            same.fold(*strikes, |told, untold| Strikes {
                alone: told.alone.saturating_sub(untold.alone),
                compared: told.compared.saturating_sub(untold.compared),
                ..told
            })
        });
        told.filter(|strikes| strikes.alone + strikes.compared > 0).collect()
    }

    /// The digest of a mesh of a job that is refused.
    pub fn holds(&self, meshes: &[Bundle]) -> Option<Digest> {
        let is_compared = meshes.len() > 1;
        meshes.iter().find_map(|mesh| {
            let bytes = mesh.bytes_len();
            // Hashing takes a while, and hardly ever is there anything to compare with.
            let is_meant = |strikes: &Strikes| strikes.bytes == bytes && strikes.is_refused(is_compared);
            if !lock(&self.meshes).values().any(|entry| is_meant(&entry.strikes)) {
                return None;
            }
            let name = digest(mesh);
            lock(&self.meshes).get(&name).is_some_and(|entry| entry.strikes.is_refused(is_compared)).then_some(name)
        })
    }

    /// Number of meshes that are refused, by themselves or in comparisons.
    pub fn count(&self) -> usize {
        lock(&self.meshes).values().filter(|entry| entry.strikes.is_refused(true)).count()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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

    #[test]
    fn servers_learn_of_each_others_strikes() {
        let [a, b, c] = [(); 3].map(|()| Quarantine::default());
        let evil = [mesh("evil")];
        assert_eq!(a.strike(&evil)[0].1, 1);
        for strikes in a.take_untold() {
            assert_eq!(b.add(strikes).alone, 1);
        }
        assert_eq!((b.strike(&evil)[0].1, b.count()), (2, 1), "the second one of both");
        // One that asks in this moment, and asks again, counts each once, although it also hears of them.
        for _ in 0..2 {
            b.told().into_iter().for_each(|strikes| c.learn(strikes));
        }
        assert_eq!((c.told()[0].alone, c.holds(&evil), a.count()), (1, None, 0));
        for strikes in b.take_untold() {
            a.add(strikes);
            c.add(strikes);
        }
        b.told().into_iter().for_each(|strikes| c.learn(strikes));
        assert_eq!((c.holds(&evil), c.take_untold()), (Some(Digest::of(b"evil")), Vec::new()));
        assert_eq!((a.count(), a.told(), c.told()), (1, b.told(), b.told()));
    }
}
