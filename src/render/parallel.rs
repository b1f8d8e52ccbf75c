//! Parallel work on the items of a list, such as pieces of a file or of a mesh.
//!
//! The thread pool that the caller is in does the work, or else rayon's own, which by default has a
//! thread for each core. Where there is only one piece, the calling thread does it. No result depends on
//! the number of threads. `beside` alone starts threads of its own, which work while the calling thread
//! does something else.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::thread;

use rayon::prelude::*;

/// The results of `each` for some items, in their order.
pub fn map<T: Send, R: Send>(items: Vec<T>, each: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    if items.len() < 2 {
        return items.into_iter().map(each).collect();
    }
    items.into_par_iter().map(each).collect()
}

/// As [`map`], with memory that `each` may leave in any state and finds again, or new, at a later
/// item.
pub fn map_with<T: Send, M, R: Send>(
    items: Vec<T>,
    memory: impl Fn() -> M + Sync + Send,
    each: impl Fn(&mut M, T) -> R + Sync + Send,
) -> Vec<R> {
    if items.len() < 2 {
        return items.into_iter().map(|item| each(&mut memory(), item)).collect();
    }
    items.into_par_iter().map_init(memory, each).collect()
}

/// Items handed to a thread at a time by [`map_items`] and [`each_piece`].
const ITEMS_PER_PIECE: usize = 16_384;

/// The results of `each` for the items of a long list.
pub fn map_items<T: Sync, R: Send>(items: &[T], each: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    if items.len() <= ITEMS_PER_PIECE {
        return items.iter().map(each).collect();
    }
    items.par_iter().with_min_len(ITEMS_PER_PIECE).map(each).collect()
}

/// The results of `each` for pieces of a long list, in their order.
pub fn each_piece<T: Send, R: Send>(items: &mut [T], each: impl Fn(&mut [T]) -> R + Sync + Send) -> Vec<R> {
    map(items.chunks_mut(ITEMS_PER_PIECE).collect(), each)
}

/// One list of the items of several.
pub fn concat<T: Copy + Default + Send + Sync>(mut lists: Vec<Vec<T>>) -> Vec<T> {
    lists.retain(|list| !list.is_empty());
    if lists.len() < 2 {
        return lists.pop().unwrap_or_default();
    }
    concat_slices(&lists.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

/// One list of the items of several.
pub fn concat_slices<T: Copy + Default + Send + Sync>(lists: &[&[T]]) -> Vec<T> {
    let mut all = vec![T::default(); lists.iter().map(|list| list.len()).sum()];
    let mut places = Vec::with_capacity(lists.len());
    let mut rest = all.as_mut_slice();
    for list in lists {
        let (place, after) = rest.split_at_mut(list.len());
        places.push((place, *list));
        rest = after;
    }
    map(places, |(place, list)| place.copy_from_slice(list));
    all
}

/// Runs `work` on `count` threads of its own, and `meanwhile` on this one. Waits for the threads' very ends, after what
/// they leave to be run there: GPU drivers need that, as `DrawingThreads` says.
pub fn beside<R>(count: usize, work: impl FnOnce() + Clone + Send, meanwhile: impl FnOnce() -> R) -> R {
    thread::scope(|scope| {
        let threads: Vec<_> = (0..count).map(|_| scope.spawn(work.clone())).collect();
        // What it holds, such as one end of a channel, the threads hold alone.
        drop(work);
        let result = catch_unwind(AssertUnwindSafe(meanwhile));
        let ends: Vec<_> = threads.into_iter().map(thread::ScopedJoinHandle::join).collect();
        if let Some(panic) = ends.into_iter().find_map(Result::err) {
            resume_unwind(panic);
        }
        result.unwrap_or_else(|panic| resume_unwind(panic))
    })
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::*;

    /// Counts the end of the thread that owns it, late: as a thread-local value, it is dropped when all work is done. Drivers
    /// are called at that time, too.
    struct AtTheEnd(Arc<AtomicUsize>);

    impl Drop for AtTheEnd {
        fn drop(&mut self) {
            thread::sleep(Duration::from_millis(20));
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn threads_beside_have_ended_when_all_is_done() {
        thread_local!(static LEFT: Cell<Option<AtTheEnd>> = const { Cell::new(None) });
        let ended = Arc::new(AtomicUsize::new(0));
        let own = ended.clone();
        beside(4, move || LEFT.set(Some(AtTheEnd(own))), || ());
        assert_eq!(ended.load(Ordering::Relaxed), 4);
    }

    #[test]
    fn work_is_done_beside_other_work() {
        let (sender, numbers) = channel();
        let send = move || sender.send(7).unwrap();
        // It ends when all senders are gone.
        assert_eq!(beside(3, send, || numbers.iter().sum::<i32>()), 21);
    }

    #[test]
    fn order_is_kept() {
        assert_eq!(map((0..1000).collect(), |i| i * 2), (0..1000).map(|i| i * 2).collect::<Vec<_>>());
        assert_eq!(map(vec![7], |i| i + 1), [8]);
        let fill = |memory: &mut Vec<u32>, i: u32| {
            memory.push(i);
            memory[memory.len() - 1] * 2
        };
        assert_eq!(map_with((0..1000).collect(), Vec::new, fill), (0..1000).map(|i| i * 2).collect::<Vec<_>>());
        assert_eq!(map_with(vec![7], Vec::new, fill), [14]);
        let mut many: Vec<u32> = (0..100_000).collect();
        assert_eq!(each_piece(&mut many, |piece| piece.iter_mut().for_each(|i| *i *= 2)).len(), 7);
        for count in [0, 7, 100_000] {
            assert_eq!(map_items(&many[..count], |i| i / 2), (0..count as u32).collect::<Vec<_>>());
        }
        let lists: Vec<Vec<u32>> = (0..100).map(|i| (i * 10..i * 10 + i % 7).collect()).collect();
        assert_eq!(concat(lists.clone()), lists.concat());
        assert_eq!((concat(vec![vec![1, 2]]), concat::<u8>(vec![])), (vec![1, 2], vec![]));
    }
}
