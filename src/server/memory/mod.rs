//! The memory of the process, in bytes: one budget that jobs, uploads, stored meshes, caches, results and unsent answers
//! draw from, each on an account of its own.
//!
//! A part is kept for jobs: the other accounts together are granted no more than the rest, so that a job finds memory
//! once the running jobs have ended. Where the process lacks memory, caches shrink before a request for it is
//! refused. What exists already, such as an answer, is counted even beyond these limits.
//!
//! Invariant: the lock is held for sums alone. Nothing waits for memory while it holds a lock; a job that waits for
//! memory holds none.

mod job;
mod share;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

pub use job::JobMemory;
pub use share::{Counted, Keeping, MemoryShare, counted};

/// Uses of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Account {
    /// Work that a worker does.
    Jobs,
    /// Bodies of requests, from reading to the end of their jobs.
    Uploads,
    /// Stored meshes.
    Meshes,
    /// Results that can be fetched.
    Results,
    /// Stored meshes as they are drawn; a cache.
    Residents,
    /// Pictures of stored meshes; a cache.
    Pictures,
    /// Answers that are being sent and are kept nowhere.
    Answers,
}

/// Attempts to make room for one request of memory. Others may take what was freed.
const ATTEMPTS: usize = 8;

impl Account {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 7] =
        [Self::Jobs, Self::Uploads, Self::Meshes, Self::Results, Self::Residents, Self::Pictures, Self::Answers];

    /// Its name in metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Jobs => "jobs",
            Self::Uploads => "uploads",
            Self::Meshes => "meshes",
            Self::Results => "results",
            Self::Residents => "residents",
            Self::Pictures => "pictures",
            Self::Answers => "answers",
        }
    }

    /// The setting that raises its cap.
    pub fn flag(self) -> &'static str {
        match self {
            Self::Uploads => "--uploads-bytes",
            Self::Meshes => "--mesh-bytes",
            Self::Results => "--result-bytes",
            Self::Residents => "--resident-bytes",
            Self::Pictures => "--picture-bytes",
            Self::Jobs | Self::Answers => "--memory-bytes",
        }
    }

    fn is_cache(self) -> bool {
        matches!(self, Self::Residents | Self::Pictures)
    }
}

/// The refusal of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MemoryFull {
    /// The account has all that it may have.
    #[error("{} in progress hold {limit} bytes of memory, which is all there is for them; try again shortly", .account.name())]
    Account {
        /// The account.
        account: Account,
        /// Its cap in bytes.
        limit: u64,
    },
    /// The process has all that it may have.
    #[error("the server's memory ({limit} bytes) is in use; try again shortly")]
    Process {
        /// The budget in bytes.
        limit: u64,
    },
}

/// The caps of a process.
#[derive(Clone, Debug)]
pub struct MemoryLimits {
    /// Bytes of all accounts together.
    pub all: u64,
    /// Bytes that only jobs use, and the most that one job may take.
    pub job: u64,
    /// Bytes of single accounts. Those that are not named have no cap of their own.
    pub accounts: Vec<(Account, u64)>,
}

/// Frees about so many bytes of a cache.
type Shrink = Box<dyn Fn(u64) + Send + Sync>;

/// The budget.
pub struct Memory {
    all: u64,
    job: u64,
    caps: [u64; Account::ALL.len()],
    state: Mutex<State>,
    /// The caches that make room, in the order in which they do.
    caches: RwLock<Vec<(Account, Shrink)>>,
}

#[derive(Default)]
struct State {
    used: [u64; Account::ALL.len()],
    refusals: [u64; Account::ALL.len()],
}

/// The reason why memory is not there at this moment.
enum Shortage {
    Account,
    Process(u64),
}

impl std::fmt::Debug for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Memory").field("all", &self.all).finish_non_exhaustive()
    }
}

impl Memory {
    /// A budget.
    pub fn new(limits: &MemoryLimits) -> Arc<Self> {
        let job = limits.job.min(limits.all);
        let mut caps = [limits.all - job; Account::ALL.len()];
        caps[Account::Jobs as usize] = limits.all;
        for &(account, cap) in &limits.accounts {
            let own = &mut caps[account as usize];
            *own = cap.min(*own);
        }
        Arc::new(Self { all: limits.all, job, caps, state: Mutex::default(), caches: RwLock::default() })
    }

    /// For tests: a budget that refuses nothing but what is beyond the cap of an account.
    #[cfg(test)]
    pub fn unlimited(accounts: &[(Account, u64)]) -> Arc<Self> {
        Self::new(&MemoryLimits { all: u64::MAX / 2, job: u64::MAX / 4, accounts: accounts.to_vec() })
    }

    /// An empty share of an account.
    pub fn share(self: &Arc<Self>, account: Account) -> MemoryShare {
        MemoryShare::new(self.clone(), account)
    }

    /// From now on, a cache makes room after those that were named before: `shrink` frees about so many bytes. It must
    /// take no lock that is held while memory is asked for.
    pub fn shrinks(&self, account: Account, shrink: impl Fn(u64) + Send + Sync + 'static) {
        self.caches.write().unwrap_or_else(PoisonError::into_inner).push((account, Box::new(shrink)));
    }

    /// Bytes of an account.
    pub fn used(&self, account: Account) -> u64 {
        self.lock().used[account as usize]
    }

    /// Bytes of all accounts.
    pub fn used_in_all(&self) -> u64 {
        self.lock().sum()
    }

    /// Most bytes of all accounts.
    pub fn limit(&self) -> u64 {
        self.all
    }

    /// Most bytes of an account.
    pub fn cap(&self, account: Account) -> u64 {
        self.caps[account as usize]
    }

    /// Most bytes of one job.
    pub fn job_max(&self) -> u64 {
        self.job
    }

    /// Number of times that an account was refused bytes since the start. While the number grows, a client that holds
    /// memory and sends nothing is cut off.
    pub fn refusals(&self, account: Account) -> u64 {
        self.lock().refusals[account as usize]
    }

    /// True if a job of so many bytes could run once the running ones have ended and the caches are empty.
    pub fn could_run(&self, bytes: u64) -> bool {
        let state = self.lock();
        let of = |account: Account| state.used[account as usize];
        let stays = state.sum() - of(Account::Jobs) - of(Account::Residents) - of(Account::Pictures);
        stays.saturating_add(bytes) <= self.all
    }

    /// Takes bytes. Caches make room first.
    fn acquire(&self, account: Account, bytes: u64) -> Result<(), MemoryFull> {
        for _ in 0..ATTEMPTS {
            match self.try_acquire(account, bytes) {
                Ok(()) => return Ok(()),
                Err(Shortage::Account) => {
                    return Err(self.refuse(account, MemoryFull::Account { account, limit: self.cap(account) }));
                }
                Err(Shortage::Process(missing)) if self.make_room(account, missing) => {}
                Err(Shortage::Process(_)) => break,
            }
        }
        Err(self.refuse(account, MemoryFull::Process { limit: self.all }))
    }

    fn refuse(&self, account: Account, refusal: MemoryFull) -> MemoryFull {
        self.lock().refusals[account as usize] += 1;
        refusal
    }

    /// Takes bytes if they are there at this moment.
    fn try_acquire(&self, account: Account, bytes: u64) -> Result<(), Shortage> {
        let mut state = self.lock();
        let used = state.used[account as usize];
        if used.checked_add(bytes).is_none_or(|sum| sum > self.cap(account)) {
            return Err(Shortage::Account);
        }
        let mut beyond = state.sum().saturating_add(bytes).saturating_sub(self.all);
        if account != Account::Jobs {
            let others = state.sum() - state.used[Account::Jobs as usize];
            beyond = beyond.max(others.saturating_add(bytes).saturating_sub(self.all - self.job));
        }
        if beyond > 0 {
            return Err(Shortage::Process(beyond));
        }
        state.used[account as usize] += bytes;
        Ok(())
    }

    /// Lets caches drop what they have; a cache that grows makes room for itself. False if that frees nothing.
    pub fn make_room(&self, account: Account, bytes: u64) -> bool {
        let before = self.used_in_all();
        let caches = self.caches.read().unwrap_or_else(PoisonError::into_inner);
        for (cache, shrink) in caches.iter().filter(|(cache, _)| !account.is_cache() || *cache == account) {
            let freed = before.saturating_sub(self.used_in_all());
            if freed >= bytes {
                break;
            }
            if self.used(*cache) > 0 {
                shrink(bytes - freed);
            }
        }
        self.used_in_all() < before
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn sum(&self) -> u64 {
        self.used.iter().fold(0, |sum, used| sum.saturating_add(*used))
    }
}
