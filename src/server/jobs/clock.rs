//! The thread that ends jobs whose time is up. If a worker still has not stopped after a grace, the
//! thread logs that, counts it against the meshes (`watchdog.rs`), and starts another worker in its
//! place, unless too many are stuck.
//!
//! `JobRegistry::wait_for_late` decides what is late. It sleeps until something is, and drops expired results meanwhile.

use std::sync::Arc;

use super::job::{Failure, JobState};
use super::registry::JobRegistry;

/// Runs until the registry is drained and every job has ended. `replace` starts a worker.
pub fn run(registry: &Arc<JobRegistry>, replace: &dyn Fn()) {
    let limit_ms = u64::try_from(registry.settings.job_time.as_millis()).unwrap_or(u64::MAX);
    while let Some(late) = registry.wait_for_late() {
        for job in late.jobs {
            // The answer goes out now, even if the worker needs a moment to stop.
            registry.end(&job, JobState::Failed(Arc::new(Failure::TimeUp { limit_ms })));
        }
        for (running, is_replaced) in late.workers {
            let (job, request_id, ms) = (running.job.id, &*running.job.request_id, running.since.elapsed().as_millis());
            for (mesh, strikes) in registry.quarantine.strike(&running.meshes) {
                tracing::error!(%job, request_id, ms, %mesh, strikes, is_replaced, "a worker does not end its job");
            }
            if let Some(metrics) = &registry.settings.metrics {
                metrics.worker_overdue();
            }
            if is_replaced {
                replace();
            }
        }
    }
}
