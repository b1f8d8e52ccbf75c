//! Mirrors: jobs that show what is known of a job of another server, so that whoever asks for a job's state, its progress
//! or its end is answered in the same way. They are in no queue.

use std::time::Duration;

use super::{Admission, Job, JobState, Restored, Size};
use crate::jobs::{Class, Progress};

impl Job {
    /// A job that another server has, as far as this one knows of it.
    pub fn mirror_of(name: Restored, state: JobState, progress: Progress) -> Self {
        let Restored { id, accepted_unix_ms, owner, claim } = name;
        let admission = Admission {
            is_kept: true,
            class: Class::Batch,
            owner,
            is_durable: false,
            serial: 0,
            size: Size::default(),
            estimate: Duration::ZERO,
            memory_bytes: 0,
            rank: Duration::ZERO,
            claim,
        };
        let job = Self { is_mirror: true, ..Self::new(None, admission, Some((id, accepted_unix_ms))) };
        job.mirror(state, progress);
        job
    }

    /// True if it shows a job that is not this server's.
    pub fn is_mirror(&self) -> bool {
        self.is_mirror
    }

    /// Shows the state of a job that another server has. It has no effect on a job of this one.
    pub fn mirror(&self, state: JobState, progress: Progress) {
        if self.is_mirror {
            self.progress.send_replace(progress);
            self.state.send_replace(state);
        }
    }
}
