//! The memory of one running job: what it has borrowed from the budget of the process, and the most that it held. A
//! job that asks for more than one job may take fails for good. If others have what it asks for, its worker gives all
//! of the memory back and queues the job again, so that no job waits for memory while it holds some.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::MemoryShare;
use meshsnap_render::limits::Lend;

/// The share of a job, which grows as the job spends. A job that finds no more gives all of it back, and is begun again
/// when there is as much as a job may take: so no job waits for memory while it holds some.
#[derive(Debug)]
pub struct JobMemory {
    share: MemoryShare,
    most: u64,
    peak: AtomicU64,
    /// Bytes that it asked for in vain; 0: none.
    refused: AtomicU64,
}

impl JobMemory {
    /// The memory of a job that has `share` to begin with.
    pub fn new(share: MemoryShare, most: u64) -> Arc<Self> {
        Arc::new(Self { share, most, peak: AtomicU64::new(0), refused: AtomicU64::new(0) })
    }

    /// The most that it held, as far as it said.
    pub fn peak(&self) -> u64 {
        self.peak.load(Ordering::Relaxed)
    }

    /// True if others had what it asked for.
    pub fn was_refused(&self) -> bool {
        self.refused.load(Ordering::Relaxed) > 0
    }

    /// Gives everything back.
    pub fn release(&self) {
        self.share.shrink_to(0);
    }
}

impl Lend for JobMemory {
    fn lend(&self, bytes: u64) -> Result<(), u64> {
        if bytes > self.most {
            return Err(self.most);
        }
        // Most jobs stay within what they began with.
        if self.peak.fetch_max(bytes, Ordering::Relaxed) >= bytes {
            return Ok(());
        }
        let more = bytes.saturating_sub(self.share.bytes());
        if more > 0 && self.share.grow(more).is_err() {
            self.refused.store(bytes, Ordering::Relaxed);
            return Err(self.most);
        }
        Ok(())
    }

    fn restart(&self) {
        self.peak.store(0, Ordering::Relaxed);
        self.release();
    }
}
