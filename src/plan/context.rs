//! What every part of a plan is made with.

use crate::limits::{Budget, Deadline};

/// Items of a list that are worked through between two looks at the deadline.
pub const CHECK_EVERY: usize = 1 << 16;

/// What planning may spend.
pub struct PlanContext<'m> {
    /// Bytes.
    pub budget: &'m mut Budget,
    /// Time.
    pub deadline: &'m Deadline,
}
