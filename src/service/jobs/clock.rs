//! The thread that ends overdue jobs and drops expired results. It sleeps until the next of either.

use std::sync::Arc;

use super::job::{Failure, JobState};
use super::registry::JobRegistry;

/// Runs until the registry is drained and every job has ended.
pub fn run(registry: &Arc<JobRegistry>) {
    let limit_ms = u64::try_from(registry.settings.job_time.as_millis()).unwrap_or(u64::MAX);
    while let Some(overdue) = registry.wait_for_overdue() {
        for job in overdue {
            // The answer goes out now, even if the worker needs a moment to stop.
            registry.end(&job, JobState::Failed(Arc::new(Failure::TimeUp { limit_ms })));
        }
    }
}
