//! The jobs that have ended and can still be found, by the time at which they expire.
//!
//! A result that was not fetched stays for `unfetched_ttl`, a fetched one for `result_ttl`. If there are too many
//! results, or too many bytes of them, some go sooner: first those that were fetched, then the oldest of the owner
//! that has the most. The last one stays, however large.

use std::collections::{BTreeMap, HashMap};
use std::time::{Duration, Instant};

use super::JobSettings;
use super::class::Owner;
use super::job::{Job, JobId, JobState};
use crate::memory::{Account, Keeping};

/// The ended jobs, by the time at which they expire.
#[derive(Default)]
pub struct Results {
    by_expiry: BTreeMap<(Instant, u64), EndedJob>,
    places: HashMap<JobId, (Instant, u64)>,
    bytes: u64,
    serial: u64,
    /// What each owner has: bytes and number.
    shares: HashMap<Owner, (u64, usize)>,
}

struct EndedJob {
    id: JobId,
    owner: Owner,
    bytes: u64,
    is_fetched: bool,
    /// Counts its bytes as those of a result.
    _memory: Option<Keeping>,
}

impl Results {
    /// Adds a job that has ended in this state.
    pub fn add(&mut self, job: &Job, state: &JobState, is_fetched: bool, settings: &JobSettings) {
        let (bytes, memory) = match state {
            JobState::Done(finished) => (finished.content.len() as u64, finished.kept_on(Account::Results)),
            _ => (0, None),
        };
        self.bytes += bytes;
        let (id, owner) = (job.id, job.owner.clone());
        let share = self.shares.entry(owner.clone()).or_default();
        *share = (share.0 + bytes, share.1 + 1);
        self.insert(EndedJob { id, owner, bytes, is_fetched, _memory: memory }, settings);
    }

    /// A client has fetched a result. True if it was the first time.
    pub fn fetch(&mut self, id: JobId, settings: &JobSettings) -> bool {
        let ended = self.places.get(&id).copied().and_then(|place| self.by_expiry.remove(&place));
        let Some(ended) = ended else { return false };
        let is_first = !ended.is_fetched;
        if is_first {
            self.insert(EndedJob { is_fetched: true, ..ended }, settings);
        } else if let Some(&place) = self.places.get(&id) {
            self.by_expiry.insert(place, ended);
        }
        is_first
    }

    /// Removes one.
    pub fn forget(&mut self, id: JobId) -> Option<JobId> {
        let place = self.places.get(&id).copied()?;
        self.remove(place)
    }

    /// Removes what has expired, and then what is too much: first what was fetched, then the oldest of the owner
    /// that has the most, so that nobody's results make room for another's. The last one stays, however large.
    pub fn evict(&mut self, settings: &JobSettings) -> Vec<JobId> {
        let now = Instant::now();
        let mut evicted = Vec::new();
        while let Some((&place, _)) = self.by_expiry.first_key_value().filter(|((expiry, _), _)| *expiry <= now) {
            evicted.extend(self.remove(place));
        }
        while self.by_expiry.len() > 1
            && (self.bytes > settings.result_bytes || self.by_expiry.len() > settings.result_count)
        {
            let is_large = self.bytes > settings.result_bytes;
            let amount = |(bytes, count): &(u64, usize)| if is_large { *bytes } else { *count as u64 };
            let owner = self.shares.iter().max_by_key(|(_, share)| amount(share)).map(|(owner, _)| owner.clone());
            let fetched = self.by_expiry.iter().find(|(_, ended)| ended.is_fetched);
            let oldest = || self.by_expiry.iter().find(|(_, ended)| Some(&ended.owner) == owner.as_ref());
            let Some(place) = fetched.or_else(oldest).map(|(&place, _)| place) else { break };
            evicted.extend(self.remove(place));
        }
        evicted
    }

    /// The time at which the next one expires.
    pub fn next_expiry(&self) -> Option<Instant> {
        self.by_expiry.first_key_value().map(|((expiry, _), _)| *expiry)
    }

    /// Number of jobs.
    pub fn count(&self) -> usize {
        self.by_expiry.len()
    }

    /// Bytes of their results.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    fn insert(&mut self, ended: EndedJob, settings: &JobSettings) {
        let time = if ended.is_fetched { settings.result_ttl } else { settings.unfetched_ttl };
        let now = Instant::now();
        self.serial += 1;
        let place = (now.checked_add(time).unwrap_or(now + Duration::from_secs(86_400)), self.serial);
        self.places.insert(ended.id, place);
        self.by_expiry.insert(place, ended);
    }

    fn remove(&mut self, place: (Instant, u64)) -> Option<JobId> {
        let ended = self.by_expiry.remove(&place)?;
        self.places.remove(&ended.id);
        self.bytes -= ended.bytes;
        if let Some(share) = self.shares.get_mut(&ended.owner) {
            *share = (share.0.saturating_sub(ended.bytes), share.1.saturating_sub(1));
            if share.1 == 0 {
                self.shares.remove(&ended.owner);
            }
        }
        Some(ended.id)
    }
}
