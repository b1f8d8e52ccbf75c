//! The queue of a service of several daemons, in NATS JetStream. It says which jobs wait, and tells all daemons how far jobs
//! have come. It holds names and small notes alone: what a job needs, and its end, are objects of the shared store. So a
//! queue that is lost is made again from the store.
//!
//! In JetStream, a queue of the name NAME has:
//!
//! - The stream `NAME-jobs`, a work queue: a message for each job that has not ended, under a subject of the job's own. A
//!   daemon takes a message, and acknowledges it when the job's end is stored. Without that, or a sign of life
//!   within [`ACK_WAIT`], another daemon gets it.
//! - The stream `NAME-gpu`, the same for jobs that ask for a GPU.
//! - The stream `NAME-webhooks`, the same for the ends that a webhook is to be told of.
//! - The key-value bucket `NAME`: a [`Note`] for each job, and the leases by which one daemon at a time does something.
//! - The stream `NAME-dead`: jobs that were given up, with the reason, for people to look at.
//!
//! Beside JetStream, daemons tell each other news, and ask each other, under the subjects `NAME.news` and `NAME.questions`.
//!
//! Architecture invariant: nothing here knows what a job does, nor HTTP.

mod address;
#[cfg_attr(not(feature = "cluster"), path = "nats/absent.rs")]
mod nats;

pub use address::{Address, AddressError};
pub use nats::{Delivery, Following, Heard, News, Question, SharedQueue, list_dead, list_live};

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Time after which a message is given to another daemon, if the one that has it gives no sign of life.
pub const ACK_WAIT: Duration = Duration::from_secs(30);

/// Time between two signs of life.
pub const SIGN_EVERY: Duration = Duration::from_secs(8);

/// The error of an operation: the queue cannot be reached, or does not do what it should.
#[derive(Debug, thiserror::Error)]
pub enum QueueError {
    /// As many jobs wait as may.
    #[error("the shared queue is full")]
    Full,
    /// The queue cannot be used at this moment.
    #[error("the shared queue {address}: {cause}")]
    Unavailable {
        /// Its address.
        address: String,
        /// The cause.
        cause: String,
    },
}

/// Reasons why a shared queue is not used at all.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address has the wrong form.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// This server may not use it.
    #[error("the shared queue {address} refuses the credentials or the rights of this server: {cause}")]
    Refused {
        /// The address.
        address: String,
        /// The answer.
        cause: String,
    },
    /// A stream or bucket of its name was made by somebody else, or with other settings.
    #[error(
        "the shared queue {address}: {name} in JetStream has {what} {found}, and this server needs {needed}; give the \
         servers another NAME in --queue, or the same settings"
    )]
    Other {
        /// The address.
        address: String,
        /// The stream.
        name: String,
        /// The setting.
        what: &'static str,
        /// Its value.
        found: String,
        /// The value that it should have.
        needed: String,
    },
    /// JetStream does not make what the queue needs.
    #[error("the shared queue {address} cannot be used: {cause}")]
    Setup {
        /// The address.
        address: String,
        /// The answer.
        cause: String,
    },
    /// It cannot be reached.
    #[error("the shared queue {address} cannot be reached: {cause}")]
    Unreachable {
        /// The address.
        address: String,
        /// The cause.
        cause: String,
    },
    /// The file of credentials or certificates cannot be used.
    #[error("{setting}: {cause}")]
    File {
        /// The setting.
        setting: &'static str,
        /// The cause.
        cause: String,
    },
}

/// The settings of a shared queue.
#[derive(Clone, Debug)]
pub struct QueueSettings {
    /// Its address.
    pub address: Address,
    /// The file with the credentials of NATS.
    pub credentials: Option<PathBuf>,
    /// The file of certificates in PEM by which the servers are trusted.
    pub ca: Option<PathBuf>,
    /// The name of the store that has its jobs.
    pub store: String,
    /// Most jobs that wait, of all daemons.
    pub jobs_max: u64,
    /// The time after which notes are forgotten.
    pub note_time: Duration,
}

/// The kinds of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A job is to be done.
    Job,
    /// A job is to be done by a daemon with a GPU.
    GpuJob,
    /// A webhook is to be told of a job's end.
    Webhook,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Job, Self::GpuJob, Self::Webhook];
}

/// The common knowledge of all daemons about a job that has not ended. It decides nothing but the answers to clients
/// meanwhile.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Note {
    /// The party that asked for it.
    pub owner: String,
    /// The time of acceptance in milliseconds since 1970.
    pub accepted_unix_ms: u64,
    /// The number of times that a daemon has begun it.
    #[serde(default)]
    pub starts: u32,
    /// A daemon does it at this moment.
    #[serde(default)]
    pub is_running: bool,
    /// Its end is in the store.
    #[serde(default)]
    pub has_ended: bool,
    /// The name of the step that it is at.
    #[serde(default)]
    pub step: String,
    /// Views that are drawn.
    #[serde(default)]
    pub drawn: u32,
    /// All views.
    #[serde(default)]
    pub views: u32,
}

/// The load of the queue, of all daemons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueueLoad {
    /// Jobs that wait or are being done, without those that ask for a GPU.
    pub jobs: u64,
    /// Those that do.
    pub gpu_jobs: u64,
    /// Ends that webhooks have not been told of.
    pub webhooks: u64,
    /// Jobs that were given to a daemon more than once, and are not acknowledged.
    pub redelivered: u64,
    /// Jobs that were given up.
    pub dead: u64,
    /// The age of the oldest job.
    pub oldest: Duration,
}
