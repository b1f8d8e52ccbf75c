//! The one thread that watches deadlines and forgets old results. It sleeps until the next of either.

use std::sync::Arc;

use super::job::{Failure, State};
use crate::service::jobs::registry::Registry;

/// Runs until the board is drained and every job has ended.
pub fn run(board: &Registry) {
    let limit_ms = u64::try_from(board.settings.job_time.as_millis()).unwrap_or(u64::MAX);
    while let Some(overdue) = board.overdue() {
        for job in overdue {
            // The answer goes out now, even if the worker needs a moment to notice.
            board.end(&job, State::Failed(Arc::new(Failure::TimeUp { limit_ms })));
        }
    }
}
