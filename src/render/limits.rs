//! The caps of one job, and what a job spends: bytes and pixels of textures ([`Budget`]), and time
//! ([`Deadline`]).
//!
//! **Invariant**: an allocation whose size follows from the input is first spent from the job's
//! [`Budget`]. A count in a client's file is never trusted.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The most that a job or a request may use. The defaults are those of the public contract, and
/// each can be configured: set its field, or several in [`with`](Self::with).
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Memory that one job may hold at once, bytes: mesh, plan, frame buffers.
    pub memory_bytes: u64,
    /// Triangles after triangulation and instancing.
    pub triangles: u64,
    /// Nodes of a scene graph, each counted as often as it is instanced.
    pub nodes: u64,
    /// Nesting of JSON objects and arrays.
    pub json_depth: u64,
    /// Width and height of a picture, pixels each.
    pub image_px: u64,
    /// Width and height of a texture, pixels each.
    pub texture_px: u64,
    /// Pixels of all textures that one picture decodes, together.
    pub texture_total_px: u64,
    /// Files of a bundle once unpacked, bytes together.
    pub bundle_bytes: u64,
    /// Files of one bundle. Every entry of a zip archive counts, folders too.
    pub bundle_entries: u64,
}

impl Limits {
    /// These limits with changes: `Limits::default().with(|limits| limits.triangles = 100_000)`.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }
}

/// The owner of memory that several jobs share.
pub trait Lend: std::fmt::Debug + Send + Sync {
    /// The job holds so many bytes in all from now on, unless it holds more already. The error is the most that a job may
    /// ever hold.
    fn lend(&self, bytes: u64) -> Result<(), u64>;

    /// The job holds 0 bytes from now on. The bytes that it has borrowed are counted elsewhere.
    fn restart(&self);
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            memory_bytes: 2 << 30,
            triangles: 10_000_000,
            nodes: 100_000,
            json_depth: 64,
            image_px: 4096,
            texture_px: 8192,
            texture_total_px: 256 << 20,
            bundle_bytes: 512 << 20,
            bundle_entries: 1000,
        }
    }
}

/// The largest side of a picture that the rasterizers' fixed-point coordinates can address, pixels.
/// No setting exceeds it.
pub const IMAGE_PX_MAX: u64 = 4096;

/// The longest time that a request or a setting can give a job, milliseconds: a day, so that no sum of times
/// overflows.
pub const JOB_MS_MAX: u64 = 24 * 3600 * 1000;

/// A cap that the input exceeds.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
#[error("{what} is more than {limit} (raise the limit with {flag})")]
pub struct LimitExceeded {
    /// The thing that was counted, in words: "the number of triangles".
    pub what: String,
    /// The count at which it was refused. The whole input may ask for more, so messages do not say it.
    pub given: u64,
    /// The largest count that is allowed.
    pub limit: u64,
    /// The `serve` flag that raises the limit.
    #[cfg_attr(feature = "isolate", serde(skip))]
    pub flag: &'static str,
}

/// Refuses a count that is over its cap.
pub fn check(what: &str, given: u64, limit: u64, flag: &'static str) -> Result<(), LimitExceeded> {
    if given > limit {
        return Err(LimitExceeded { what: what.to_owned(), given, limit, flag });
    }
    Ok(())
}

/// Memory that was taken from a budget.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spent {
    what: Box<str>,
    bytes: u64,
}

/// Bytes that one job may still allocate and pixels that it may still decode. Spend first, allocate
/// after.
#[derive(Clone, Debug)]
pub struct Budget {
    /// A list of all that is spent while [`record`](Self::record) runs; None at other times.
    recorded: Option<Vec<Spent>>,
    /// The owner of the memory that jobs share. None: each job has its own.
    lender: Option<Arc<dyn Lend>>,
    /// Bytes that were spent before, and that the lender does not lend.
    lent_from: u64,
    spent: u64,
    limit: u64,
    texture_px: u64,
    texture_total_px: u64,
    textures_px: u64,
}

impl Budget {
    /// An unspent budget of `limits.memory_bytes`, with the limits on textures.
    pub fn new(limits: &Limits) -> Self {
        Self::lent(limits, None)
    }

    /// The same for a job that borrows all that is spent from `lender`, if there is one.
    pub fn lent(limits: &Limits, lender: Option<Arc<dyn Lend>>) -> Self {
        let &Limits { memory_bytes, texture_px, texture_total_px, .. } = limits;
        Self {
            recorded: None,
            lender,
            lent_from: 0,
            spent: 0,
            limit: memory_bytes,
            texture_px,
            texture_total_px,
            textures_px: 0,
        }
    }

    /// This budget with its spending so far, for a job that borrows from `lender` all that is spent beyond `from` bytes.
    #[must_use]
    pub fn lent_by(&self, lender: Option<Arc<dyn Lend>>, from: u64) -> Self {
        Self { lender, lent_from: from.min(self.spent), ..self.clone() }
    }

    /// Takes `count * size_bytes` from the budget for `what`, or refuses.
    pub fn spend(&mut self, what: &str, count: u64, size_bytes: u64) -> Result<(), LimitExceeded> {
        let bytes = count.saturating_mul(size_bytes);
        let wanted = self.spent.saturating_add(bytes);
        check(&format!("the memory for {what}, in bytes,"), wanted, self.limit, "--limit-memory-bytes")?;
        if let Some(lender) = &self.lender {
            lender.lend(wanted - self.lent_from).map_err(|limit| LimitExceeded {
                what: format!("the memory for {what}, in bytes,"),
                given: wanted,
                limit,
                flag: "--memory-bytes",
            })?;
        }
        self.spent = wanted;
        if let Some(recorded) = &mut self.recorded {
            recorded.push(Spent { what: what.into(), bytes });
        }
        Ok(())
    }

    /// Borrows memory beside what is spent, which another process takes for the job. The error is the most that the job may
    /// ever hold.
    pub fn lend_beside(&self, bytes: u64) -> Result<(), u64> {
        let wanted = (self.spent - self.lent_from).saturating_add(bytes);
        self.lender.as_ref().map_or(Ok(()), |lender| lender.lend(wanted))
    }

    /// Runs `work`, and returns what it spent as well, in order.
    pub fn record<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> (T, Vec<Spent>) {
        let outer = self.recorded.replace(Vec::new());
        let done = work(self);
        let spent = std::mem::replace(&mut self.recorded, outer).unwrap_or_default();
        if let Some(outer) = &mut self.recorded {
            outer.extend(spent.iter().cloned());
        }
        (done, spent)
    }

    /// Takes from the budget what was spent before on the same thing, or refuses in the same words.
    pub fn spend_again(&mut self, spent: &[Spent]) -> Result<(), LimitExceeded> {
        spent.iter().try_for_each(|Spent { what, bytes }| self.spend(what, *bytes, 1))
    }

    /// Takes the pixels of a texture from the budget, or refuses. `what` names it: "image 3".
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

/// Something that a job spends is used up.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Exhausted {
    /// The budget, or another cap.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// The time.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// A flag that says "stop", raised by the job's owner. The pipeline asks no clock whether to stop: it
/// polls the flag between stages and inside long loops.
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
    /// For tests: a deadline that counts its polls and stops at the poll numbered `stop_at`, from 1.
    pub fn after_polls(stop_at: u64) -> Self {
        let counter = Some(PollCounter { polls: AtomicU64::new(0), stop_at });
        Self(Arc::new(DeadlineState { is_stopped: AtomicBool::new(false), counter }))
    }

    /// For tests: polls so far, of a deadline that counts them.
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
