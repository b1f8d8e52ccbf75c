//! Work on many pieces of a file at once.
//!
//! It is done by the thread pool that the caller is in, or else by rayon's own, which has a thread
//! for each core. A single piece is done by the calling thread. No result depends on the number
//! of threads.

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

/// One list of the items of several.
pub fn concat<T: Copy + Default + Send + Sync>(mut lists: Vec<Vec<T>>) -> Vec<T> {
    lists.retain(|list| !list.is_empty());
    if lists.len() < 2 {
        return lists.pop().unwrap_or_default();
    }
    let mut all = vec![T::default(); lists.iter().map(Vec::len).sum()];
    let mut places = Vec::with_capacity(lists.len());
    let mut rest = all.as_mut_slice();
    for list in lists {
        let (place, after) = rest.split_at_mut(list.len());
        places.push((place, list));
        rest = after;
    }
    map(places, |(place, list)| place.copy_from_slice(&list));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let lists: Vec<Vec<u32>> = (0..100).map(|i| (i * 10..i * 10 + i % 7).collect()).collect();
        assert_eq!(concat(lists.clone()), lists.concat());
        assert_eq!((concat(vec![vec![1, 2]]), concat::<u8>(vec![])), (vec![1, 2], vec![]));
    }
}
