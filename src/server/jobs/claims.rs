//! Names that clients give their requests (`Idempotency-Key`): a request that is sent again under
//! its name makes no second job.
//!
//! A claim is such a name while it stands for a request and the request's job. It ends when the
//! request is refused, or when the job can no longer be found, so that claims do not pile up.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use super::class::Owner;
use crate::digest::Digest;
use crate::durable::JobKey;

/// A name, and the party that gave it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ClaimName {
    /// The party.
    pub owner: Owner,
    /// The name.
    pub key: Arc<str>,
}

/// The claims that exist.
#[derive(Debug, Default)]
pub struct Claims(Mutex<HashMap<ClaimName, Weak<Claim>>>);

/// A name that stands for one request and its job. It is free again when this is dropped.
pub struct Claim {
    /// The name.
    pub name: ClaimName,
    /// The digest of the request.
    pub request: Digest,
    /// The job, once it is accepted.
    job: OnceLock<JobKey>,
    claims: Arc<Claims>,
}

/// The meaning of a name.
#[derive(Debug)]
pub enum Claimed {
    /// Nothing until now: it stands for this request.
    New(Arc<Claim>),
    /// The same request, whose job is this.
    Job(JobKey, Arc<Claim>),
    /// The same request, which is not accepted yet.
    Pending,
    /// Another request.
    Other,
}

impl Claims {
    /// Lets a name stand for a request, unless it stands for one.
    pub fn claim(self: &Arc<Self>, name: &ClaimName, request: Digest) -> Claimed {
        let mut claims = self.lock();
        // What is found is handed out, so that it is not dropped under the lock, which it would take.
        match claims.get(name).and_then(Weak::upgrade) {
            None => Claimed::New(self.insert(&mut claims, name, request)),
            Some(found) if found.request != request => Claimed::Other.dropping(found, claims),
            Some(found) => match found.job.get().copied() {
                Some(job) => Claimed::Job(job, found),
                None => Claimed::Pending.dropping(found, claims),
            },
        }
    }

    /// True if the name stands for a request.
    pub fn has(&self, name: &ClaimName) -> bool {
        self.lock().get(name).is_some_and(|claim| claim.strong_count() > 0)
    }

    /// Lets go of a claim whose job is gone, although somebody holds it still.
    pub fn free(&self, gone: &Arc<Claim>) {
        let mut claims = self.lock();
        if claims.get(&gone.name).is_some_and(|claim| std::ptr::eq(claim.as_ptr(), Arc::as_ptr(gone))) {
            claims.remove(&gone.name);
        }
    }

    fn insert(
        self: &Arc<Self>,
        claims: &mut HashMap<ClaimName, Weak<Claim>>,
        name: &ClaimName,
        request: Digest,
    ) -> Arc<Claim> {
        let claim = Arc::new(Claim { name: name.clone(), request, job: OnceLock::new(), claims: self.clone() });
        claims.insert(name.clone(), Arc::downgrade(&claim));
        claim
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<ClaimName, Weak<Claim>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Claimed {
    fn dropping(self, found: Arc<Claim>, lock: MutexGuard<'_, HashMap<ClaimName, Weak<Claim>>>) -> Self {
        drop(lock);
        drop(found);
        self
    }
}

impl Claim {
    /// The job is accepted.
    pub fn set_job(&self, job: JobKey) {
        let _ = self.job.set(job);
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut claims = self.claims.lock();
        // A later claim may have the name by now.
        if claims.get(&self.name).is_some_and(|claim| claim.strong_count() == 0) {
            claims.remove(&self.name);
        }
    }
}

impl fmt::Debug for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Claim").field("name", &self.name).field("job", &self.job).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(owner: &str, key: &str) -> ClaimName {
        ClaimName { owner: Owner::new(owner), key: key.into() }
    }

    #[test]
    fn a_name_stands_for_one_request_of_its_owner_until_it_is_let_go() {
        let claims = Arc::new(Claims::default());
        let [one, two] = [Digest::of(b"1"), Digest::of(b"2")];
        let Claimed::New(first) = claims.claim(&name("a", "k"), one) else { panic!("a new name") };
        assert!(matches!(claims.claim(&name("a", "k"), one), Claimed::Pending));
        assert!(matches!(claims.claim(&name("a", "k"), two), Claimed::Other));
        let Claimed::New(others) = claims.claim(&name("b", "k"), two) else { panic!("another owner's name") };
        first.set_job(7);
        assert!(matches!(claims.claim(&name("a", "k"), one), Claimed::Job(7, _)));
        drop(others);
        assert!(claims.has(&name("a", "k")) && !claims.has(&name("b", "k")));
        // Its job is gone, and a long poll holds it still: the name is free, and the end of the old claim takes
        // nothing from the new one.
        claims.free(&first);
        let Claimed::New(second) = claims.claim(&name("a", "k"), two) else { panic!("a free name") };
        claims.free(&first);
        drop(first);
        assert!(matches!(claims.claim(&name("a", "k"), two), Claimed::Pending));
        drop(second);
        assert!(claims.lock().is_empty(), "{claims:?}");
    }
}
