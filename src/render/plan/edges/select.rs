//! Parallel work on long lists: `select` collects what is found in the items of a list, `map` computes a value for
//! each item. Results keep the order of the items, whatever thread found them. `select` goes through the list
//! twice: it counts first, so that the memory of the results is taken from the budget before it is allocated.

use std::ops::Range;

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::limits::{Deadline, Stopped};
use crate::plan::PlanError;
use crate::plan::context::PlanContext;

/// Items of the list that a thread works through at a time.
const CHUNK: usize = 1 << 14;

/// All that `each` finds in the items `0..count` of a list, in their order. It is called twice for
/// each range: what it finds is counted and paid for before it is kept.
pub fn select<T: Zeroable + Send>(
    what: &str,
    count: usize,
    cx: &mut PlanContext<'_>,
    each: impl Fn(Range<usize>, &mut dyn FnMut(T)) + Sync,
) -> Result<Vec<T>, PlanError> {
    select_by(what, count, CHUNK, cx, each)
}

/// As [`select`] in a list of so many items, of which a thread takes so many at a time.
pub fn select_by<T: Zeroable + Send>(
    what: &str,
    count: usize,
    chunk: usize,
    cx: &mut PlanContext<'_>,
    each: impl Fn(Range<usize>, &mut dyn FnMut(T)) + Sync,
) -> Result<Vec<T>, PlanError> {
    let deadline = cx.deadline;
    let chunks = || (0..count).step_by(chunk).map(|from| from..count.min(from + chunk));
    let found = |range: Range<usize>| {
        deadline.check()?;
        let mut found = 0;
        each(range, &mut |_| found += 1);
        Ok(found)
    };
    let fill = |range: Range<usize>, place: &mut [T]| {
        deadline.check()?;
        let mut places = place.iter_mut();
        each(range, &mut |item| {
            if let Some(place) = places.next() {
                *place = item;
            }
        });
        Ok::<(), Stopped>(())
    };
    // A short list is done by the calling thread.
    let is_short = count <= chunk;
    let counts: Vec<usize> = if is_short {
        chunks().map(found).collect::<Result<_, Stopped>>()?
    } else {
        chunks().collect::<Vec<_>>().into_par_iter().map(found).collect::<Result<_, Stopped>>()?
    };
    let total = counts.iter().sum();
    cx.budget.spend(what, total as u64, size_of::<T>() as u64)?;
    let mut all: Vec<T> = bytemuck::allocation::zeroed_vec(total);
    let mut places = Vec::with_capacity(counts.len());
    let mut rest = &mut all[..];
    for (range, count) in chunks().zip(counts) {
        let (place, after) = rest.split_at_mut(count);
        places.push((range, place));
        rest = after;
    }
    if is_short {
        places.into_iter().try_for_each(|(range, place)| fill(range, place))?;
    } else {
        places.into_par_iter().try_for_each(|(range, place)| fill(range, place))?;
    }
    Ok(all)
}

/// The results of `each` for all items of a list. The caller has spent their memory.
pub fn map<T: Sync, U: Zeroable + Send>(
    items: &[T],
    deadline: &Deadline,
    each: impl Fn(&T) -> U + Sync,
) -> Result<Vec<U>, Stopped> {
    map_indices(items.len(), deadline, |i| each(&items[i]))
}

/// The results of `each` for the numbers below `count`. The caller has spent their memory.
pub fn map_indices<U: Zeroable + Send>(
    count: usize,
    deadline: &Deadline,
    each: impl Fn(usize) -> U + Sync,
) -> Result<Vec<U>, Stopped> {
    let mut results = bytemuck::allocation::zeroed_vec(count);
    let chunk = |(first, results): (usize, &mut [U])| {
        deadline.check()?;
        results.iter_mut().zip(first..).for_each(|(result, i)| *result = each(i));
        Ok(())
    };
    if count <= CHUNK {
        chunk((0, &mut results))?;
    } else {
        let numbered = results.par_chunks_mut(CHUNK).enumerate();
        numbered.try_for_each(|(i, results)| chunk((i * CHUNK, results)))?;
    }
    Ok(results)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{Budget, Deadline, Limits};

    #[test]
    fn what_is_found_is_in_order_and_paid_for() {
        for count in [0, 1, 1000, CHUNK, CHUNK + 1, 10 * CHUNK + 77] {
            let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
            let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
            // Of each third item two, of the others none.
            let each = |range: Range<usize>, found: &mut dyn FnMut(u32)| {
                range.filter(|i| i % 3 == 0).for_each(|i| [0, 1].into_iter().for_each(|k| found(2 * i as u32 + k)));
            };
            let all = select("numbers", count, &mut cx, each).unwrap();
            let mut one_by_one = Vec::new();
            each(0..count, &mut |i| one_by_one.push(i));
            assert!(all == one_by_one, "{count}");
            assert_eq!(budget.spent_bytes(), 4 * all.len() as u64);
        }
    }

    #[test]
    fn a_map_is_in_order() {
        for count in [0, 1, CHUNK, CHUNK + 1, 5 * CHUNK + 77] {
            let items: Vec<usize> = (0..count).collect();
            let doubled = map(&items, &Deadline::default(), |i| 2 * i).unwrap();
            assert!(doubled.iter().enumerate().all(|(i, &twice)| twice == 2 * i) && doubled.len() == count);
        }
    }

    #[test]
    fn a_small_budget_and_a_raised_flag_end_it() {
        let deadline = Deadline::default();
        let mut budget = Budget::new(&Limits { memory_bytes: 4 * 100_000 - 1, ..Limits::default() });
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let each = |range: Range<usize>, found: &mut dyn FnMut(u32)| range.for_each(|i| found(i as u32));
        let result = select("numbers", 100_000, &mut cx, each);
        assert!(matches!(result, Err(PlanError::Limit(_))), "{result:?}");
        assert_eq!(select("numbers", 99_999, &mut cx, each).unwrap().len(), 99_999);
        deadline.stop();
        assert!(map(&[1, 2, 3], &deadline, |i| i + 1).is_err());
        for count in [1, 100_000] {
            let result = select("numbers", count, &mut cx, each);
            assert!(matches!(result, Err(PlanError::Stopped(_))), "{result:?}");
        }
    }
}
