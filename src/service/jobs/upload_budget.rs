//! A cap on bytes held by several owners together: one for the uploads of all requests, from
//! reading to drawing, and one for all stored meshes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A shared cap on bytes in memory.
#[derive(Debug)]
pub struct UploadBudget {
    used: AtomicU64,
    limit: u64,
    /// How often it refused bytes.
    refusals: AtomicU64,
}

/// The error when other uploads hold all the memory for uploads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("uploads in progress hold {limit} bytes of memory, which is all there is for them; try again shortly")]
pub struct UploadBudgetFull {
    /// The cap in bytes.
    pub limit: u64,
}

/// A share of an [`UploadBudget`], given back when dropped. It is kept beside the bytes that it
/// accounts for.
#[derive(Debug)]
pub struct Reservation {
    budget: Arc<UploadBudget>,
    bytes: u64,
}

impl UploadBudget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Arc<Self> {
        Arc::new(Self { used: AtomicU64::new(0), limit, refusals: AtomicU64::new(0) })
    }

    /// An empty share, which grows as bytes arrive.
    pub fn reserve(self: &Arc<Self>) -> Reservation {
        Reservation { budget: self.clone(), bytes: 0 }
    }

    /// How often it refused bytes since the start. A client that holds some and sends nothing makes room when the
    /// number grows.
    pub fn refusals(&self) -> u64 {
        self.refusals.load(Ordering::Relaxed)
    }

    /// Most bytes.
    pub fn limit_bytes(&self) -> u64 {
        self.limit
    }

    /// Bytes reserved at this moment.
    pub fn used_bytes(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }
}

impl Reservation {
    /// Takes `bytes` more. If there are fewer left, takes nothing.
    pub fn grow(&mut self, bytes: u64) -> Result<(), UploadBudgetFull> {
        let limit = self.budget.limit;
        let grown = |used: u64| used.checked_add(bytes).filter(|&sum| sum <= limit);
        self.budget.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, grown).map_err(|_| {
            self.budget.refusals.fetch_add(1, Ordering::Relaxed);
            UploadBudgetFull { limit }
        })?;
        self.bytes += bytes;
        Ok(())
    }
}

impl Reservation {
    /// Hands a part over, at most all of it.
    #[must_use]
    pub fn split(&mut self, bytes: u64) -> Self {
        let bytes = bytes.min(self.bytes);
        self.bytes -= bytes;
        Self { budget: self.budget.clone(), bytes }
    }

    /// Takes `bytes` more, even beyond the cap: what was accepted before a restart is not refused after it.
    pub fn take(&mut self, bytes: u64) {
        self.budget.used.fetch_add(bytes, Ordering::Relaxed);
        self.bytes += bytes;
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.budget.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_comes_back() {
        let budget = UploadBudget::new(100);
        let mut first = budget.reserve();
        first.grow(60).unwrap();
        let mut second = budget.reserve();
        assert_eq!(second.grow(41), Err(UploadBudgetFull { limit: 100 }));
        second.grow(40).unwrap();
        assert_eq!(second.grow(u64::MAX), Err(UploadBudgetFull { limit: 100 }));
        assert_eq!(budget.used_bytes(), 100);
        drop(first);
        assert_eq!(budget.used_bytes(), 40);
        let (part, rest) = (second.split(30), second.split(u64::MAX));
        drop(second);
        assert_eq!((budget.used_bytes(), part.bytes, rest.bytes), (40, 30, 10));
        drop(part);
        assert_eq!(budget.used_bytes(), 10);
        drop(rest);
        assert_eq!(budget.used_bytes(), 0);
    }
}
