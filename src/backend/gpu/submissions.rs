//! Hands commands to the device: those of all jobs that are ready at the moment in one submission, because
//! a device idles for a while between two.

use std::sync::mpsc::{Sender, TryRecvError, channel};
use std::sync::{Mutex, PoisonError};

use super::handles::Handles;
use crate::backend::DrawError;

/// Commands that wait for the thread that submits.
#[derive(Default)]
pub struct Submissions {
    ready: Mutex<Vec<Ready>>,
    /// Held by the thread that submits.
    submitting: Mutex<()>,
}

/// Commands of a job, and what tells it that they were submitted, or why not.
struct Ready {
    commands: wgpu::CommandBuffer,
    told: Sender<Option<String>>,
}

impl Submissions {
    /// Submits what was recorded. Nothing waits for more to come: the first thread submits its own commands,
    /// and whoever comes meanwhile waits for it and submits the commands of all who have come by then.
    ///
    /// wgpu refuses all commands of a submission together, so commands that are wrong in themselves are
    /// refused before.
    pub fn submit(&self, gpu: &Handles, encoder: wgpu::CommandEncoder) -> Result<(), DrawError> {
        let commands = gpu.scoped(|| Ok(encoder.finish()))?;
        let (told, outcome) = channel();
        self.ready.lock().unwrap_or_else(PoisonError::into_inner).push(Ready { commands, told });
        let submitting = self.submitting.lock().unwrap_or_else(PoisonError::into_inner);
        let result = match outcome.try_recv() {
            Err(TryRecvError::Empty) => self.submit_all(gpu),
            Ok(None) => Ok(()),
            Ok(Some(reason)) => Err(DrawError::Device(reason)),
            // The thread has panicked, as wgpu does on a lost device.
            Err(TryRecvError::Disconnected) => Err(DrawError::Device("a submission broke off".to_owned())),
        };
        drop(submitting);
        result
    }

    fn submit_all(&self, gpu: &Handles) -> Result<(), DrawError> {
        let ready = std::mem::take(&mut *self.ready.lock().unwrap_or_else(PoisonError::into_inner));
        let (commands, jobs): (Vec<_>, Vec<_>) = ready.into_iter().map(|job| (job.commands, job.told)).unzip();
        let result = gpu.scoped(|| {
            gpu.queue.submit(commands);
            Ok(())
        });
        let reason = match &result {
            Ok(()) => None,
            Err(DrawError::Device(reason)) => Some(reason.clone()),
            Err(error) => Some(error.to_string()),
        };
        for job in jobs {
            // The submitting job's own receiver is gone in a moment.
            let _ = job.send(reason.clone());
        }
        result
    }
}
