//! Bytes of uploads that are being read, wait or are being drawn, over all requests together.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The cap on uploads in memory at once.
#[derive(Debug)]
pub struct UploadBudget {
    used: AtomicU64,
    limit: u64,
}

/// Other uploads have taken all the memory there is for uploads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("uploads in progress hold {limit} bytes of memory, which is all there is for them; try again shortly")]
pub struct UploadBudgetFull {
    /// How many bytes there are.
    pub limit: u64,
}

/// A share of [`UploadBudget`], given back when dropped. Travels with the bytes that it stands for.
#[derive(Debug)]
pub struct Reservation {
    bodies: Arc<UploadBudget>,
    bytes: u64,
}

impl UploadBudget {
    /// Room for `limit` bytes.
    pub fn new(limit: u64) -> Arc<Self> {
        Arc::new(Self { used: AtomicU64::new(0), limit })
    }

    /// A share of nothing, to grow as bytes arrive.
    pub fn reserve(self: &Arc<Self>) -> Reservation {
        Reservation { bodies: self.clone(), bytes: 0 }
    }

    /// Bytes held now.
    pub fn used_bytes(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }
}

impl Reservation {
    /// Takes `bytes` more, or nothing.
    pub fn grow(&mut self, bytes: u64) -> Result<(), UploadBudgetFull> {
        let limit = self.bodies.limit;
        let grown = |used: u64| used.checked_add(bytes).filter(|&sum| sum <= limit);
        self.bodies
            .used
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, grown)
            .map_err(|_| UploadBudgetFull { limit })?;
        self.bytes += bytes;
        Ok(())
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.bodies.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_comes_back() {
        let bodies = UploadBudget::new(100);
        let mut first = bodies.reserve();
        first.grow(60).unwrap();
        let mut second = bodies.reserve();
        assert_eq!(second.grow(41), Err(UploadBudgetFull { limit: 100 }));
        second.grow(40).unwrap();
        assert_eq!(second.grow(u64::MAX), Err(UploadBudgetFull { limit: 100 }));
        assert_eq!(bodies.used_bytes(), 100);
        drop(first);
        assert_eq!(bodies.used_bytes(), 40);
        drop(second);
        assert_eq!(bodies.used_bytes(), 0);
    }
}
