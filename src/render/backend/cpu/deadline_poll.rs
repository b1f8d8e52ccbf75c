//! The check, in loops over triangles and the like, whether a job has to stop, for example because
//! its time is up. It is made about every 10 ms, counted in work (tested samples, and a fixed cost
//! per triangle) and not in triangles alone: a triangle may have one sample or millions.

use crate::limits::Deadline;

/// Work between two polls, samples: about 10 ms.
const WORK_PER_POLL: u64 = 1 << 22;

/// Fixed cost per triangle, samples.
const WORK_PER_TRIANGLE: u64 = 1 << 12;

/// Polls a deadline by amount of work, because a triangle may have one sample or millions.
pub struct DeadlinePoll<'a> {
    deadline: &'a Deadline,
    left: u64,
}

impl<'a> DeadlinePoll<'a> {
    /// Polls at once, then after each [`WORK_PER_POLL`].
    pub fn new(deadline: &'a Deadline) -> Self {
        Self { deadline, left: 0 }
    }

    /// True if the deadline has passed. To be called after each triangle with the number of samples
    /// tested, and not again once it is true.
    #[inline(always)]
    pub fn is_expired(&mut self, samples: u64) -> bool {
        self.is_expired_after(1, samples)
    }

    /// True if the deadline has passed, after several triangles with this many samples together.
    #[inline(always)]
    pub fn is_expired_after(&mut self, triangles: u64, samples: u64) -> bool {
        let work = samples + triangles * WORK_PER_TRIANGLE;
        if work <= self.left {
            self.left -= work;
            return false;
        }
        self.left = WORK_PER_POLL;
        self.deadline.check().is_err()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of so many samples until the end of time is noticed, when it comes after the
    /// first.
    fn triangles_until_noticed(samples: u64) -> u64 {
        let deadline = Deadline::default();
        let mut poll = DeadlinePoll::new(&deadline);
        assert!(!poll.is_expired(samples));
        deadline.stop();
        (1..5000).find(|_| poll.is_expired(samples)).unwrap_or(5000)
    }

    #[test]
    fn large_triangles_are_fewer_between_two_looks() {
        for (samples, most) in [(0, 1025), (1, 1025), (1 << 12, 513), (1 << 20, 5), (1 << 22, 1), (1 << 28, 1)] {
            let triangles = triangles_until_noticed(samples);
            assert!((most / 2..=most).contains(&triangles), "{triangles} of {samples} samples");
        }
    }
}
