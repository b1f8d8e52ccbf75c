//! Buffers that stay on the GPU from picture to picture, because many pictures show the same mesh: its positions,
//! triangles, attributes, textures and edges. A list that fits gets such a buffer when it is asked for a second
//! time. To make room for a new buffer, those whose list is gone are freed first, then those that were used least
//! recently.
//!
//! **Invariant:** a buffer is found only for the very list that it was filled from. Lists are known by their owner,
//! which never changes them, their address and their size. An owner's own address is not used again as long as a weak
//! reference to it is kept here.

use std::any::Any;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::pipelines::Slot;
use crate::plan::{MeshToken, SharedSlice};

/// Lists that were asked for once, by key. The second time they are worth keeping.
const ASKED_ONCE_MAX: usize = 1024;

/// Whatever keeps a list alive and unchanged.
type Owner = dyn Any + Send + Sync;

/// A list that is not changed as long as its owner lives.
#[derive(Clone)]
pub struct Source {
    owner: Weak<Owner>,
    address: usize,
    bytes: u64,
}

impl Source {
    /// A list in an `Arc` that has a holder beside this plan, and so may be drawn again. None if the plan is
    /// its only holder.
    pub fn of_arc<T: Any + Send + Sync>(list: &Arc<T>, bytes: usize) -> Option<Self> {
        let owner: Arc<Owner> = list.clone();
        let is_kept = Arc::strong_count(list) > 2;
        is_kept.then(|| Self { owner: Arc::downgrade(&owner), address: 0, bytes: bytes as u64 })
    }

    /// A list that a plan borrows from its mesh, or shares with something that lives longer.
    pub fn of<T: Any + Send + Sync>(list: &SharedSlice<'_, T>, mesh: Option<&Arc<MeshToken>>) -> Option<Self> {
        let bytes = size_of_val(&list[..]);
        match (list, mesh) {
            (SharedSlice::Owned(list), _) => Self::of_arc(list, bytes),
            (SharedSlice::Borrowed(list), Some(mesh)) => {
                let owner: Arc<Owner> = mesh.clone();
                Some(Self { owner: Arc::downgrade(&owner), address: list.as_ptr() as usize, bytes: bytes as u64 })
            }
            (SharedSlice::Borrowed(_), None) => None,
        }
    }

    /// The list and `bytes` more, which its owner changes as little.
    pub fn followed_by(self, bytes: usize) -> Self {
        Self { bytes: self.bytes + bytes as u64, ..self }
    }

    /// Owner, address and bytes. No other list has them as long as the owner, or this source, lives.
    pub fn identity(&self) -> (usize, usize, u64) {
        (self.owner.as_ptr().cast::<()>() as usize, self.address, self.bytes)
    }

    fn key(&self, slot: Slot) -> Key {
        (slot as u32, self.owner.as_ptr().cast::<()>() as usize, self.address, self.bytes)
    }
}

/// Slot, owner, address and size.
type Key = (u32, usize, usize, u64);

/// The buffers of one device, `B` each.
pub struct ResidentBuffers<B> {
    kept: Mutex<Kept<B>>,
    bytes_max: u64,
}

struct Kept<B> {
    buffers: HashMap<Key, Entry<B>>,
    bytes: u64,
    /// The owners' own addresses are not used again as long as they are here.
    asked_once: VecDeque<(Key, Weak<Owner>)>,
    /// Counts uses.
    now: u64,
}

struct Entry<B> {
    owner: Weak<Owner>,
    buffer: B,
    bytes: u64,
    used: u64,
}

/// The answer for a list.
#[derive(Debug, PartialEq, Eq)]
pub enum ListLookup<B> {
    /// Its buffer.
    Buffer(B),
    /// None yet, and there is to be one.
    Wanted,
    /// None, and it may not be worth one.
    Unwanted,
}

impl<B: Clone> ResidentBuffers<B> {
    /// None so far, and never more than `bytes_max`.
    pub fn new(bytes_max: u64) -> Self {
        let kept = Kept { buffers: HashMap::new(), bytes: 0, asked_once: VecDeque::new(), now: 0 };
        Self { kept: Mutex::new(kept), bytes_max }
    }

    /// The buffer of a list.
    pub fn find(&self, slot: Slot, source: &Source) -> ListLookup<B> {
        let key = source.key(slot);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.now += 1;
        let now = kept.now;
        if let Some(entry) = kept.buffers.get_mut(&key) {
            entry.used = now;
            return ListLookup::Buffer(entry.buffer.clone());
        }
        if source.bytes == 0 || source.bytes > self.bytes_max {
            return ListLookup::Unwanted;
        }
        if kept.asked_once.iter().any(|(asked, _)| *asked == key) {
            return ListLookup::Wanted;
        }
        if kept.asked_once.len() == ASKED_ONCE_MAX {
            kept.asked_once.pop_front();
        }
        kept.asked_once.push_back((key, source.owner.clone()));
        ListLookup::Unwanted
    }

    /// Keeps the buffer of a list. Buffers whose list is gone are dropped first, then those that were used
    /// least recently.
    pub fn keep(&self, slot: Slot, source: &Source, buffer: B) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (key, now) = (source.key(slot), kept.now);
        // Two jobs may fill a buffer for one list.
        kept.remove(&key);
        kept.remove_if(|entry| entry.owner.strong_count() == 0);
        while kept.bytes + source.bytes > self.bytes_max {
            let Some(oldest) = kept.buffers.values().map(|entry| entry.used).min() else { return };
            kept.remove_if(|entry| entry.used == oldest);
        }
        let entry = Entry { owner: source.owner.clone(), buffer, bytes: source.bytes, used: now };
        kept.bytes += source.bytes;
        kept.buffers.insert(key, entry);
    }

    /// Drops all buffers; jobs that use one keep it until they end. False if there was none.
    pub fn clear(&self) -> bool {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let had_some = !kept.buffers.is_empty();
        kept.remove_if(|_| true);
        had_some
    }

    /// Memory of the buffers, bytes.
    pub fn bytes(&self) -> u64 {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).bytes
    }
}

impl<B> Kept<B> {
    fn remove(&mut self, key: &Key) {
        self.bytes -= self.buffers.remove(key).map_or(0, |entry| entry.bytes);
    }

    fn remove_if(&mut self, is_removed: impl Fn(&Entry<B>) -> bool) {
        let mut freed = 0;
        self.buffers.retain(|_, entry| {
            let is_removed = is_removed(entry);
            freed += if is_removed { entry.bytes } else { 0 };
            !is_removed
        });
        self.bytes -= freed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(len: usize) -> (Arc<Vec<u8>>, Arc<Vec<u8>>) {
        let list = Arc::new(vec![0; len]);
        (list.clone(), list)
    }

    fn source(list: &Arc<Vec<u8>>) -> Source {
        Source::of_arc(list, list.len()).unwrap()
    }

    fn bytes(residents: &ResidentBuffers<u32>) -> (usize, u64) {
        let kept = residents.kept.lock().unwrap();
        assert_eq!(kept.bytes, kept.buffers.values().map(|entry| entry.bytes).sum::<u64>());
        (kept.buffers.len(), kept.bytes)
    }

    #[test]
    fn a_list_is_kept_from_the_second_time_on() {
        let residents = ResidentBuffers::new(100);
        let (a, _own) = list(60);
        let a = source(&a);
        assert_eq!(residents.find(Slot::Positions, &a), ListLookup::Unwanted);
        assert_eq!(residents.find(Slot::Uvs, &a), ListLookup::Unwanted, "another slot has another form");
        assert_eq!(residents.find(Slot::Positions, &a), ListLookup::Wanted);
        residents.keep(Slot::Positions, &a, 6);
        residents.keep(Slot::Positions, &a, 7);
        assert_eq!(bytes(&residents), (1, 60), "two jobs may keep one list");
        assert_eq!(residents.find(Slot::Positions, &a), ListLookup::Buffer(7));
        let (large, _own) = list(101);
        let large = source(&large);
        assert_eq!(residents.find(Slot::Uvs, &large), ListLookup::Unwanted);
        assert_eq!(residents.find(Slot::Uvs, &large), ListLookup::Unwanted, "it has no room");
        assert!(residents.clear() && !residents.clear());
        assert_eq!(residents.find(Slot::Positions, &a), ListLookup::Wanted);
        assert_eq!(bytes(&residents), (0, 0));
    }

    #[test]
    fn the_least_recently_used_makes_room() {
        let residents = ResidentBuffers::new(100);
        let lists: Vec<_> = (0..4).map(|_| list(40)).collect();
        let sources: Vec<_> = lists.iter().map(|(list, _)| source(list)).collect();
        let keep = |i: usize| {
            residents.find(Slot::Positions, &sources[i]);
            residents.keep(Slot::Positions, &sources[i], i as u32);
        };
        let found = |i: usize| residents.find(Slot::Positions, &sources[i]) == ListLookup::Buffer(i as u32);
        keep(0);
        keep(1);
        assert!(found(1) && found(0));
        keep(2);
        assert!(found(0) && !found(1) && found(2));
        keep(3);
        assert!(!found(0) && found(2) && found(3));
    }

    #[test]
    fn what_has_lost_its_owner_goes_first() {
        let residents = ResidentBuffers::new(100);
        let (first, own) = list(40);
        let (second, _own) = list(60);
        let (third, _own) = list(40);
        for (i, list) in [&first, &second].into_iter().enumerate() {
            residents.find(Slot::Positions, &source(list));
            residents.keep(Slot::Positions, &source(list), i as u32);
        }
        residents.find(Slot::Positions, &source(&first));
        drop((first, own));
        residents.find(Slot::Positions, &source(&third));
        residents.keep(Slot::Positions, &source(&third), 3);
        assert_eq!(residents.find(Slot::Positions, &source(&second)), ListLookup::Buffer(1));
        assert_eq!(bytes(&residents), (2, 100));
    }

    #[test]
    fn a_list_of_one_plan_alone_is_not_kept() {
        let alone = Arc::new(vec![0_u8; 9]);
        assert!(Source::of_arc(&alone, 9).is_none());
        let other = alone.clone();
        assert!(Source::of_arc(&other, 9).is_some());
        let values = [1.0_f32; 3];
        let borrowed = SharedSlice::Borrowed(&values[..]);
        assert!(Source::of(&borrowed, None).is_none());
        let (a, b) = (Arc::new(MeshToken), Arc::new(MeshToken));
        let key = |mesh| Source::of(&borrowed, Some(mesh)).unwrap().key(Slot::Positions);
        assert!(key(&a) == key(&a) && key(&a) != key(&b), "another mesh may lie where the first one did");
    }
}
