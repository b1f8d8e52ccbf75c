//! The cache of answers in memory: pictures of stored meshes, verdicts and differences. The key of an answer is a
//! digest of all that decides it (mostly it is the `ETag`, too). Where the same answer is already being made for
//! another request, a request waits for it.

#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::cache::{ByteCache, Weighed, shrink_for, with_room_for};
use crate::jobs::Finished;
use crate::memory::{Account, Keeping, Memory};
use meshsnap_render::warning::Warning;

/// Bytes of a picture on an average, to size tables.
const TYPICAL_BYTES: u64 = 32 << 10;

/// Bytes that a picture takes beside its own.
const OVERHEAD_BYTES: u64 = 1024;

/// The time for which a picture is used. It is that of `Cache-Control`, so that no answer is stale when it
/// is given.
const KEPT_FOR: Duration = Duration::from_secs(24 * 3600);

/// The pictures. One cap holds for the bytes of all.
#[derive(Debug)]
pub struct Pictures {
    cache: Arc<ByteCache<Kept>>,
    /// By key, what tells the others of a picture that is being drawn.
    drawing: Mutex<HashMap<String, watch::Sender<Option<Kept>>>>,
    bytes: u64,
}

/// A picture and its origin.
#[derive(Clone, Debug)]
pub struct FoundPicture {
    /// The picture.
    pub finished: Arc<Finished>,
    /// Its origin.
    pub source: Source,
    /// The time since it was drawn.
    pub age: Duration,
}

/// The origin of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// It was in memory.
    Hit,
    /// It was drawn for this request.
    Miss,
    /// It was drawn for another request, for which this one waited.
    Coalesced,
    /// It was in the store that several daemons share.
    Shared,
}

/// The content of [`Pictures`] at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureLoad {
    /// Number of pictures.
    pub count: usize,
    /// Their bytes.
    pub bytes: u64,
}

/// The place of a request among those for the same picture.
enum Joined<'a> {
    Kept(Kept),
    First(First<'a>),
    Second(watch::Receiver<Option<Kept>>),
}

/// The request that draws. When it is dropped, the others hear of its end.
struct First<'a> {
    pictures: &'a Pictures,
    key: &'a str,
}

#[derive(Clone, Debug)]
struct Kept {
    finished: Arc<Finished>,
    drawn: Instant,
    /// Counts its bytes as those of a picture that is kept.
    memory: Option<Arc<Keeping>>,
}

impl Weighed for Kept {
    fn bytes(&self) -> u64 {
        let warnings: usize = self.finished.warnings.iter().map(Warning::bytes).sum();
        (self.finished.content.len() + warnings) as u64 + OVERHEAD_BYTES
    }
}

impl Pictures {
    /// Room for pictures of so many bytes together. None are kept if it is 0.
    pub fn new(bytes: u64, memory: &Memory) -> Self {
        let cache = Arc::new(with_room_for(bytes, TYPICAL_BYTES));
        shrink_for(memory, Account::Pictures, &cache);
        Self { cache, drawing: Mutex::default(), bytes }
    }

    /// The picture of this key, from `make` if it is not in memory. Requests for the same picture
    /// wait for the first. If that one fails or its client hangs up, each of the others draws for itself:
    /// none waits longer than for one drawing.
    pub async fn find<E>(
        &self,
        key: &str,
        make: impl Future<Output = Result<(Arc<Finished>, Source), E>>,
    ) -> Result<FoundPicture, E> {
        match self.join(key) {
            Joined::Kept(kept) => Ok(kept.found(Source::Hit)),
            Joined::Second(mut first) => {
                if let Ok(kept) = first.wait_for(Option::is_some).await
                    && let Some(kept) = kept.as_ref()
                {
                    return Ok(kept.found(Source::Coalesced));
                }
                let (finished, source) = make.await?;
                Ok(Kept::new(finished).found(source))
            }
            Joined::First(first) => {
                let (finished, source) = make.await?;
                let mut kept = Kept::new(finished);
                // Another picture is due when the GPU is back.
                if !kept.finished.is_substitute {
                    kept.memory = kept.finished.kept_on(Account::Pictures).map(Arc::new);
                    self.cache.insert(key.to_owned(), kept.clone());
                }
                Ok(first.tell(kept).found(source))
            }
        }
    }

    fn join<'a>(&'a self, key: &'a str) -> Joined<'a> {
        if let Some(kept) = self.known(key) {
            return Joined::Kept(kept);
        }
        let mut drawing = self.locked();
        if let Some(first) = drawing.get(key) {
            return Joined::Second(first.subscribe());
        }
        // The first may have ended between the two looks.
        if let Some(kept) = self.known(key) {
            return Joined::Kept(kept);
        }
        drawing.insert(key.to_owned(), watch::Sender::new(None));
        Joined::First(First { pictures: self, key })
    }

    /// The picture in memory, unless it is too old.
    fn known(&self, key: &str) -> Option<Kept> {
        self.cache.get(key).filter(|kept| kept.drawn.elapsed() < KEPT_FOR)
    }

    fn locked(&self) -> MutexGuard<'_, HashMap<String, watch::Sender<Option<Kept>>>> {
        self.drawing.lock().unwrap_or_else(PoisonError::into_inner)
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
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Hit, Self::Miss, Self::Coalesced, Self::Shared];

    /// The word in the header `X-Cache`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hit => "hit",
            Self::Miss => "miss",
            Self::Coalesced => "coalesced",
            Self::Shared => "shared",
        }
    }
}

impl First<'_> {
    /// Gives the picture to those who wait.
    fn tell(self, kept: Kept) -> Kept {
        if let Some(others) = self.pictures.locked().get(self.key) {
            others.send_replace(Some(kept.clone()));
        }
        kept
    }
}

impl Drop for First<'_> {
    fn drop(&mut self) {
        self.pictures.locked().remove(self.key);
    }
}

impl Kept {
    fn new(finished: Arc<Finished>) -> Self {
        Self { finished, drawn: Instant::now(), memory: None }
    }

    fn found(&self, source: Source) -> FoundPicture {
        FoundPicture { finished: Arc::clone(&self.finished), source, age: self.drawn.elapsed() }
    }
}
