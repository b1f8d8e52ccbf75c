//! Shares of the memory budget. A share counts the bytes of something on one account (uploads, results, answers ...) and
//! is kept beside these bytes. When it is dropped, the memory is free again.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

use super::{Account, Memory, MemoryFull};

/// A part of an account. It is kept beside the bytes that it accounts for.
#[derive(Debug)]
pub struct MemoryShare {
    memory: Arc<Memory>,
    held: Mutex<Held>,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    account: Account,
    bytes: u64,
}

impl MemoryShare {
    pub(super) fn new(memory: Arc<Memory>, account: Account) -> Self {
        Self { memory, held: Mutex::new(Held { account, bytes: 0 }) }
    }

    /// Its bytes.
    pub fn bytes(&self) -> u64 {
        self.lock().bytes
    }

    /// Takes `bytes` more. If there are fewer left, takes nothing.
    pub fn grow(&self, bytes: u64) -> Result<(), MemoryFull> {
        // Caches may make room meanwhile, so that its own lock is not held.
        let account = self.lock().account;
        self.memory.acquire(account, bytes)?;
        self.add(account, bytes);
        Ok(())
    }

    /// As [`MemoryShare::grow`], without letting caches make room. The error is what the process lacks;
    /// None: the account has all that it may have.
    pub fn grow_now(&self, bytes: u64) -> Result<(), Option<u64>> {
        let account = self.lock().account;
        match self.memory.try_acquire(account, bytes) {
            Ok(()) => {
                self.add(account, bytes);
                Ok(())
            }
            Err(super::Shortage::Process(missing)) => Err(Some(missing)),
            Err(super::Shortage::Account) => Err(None),
        }
    }

    /// Takes `bytes` more, even beyond the cap: what exists already, or was accepted before a restart, is not refused.
    pub fn take(&self, bytes: u64) {
        let mut held = self.lock();
        let used = &mut self.memory.lock().used[held.account as usize];
        *used = used.saturating_add(bytes);
        held.bytes += bytes;
    }

    /// Gives back what is more than `bytes`.
    pub fn shrink_to(&self, bytes: u64) {
        let mut held = self.lock();
        let more = held.bytes.saturating_sub(bytes);
        self.memory.lock().give(held.account, more);
        held.bytes -= more;
    }

    /// Hands a part over, at most all of it.
    #[must_use]
    pub fn split(&self, bytes: u64) -> Self {
        let mut held = self.lock();
        let bytes = bytes.min(held.bytes);
        held.bytes -= bytes;
        Self { memory: self.memory.clone(), held: Mutex::new(Held { account: held.account, bytes }) }
    }

    /// Counts on another account from now on, even beyond its cap.
    pub fn move_to(&self, account: Account) {
        let mut held = self.lock();
        let mut state = self.memory.lock();
        state.give(held.account, held.bytes);
        state.used[account as usize] += held.bytes;
        held.account = account;
    }

    fn add(&self, account: Account, bytes: u64) {
        let mut held = self.lock();
        held.bytes += bytes;
        if held.account != account {
            // It was moved meanwhile.
            let mut state = self.memory.lock();
            state.give(account, bytes);
            state.used[held.account as usize] += bytes;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl super::State {
    fn give(&mut self, account: Account, bytes: u64) {
        let used = &mut self.used[account as usize];
        *used = used.saturating_sub(bytes);
    }
}

impl Drop for MemoryShare {
    fn drop(&mut self) {
        let held = *self.held.get_mut().unwrap_or_else(PoisonError::into_inner);
        self.memory.lock().give(held.account, held.bytes);
    }
}

/// The owner of bytes, with their share: it counts until the last clone of the bytes is dropped, in an answer that is
/// being sent, too.
#[derive(Debug)]
pub struct Counted {
    bytes: Bytes,
    _share: Arc<MemoryShare>,
}

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// Bytes that exist already, counted as answers until something keeps them ([`Keeping`]).
pub fn counted(memory: &Arc<Memory>, bytes: Bytes) -> (Bytes, Arc<MemoryShare>) {
    let share = Arc::new(memory.share(Account::Answers));
    share.take(bytes.len() as u64);
    (Bytes::from_owner(Counted { bytes, _share: share.clone() }), share)
}

/// A share that counts on the account of its keeper, and as an answer again once this is dropped.
#[derive(Debug)]
pub struct Keeping(Arc<MemoryShare>);

impl Keeping {
    /// Moves a share to the account of its keeper.
    pub fn new(share: Arc<MemoryShare>, account: Account) -> Self {
        share.move_to(account);
        Self(share)
    }
}

impl Drop for Keeping {
    fn drop(&mut self) {
        self.0.move_to(Account::Answers);
    }
}
