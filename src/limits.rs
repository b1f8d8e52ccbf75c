//! Every cap in one place, and the two things a job spends: bytes ([`Budget`]) and time ([`Deadline`]).
//!
//! A client's bytes are never trusted to say how much memory they need: whoever is about to allocate by a count from
//! the input first spends that many bytes from the job's [`Budget`].

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What a job or a request may use. Defaults are those of the public contract; every one can be configured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest accepted request body, bytes.
    pub body_bytes: u64,
    /// Decoded memory one job may hold at once, bytes: meshes, plans, frame buffers.
    pub memory_bytes: u64,
    /// Triangles after triangulation and instancing.
    pub triangles: u64,
    /// Nodes of a scene graph, counted as often as they are instanced.
    pub nodes: u64,
    /// Nesting of JSON objects and arrays.
    pub json_depth: u64,
    /// Output image width and height, pixels each.
    pub image_px: u64,
    /// Width and height of a texture, pixels each.
    pub texture_px: u64,
    /// All textures that one picture decodes, pixels.
    pub texture_total_px: u64,
    /// Files of a bundle once unpacked, bytes.
    pub bundle_bytes: u64,
    /// Files of one bundle; of a zip archive every entry counts.
    pub bundle_entries: u64,
    /// Wall-clock time for one job, from acceptance to encoded image, milliseconds.
    pub job_ms: u64,
    /// Jobs waiting for each worker. A full queue is refused at once, never waited for.
    pub queue_per_worker: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            body_bytes: 64 << 20,
            memory_bytes: 2 << 30,
            triangles: 10_000_000,
            nodes: 100_000,
            json_depth: 64,
            image_px: 4096,
            texture_px: 8192,
            texture_total_px: 256 << 20,
            bundle_bytes: 512 << 20,
            bundle_entries: 1000,
            job_ms: 30_000,
            queue_per_worker: 64,
        }
    }
}

/// The largest picture side that the rasterizers' fixed point can address; no setting goes beyond it.
pub const IMAGE_PX_MAX: u64 = 4096;

/// The longest time that a job can be given, milliseconds: a day, so that no sum of times overflows.
pub const JOB_MS_MAX: u64 = 24 * 3600 * 1000;

/// A cap that the input ran into.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} is {given}, and the limit is {limit} (raise it with {flag})")]
pub struct LimitExceeded {
    /// What was counted, in words: "the number of triangles".
    pub what: String,
    /// How much the input wants.
    pub given: u64,
    /// How much is allowed.
    pub limit: u64,
    /// The `serve` flag that raises the limit.
    pub flag: &'static str,
}

/// Refuses a count that is over its cap.
pub fn check(what: &str, given: u64, limit: u64, flag: &'static str) -> Result<(), LimitExceeded> {
    if given > limit {
        return Err(LimitExceeded { what: what.to_owned(), given, limit, flag });
    }
    Ok(())
}

/// Bytes that one job may still allocate, and pixels that it may decode. Spend first, allocate after.
#[derive(Debug)]
pub struct Budget {
    spent: u64,
    limit: u64,
    texture_px: u64,
    texture_total_px: u64,
    textures_px: u64,
}

impl Budget {
    /// A fresh budget of `limits.memory_bytes` and of the limits on textures.
    pub fn new(limits: &Limits) -> Self {
        let Limits { memory_bytes, texture_px, texture_total_px, .. } = *limits;
        Self { spent: 0, limit: memory_bytes, texture_px, texture_total_px, textures_px: 0 }
    }

    /// Takes `count * size_bytes` from the budget for `what`, or refuses.
    pub fn spend(&mut self, what: &str, count: u64, size_bytes: u64) -> Result<(), LimitExceeded> {
        let wanted = self.spent.saturating_add(count.saturating_mul(size_bytes));
        check(&format!("the memory for {what}, in bytes,"), wanted, self.limit, "--limit-memory-bytes")?;
        self.spent = wanted;
        Ok(())
    }

    /// Takes the pixels of a texture, or refuses; `what` names it: "image 3".
    pub fn spend_texture(&mut self, what: &str, width_px: u32, height_px: u32) -> Result<(), LimitExceeded> {
        let side = u64::from(width_px.max(height_px));
        check(&format!("the longer side of {what}, in pixels,"), side, self.texture_px, "--limit-texture-px")?;
        let total = self.textures_px.saturating_add(u64::from(width_px) * u64::from(height_px));
        let what = format!("the number of pixels of all textures up to {what}");
        check(&what, total, self.texture_total_px, "--limit-texture-total-px")?;
        self.textures_px = total;
        Ok(())
    }

    /// Bytes spent so far.
    pub fn spent_bytes(&self) -> u64 {
        self.spent
    }
}

/// The job ran out of time or was cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the job was stopped before it finished")]
pub struct Stopped;

/// A flag that the owner of the clock raises. The pipeline polls it between stages and inside long loops.
#[derive(Clone, Debug, Default)]
pub struct Deadline(Arc<DeadlineState>);

#[derive(Debug, Default)]
struct DeadlineState {
    is_stopped: AtomicBool,
    /// Tests count polls, because times depend on the machine.
    counter: Option<PollCounter>,
}

#[derive(Debug)]
struct PollCounter {
    polls: AtomicU64,
    stop_at: u64,
}

impl Deadline {
    /// A deadline that counts its polls and stops at the poll numbered `stop_at`, from 1.
    #[doc(hidden)]
    pub fn after_polls(stop_at: u64) -> Self {
        let counter = Some(PollCounter { polls: AtomicU64::new(0), stop_at });
        Self(Arc::new(DeadlineState { is_stopped: AtomicBool::new(false), counter }))
    }

    /// Polls so far, of a deadline that counts them.
    #[doc(hidden)]
    pub fn polls(&self) -> u64 {
        self.0.counter.as_ref().map_or(0, |counter| counter.polls.load(Ordering::Relaxed))
    }

    /// Tells the job to stop at its next poll.
    pub fn stop(&self) {
        self.0.is_stopped.store(true, Ordering::Relaxed);
    }

    /// Fails once [`Deadline::stop`] was called.
    pub fn check(&self) -> Result<(), Stopped> {
        if let Some(counter) = &self.0.counter
            && counter.polls.fetch_add(1, Ordering::Relaxed) + 1 >= counter.stop_at
        {
            self.stop();
        }
        if self.0.is_stopped.load(Ordering::Relaxed) { Err(Stopped) } else { Ok(()) }
    }
}
