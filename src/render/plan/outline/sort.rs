//! Sorting of long lists, for the corners of outlines. A list is sorted in parts, and the job's
//! deadline is checked before each, so that a job whose time is up ends soon.

use std::cmp::Ordering;

use crate::limits::{Deadline, Stopped};
use crate::plan::context::CHECK_EVERY;

/// Sorts a list by halves, so that the deadline can be checked in between.
pub fn sort<T>(items: &mut [T], order: &impl Fn(&T, &T) -> Ordering, deadline: &Deadline) -> Result<(), Stopped> {
    deadline.check()?;
    if items.len() <= CHECK_EVERY {
        items.sort_unstable_by(order);
        return Ok(());
    }
    let (low, _, high) = items.select_nth_unstable_by(items.len() / 2, order);
    sort(low, order, deadline)?;
    sort(high, order, deadline)
}
