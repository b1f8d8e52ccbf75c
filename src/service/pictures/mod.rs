//! Pictures of stored meshes that were drawn before, kept in memory under their render keys. Requests
//! for a picture that is being drawn wait for it.

#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::service::cache::{ByteCache, Weighed, with_room_for};
use crate::service::jobs::Finished;

/// Bytes of a picture on an average, to size tables.
const TYPICAL_BYTES: u64 = 32 << 10;

/// Bytes that a picture takes beside its own.
const OVERHEAD_BYTES: u64 = 1024;

/// The pictures. One cap holds for the bytes of all.
#[derive(Debug)]
pub struct Pictures {
    cache: ByteCache<Kept>,
    bytes: u64,
}

/// A picture, and where it came from.
#[derive(Clone, Debug)]
pub struct Found {
    /// The picture.
    pub finished: Arc<Finished>,
    /// Where it came from.
    pub source: Source,
    /// The time since it was drawn.
    pub age: Duration,
}

/// Where a picture came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// It was in memory.
    Hit,
    /// It was drawn for this request.
    Miss,
    /// It was drawn for another request, for which this one waited.
    Coalesced,
}

/// The content of [`Pictures`] at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureLoad {
    /// Number of pictures.
    pub count: usize,
    /// Their bytes.
    pub bytes: u64,
}

#[derive(Clone, Debug)]
struct Kept {
    finished: Arc<Finished>,
    drawn: Instant,
}

impl Weighed for Kept {
    fn bytes(&self) -> u64 {
        self.finished.picture.len() as u64 + OVERHEAD_BYTES
    }
}

impl Pictures {
    /// Room for pictures of so many bytes together. None are kept, and none are waited for, if it is 0.
    pub fn new(bytes: u64) -> Self {
        Self { cache: with_room_for(bytes, TYPICAL_BYTES), bytes }
    }

    /// The picture of this key, drawn by `draw` if it is not in memory. Requests for the same picture
    /// wait for the first. If that one fails or its client hangs up, the next one draws.
    pub async fn find<E>(&self, key: &str, draw: impl Future<Output = Result<Arc<Finished>, E>>) -> Result<Found, E> {
        if self.bytes == 0 {
            return Ok(Found { finished: draw.await?, source: Source::Miss, age: Duration::ZERO });
        }
        if let Some(kept) = self.cache.get(key) {
            return Ok(kept.found(Source::Hit));
        }
        match self.cache.get_value_or_guard_async(key).await {
            Ok(kept) => Ok(kept.found(Source::Coalesced)),
            Err(guard) => {
                let kept = Kept { finished: draw.await?, drawn: Instant::now() };
                let found = kept.found(Source::Miss);
                // An error says that it was removed in the meantime.
                let _ = guard.insert(kept);
                Ok(found)
            }
        }
    }

    /// Most bytes.
    pub fn limit_bytes(&self) -> u64 {
        self.bytes
    }

    /// The content at this moment.
    pub fn load(&self) -> PictureLoad {
        PictureLoad { count: self.cache.len(), bytes: self.cache.weight() }
    }
}

impl Source {
    /// The word in the header `X-Cache`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hit => "hit",
            Self::Miss => "miss",
            Self::Coalesced => "coalesced",
        }
    }
}

impl Kept {
    fn found(&self, source: Source) -> Found {
        Found { finished: Arc::clone(&self.finished), source, age: self.drawn.elapsed() }
    }
}
