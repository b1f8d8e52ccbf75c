//! A cache with a limit on the bytes of all its names and values, for answers ([`pictures`](super::pictures)) and for
//! meshes ([`residents`](super::residents)). Where room is short, values that are used least go first: the crate
//! `quick_cache` chooses them, by an algorithm like Clock-PRO.

use std::sync::Arc;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use super::memory::{Account, Memory};

/// A cache by names. What is used least goes first.
pub type ByteCache<V> = Cache<String, V, ByBytes>;

/// A value that is weighed by its bytes.
pub trait Weighed {
    /// Its bytes, always the same.
    fn bytes(&self) -> u64;
}

/// Weighs names and values.
#[derive(Clone, Debug)]
pub struct ByBytes;

impl<V: Weighed> Weighter<String, V> for ByBytes {
    fn weight(&self, name: &String, value: &V) -> u64 {
        name.len() as u64 + value.bytes()
    }
}

/// Lets the cache make room from now on when the process is short of memory.
pub fn shrink_for<V: Weighed + Clone + Send + Sync + 'static>(
    memory: &Memory,
    account: Account,
    cache: &Arc<ByteCache<V>>,
) {
    let cache = Arc::downgrade(cache);
    memory.shrinks(account, move |bytes| {
        let Some(cache) = cache.upgrade() else { return };
        let capacity = cache.capacity();
        cache.set_capacity(cache.weight().saturating_sub(bytes).max(1));
        cache.set_capacity(capacity);
    });
}

/// A cache for `bytes` in all, of values that take `typical_bytes` each on an average.
pub fn with_room_for<V: Weighed + Clone>(bytes: u64, typical_bytes: u64) -> ByteCache<V> {
    let count = usize::try_from(bytes / typical_bytes.max(1)).unwrap_or(usize::MAX).clamp(16, 1 << 16);
    // One shard, so that a single value may take nearly all the room.
    let options = OptionsBuilder::new().shards(1).estimated_items_capacity(count).weight_capacity(bytes.max(1)).build();
    match options {
        Ok(options) => {
            Cache::with_options(options, ByBytes, DefaultHashBuilder::default(), DefaultLifecycle::default())
        }
        Err(_) => Cache::with_weighter(count, bytes.max(1), ByBytes),
    }
}
