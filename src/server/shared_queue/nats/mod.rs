//! The shared queue on NATS JetStream, through the crate async-nats.

mod delivery;
mod news;
mod prepare;

pub use delivery::{Delivery, Following};
pub use news::{Heard, News, Question};

use std::collections::HashSet;
use std::time::{Duration, SystemTime};

use async_nats::jetstream::Context;
use async_nats::jetstream::consumer::PullConsumer;
use async_nats::jetstream::context::GetStreamErrorKind;
use async_nats::jetstream::kv::{self, CreateErrorKind, Operation, UpdateErrorKind};
use async_nats::jetstream::message::PublishMessage;
use async_nats::jetstream::stream::Stream;
use async_nats::{Client, connection};
use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _};
use serde::{Deserialize, Serialize};
use tokio::sync::RwLock;

use self::prepare::{Unprepared, connect, prepare};
use super::{Kind, Note, OpenError, QueueError, QueueLoad, QueueSettings};
use crate::durable::JobKey;

/// The longest time for which an answer of NATS is waited for.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// The longest time for which [`SharedQueue::take`] waits for a message.
const TAKE_TIME: Duration = Duration::from_secs(2);

/// The longest time between two attempts to reach it at the start.
const ATTEMPT_EVERY_MAX: Duration = Duration::from_secs(10);

/// The shared queue.
pub struct SharedQueue {
    client: Client,
    context: Context,
    settings: QueueSettings,
    handles: RwLock<Handles>,
}

/// The streams and the bucket of the queue in JetStream. They are replaced when they were lost and made anew.
#[derive(Clone)]
struct Handles {
    jobs: Place,
    gpu_jobs: Place,
    webhooks: Place,
    notes: kv::Store,
    dead: Stream,
}

#[derive(Clone)]
struct Place {
    stream: Stream,
    consumer: PullConsumer,
}

#[derive(Serialize, Deserialize)]
struct Lease {
    holder: String,
    until_unix_ms: u64,
}

impl SharedQueue {
    /// Opens the queue, which is made if it is missing, and returns once that is done. While NATS cannot be reached,
    /// tries again; the log says so.
    pub async fn open(settings: QueueSettings) -> Result<Self, OpenError> {
        let mut pause = Duration::from_millis(250);
        loop {
            let cause = match Self::try_open(&settings).await? {
                Ok(queue) => return Ok(queue),
                Err(cause) => cause,
            };
            tracing::warn!(address = settings.address.words(), cause, "waiting for the shared queue");
            tokio::time::sleep(pause).await;
            pause = (2 * pause).min(ATTEMPT_EVERY_MAX);
        }
    }

    /// Opens a queue that servers have made, and makes nothing. Does not wait for a NATS that cannot be reached.
    pub async fn open_made(settings: QueueSettings) -> Result<Self, OpenError> {
        let address = settings.address.words();
        let (client, context) = match connect(&settings).await? {
            Ok(connected) => connected,
            Err(cause) => return Err(OpenError::Unreachable { address, cause }),
        };
        if let Err(error) = context.get_stream(format!("{}-{}", settings.address.name, word_of(Kind::Job))).await {
            let cause = match error.kind() {
                GetStreamErrorKind::JetStream(error) if error.code() == 404 => {
                    "there is no queue of this name".to_owned()
                }
                _ => words_of(&error),
            };
            return Err(OpenError::Setup { address, cause });
        }
        Self::with(client, context, settings).await?.map_err(|cause| OpenError::Unreachable { address, cause })
    }

    /// The inner error is one that may pass.
    async fn try_open(settings: &QueueSettings) -> Result<Result<Self, String>, OpenError> {
        match connect(settings).await? {
            Ok((client, context)) => Self::with(client, context, settings.clone()).await,
            Err(cause) => Ok(Err(cause)),
        }
    }

    async fn with(
        client: Client,
        context: Context,
        settings: QueueSettings,
    ) -> Result<Result<Self, String>, OpenError> {
        match prepare(&context, &settings).await {
            Ok(handles) => Ok(Ok(Self { client, context, settings, handles: RwLock::new(handles) })),
            Err(Unprepared::ForNow(cause)) => Ok(Err(cause)),
            Err(Unprepared::ForGood(error)) => Err(error),
        }
    }

    /// True if NATS can be reached.
    pub fn is_connected(&self) -> bool {
        self.client.connection_state() == connection::State::Connected
    }

    /// Sends a message about a job. One that was sent lately under the same `name` is not sent again.
    pub async fn send(&self, kind: Kind, key: JobKey, name: &str) -> Result<(), QueueError> {
        self.check_connection()?;
        let mut is_prepared = false;
        loop {
            let message = PublishMessage::build().message_id(name);
            let outcome = match self.context.send_publish(self.subject(kind, key), message).await {
                Ok(sending) => sending.await,
                Err(error) => Err(error),
            };
            match outcome {
                Ok(_) => return Ok(()),
                Err(error) if words_of(&error).contains("maximum messages exceeded") => return Err(QueueError::Full),
                Err(error) if is_prepared => return Err(self.unavailable(&error)),
                // The stream may be gone.
                Err(_) => self.prepare_again().await?,
            }
            is_prepared = true;
        }
    }

    /// Waits for a message, no longer than some seconds. Dropped before its end, it may leave a message to nobody until
    /// [`ACK_WAIT`](crate::shared_queue::ACK_WAIT) has passed.
    pub async fn take(&self, kind: Kind) -> Result<Option<Delivery>, QueueError> {
        self.check_connection()?;
        let consumer = self.place(kind).await.consumer;
        let taking = async {
            let mut batch = consumer.batch().max_messages(1).expires(TAKE_TIME).messages().await.map_err(to_words)?;
            batch.next().await.transpose().map_err(|error| words_of(&*error))
        };
        match tokio::time::timeout(TAKE_TIME + ANSWER_TIME, taking).await {
            Ok(Ok(message)) => Ok(message.map(|message| Delivery { message })),
            Ok(Err(cause)) => {
                self.prepare_again().await?;
                Err(self.error(cause))
            }
            Err(_) => Err(self.error("no answer".to_owned())),
        }
    }

    /// The jobs about which there are messages that are not acknowledged.
    pub async fn live(&self, kind: Kind) -> Result<HashSet<JobKey>, QueueError> {
        self.check_connection()?;
        let stream = self.place(kind).await.stream;
        match self.subjects_in(&stream, &format!("{}.{}.*", self.settings.address.name, word_of(kind))).await {
            Ok(subjects) => Ok(subjects.iter().filter_map(|subject| key_of(subject)).collect()),
            Err(error) => {
                self.prepare_again().await?;
                Err(error)
            }
        }
    }

    /// The note on a job, and its age.
    pub async fn note(&self, key: JobKey) -> Result<Option<(Note, Duration)>, QueueError> {
        self.check_connection()?;
        let found = self.notes().await.entry(name_of(key)).await.map_err(|error| self.unavailable(&error))?;
        let Some(entry) = found.filter(|entry| entry.operation == Operation::Put) else { return Ok(None) };
        let age = Duration::from_secs(seconds_since(entry.created.unix_timestamp()));
        Ok(serde_json::from_slice(&entry.value).ok().map(|note| (note, age)))
    }

    /// Replaces the note on a job, and tells those who follow it.
    pub async fn set_note(&self, key: JobKey, note: &Note) -> Result<(), QueueError> {
        self.check_connection()?;
        let bytes = serde_json::to_vec(note).unwrap_or_default();
        self.notes().await.put(name_of(key), bytes.into()).await.map(drop).map_err(|error| self.unavailable(&error))
    }

    /// Follows the notes on a job from now on. Notes may be missed while NATS cannot be reached.
    pub async fn follow(&self, key: JobKey) -> Result<Following, QueueError> {
        // A bucket is a stream of the subjects of its keys, and who listens to a subject hears of it at once.
        self.check_connection()?;
        let subject = format!("{}{}", self.notes().await.prefix, name_of(key));
        match tokio::time::timeout(ANSWER_TIME, self.client.subscribe(subject)).await {
            Ok(Ok(notes)) => Ok(Following { notes }),
            Ok(Err(error)) => Err(self.error(error.to_string())),
            Err(_) => Err(self.error("no answer".to_owned())),
        }
    }

    /// Takes a lease, or makes it last longer. False if another holder has it. The clocks of the machines decide when it
    /// has ended.
    pub async fn lease(&self, name: &str, holder: &str, time: Duration) -> Result<bool, QueueError> {
        self.check_connection()?;
        let (notes, key) = (self.notes().await, format!("lease.{name}"));
        let until_unix_ms = unix_ms() + u64::try_from(time.as_millis()).unwrap_or(u64::MAX);
        let bytes = serde_json::to_vec(&Lease { holder: holder.to_owned(), until_unix_ms }).unwrap_or_default();
        match notes.create(&key, bytes.clone().into()).await {
            Ok(_) => return Ok(true),
            Err(error) if error.kind() == CreateErrorKind::AlreadyExists => {}
            Err(error) => return Err(self.unavailable(&error)),
        }
        let Some(entry) = notes.entry(&key).await.map_err(|error| self.unavailable(&error))? else { return Ok(false) };
        let known: Option<Lease> = serde_json::from_slice(&entry.value).ok();
        let is_taken = |lease: &Lease| lease.holder != holder && lease.until_unix_ms > unix_ms();
        if entry.operation == Operation::Put && known.as_ref().is_some_and(is_taken) {
            return Ok(false);
        }
        match notes.update(&key, bytes.into(), entry.revision).await {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => Ok(false),
            Err(error) => Err(self.unavailable(&error)),
        }
    }

    /// Gives a lease back. It ends by itself where that fails.
    pub async fn release(&self, name: &str) {
        let notes = self.notes().await;
        if self.is_connected() {
            let _ = tokio::time::timeout(ANSWER_TIME, notes.delete(format!("lease.{name}"))).await;
        }
    }

    /// The load of the queue.
    pub async fn load(&self) -> Result<QueueLoad, QueueError> {
        self.check_connection()?;
        let mut load = QueueLoad::default();
        for kind in Kind::ALL {
            let Place { stream, consumer } = self.place(kind).await;
            let state = stream.get_info().await.map_err(|error| self.unavailable(&error))?.state;
            *match kind {
                Kind::Job => &mut load.jobs,
                Kind::GpuJob => &mut load.gpu_jobs,
                Kind::Webhook => &mut load.webhooks,
            } = state.messages;
            if kind == Kind::Webhook {
                continue;
            }
            let consumer = consumer.get_info().await.map_err(|error| self.unavailable(&error))?;
            load.redelivered += consumer.num_redelivered as u64;
            if state.messages > 0 {
                let age = Duration::from_secs(seconds_since(state.first_timestamp.unix_timestamp()));
                load.oldest = load.oldest.max(age);
            }
        }
        load.dead =
            self.dead_letters().await.get_info().await.map_err(|error| self.unavailable(&error))?.state.messages;
        Ok(load)
    }

    /// Keeps a job that was given up, with the reason, for people to look at.
    pub async fn bury(&self, key: JobKey, letter: Vec<u8>) -> Result<(), QueueError> {
        self.check_connection()?;
        let subject = format!("{}.dead.{}", self.settings.address.name, name_of(key));
        let sent = match self.context.publish(subject, letter.into()).await {
            Ok(sent) => sent.await,
            Err(error) => Err(error),
        };
        sent.map(drop).map_err(|error| self.unavailable(&error))
    }

    /// The jobs that were given up, in the order of their names, which is that of their acceptance.
    pub async fn dead(&self) -> Result<Vec<Bytes>, QueueError> {
        let (stream, mut letters) = (self.dead_letters().await, Vec::new());
        let mut subjects = self.subjects_in(&stream, &format!("{}.dead.*", self.settings.address.name)).await?;
        subjects.sort();
        for subject in subjects {
            // One that has become too old meanwhile is left out.
            if let Ok(letter) = stream.get_last_raw_message_by_subject(&subject).await {
                letters.push(letter.payload);
            }
        }
        Ok(letters)
    }

    async fn dead_letters(&self) -> Stream {
        self.handles.read().await.dead.clone()
    }

    async fn subjects_in(&self, stream: &Stream, filter: &str) -> Result<Vec<String>, QueueError> {
        let found = stream.info_with_subjects(filter).await.map_err(|error| self.unavailable(&error))?;
        found
            .map(|subject| subject.map(|(subject, _)| subject).map_err(|error| self.unavailable(&error)))
            .try_collect()
            .await
    }

    async fn place(&self, kind: Kind) -> Place {
        let handles = self.handles.read().await;
        match kind {
            Kind::Job => handles.jobs.clone(),
            Kind::GpuJob => handles.gpu_jobs.clone(),
            Kind::Webhook => handles.webhooks.clone(),
        }
    }

    async fn notes(&self) -> kv::Store {
        self.handles.read().await.notes.clone()
    }

    /// Makes what is missing in JetStream.
    async fn prepare_again(&self) -> Result<(), QueueError> {
        self.check_connection()?;
        let handles = prepare(&self.context, &self.settings).await.map_err(|error| match error {
            Unprepared::ForNow(cause) => self.error(cause),
            Unprepared::ForGood(error) => self.error(error.to_string()),
        })?;
        *self.handles.write().await = handles;
        Ok(())
    }

    /// An error where NATS cannot be reached: the crate would wait.
    fn check_connection(&self) -> Result<(), QueueError> {
        if self.is_connected() { Ok(()) } else { Err(self.error("not connected".to_owned())) }
    }

    fn subject(&self, kind: Kind, key: JobKey) -> String {
        format!("{}.{}.{}", self.settings.address.name, word_of(kind), name_of(key))
    }

    fn unavailable(&self, error: &(dyn std::error::Error + 'static)) -> QueueError {
        self.error(words_of(error))
    }

    fn error(&self, cause: String) -> QueueError {
        QueueError::Unavailable { address: self.settings.address.words(), cause }
    }
}

fn word_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Job => "jobs",
        Kind::GpuJob => "gpu-jobs",
        Kind::Webhook => "webhooks",
    }
}

fn key_of(subject: &str) -> Option<JobKey> {
    let (_, name) = subject.rsplit_once('.')?;
    JobKey::from_str_radix(name, 16).ok()
}

fn name_of(key: JobKey) -> String {
    format!("{key:032x}")
}

/// An error with its causes, in one line.
fn words_of(error: &(dyn std::error::Error + 'static)) -> String {
    let mut words = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let text = cause.to_string();
        if !words.contains(&text) {
            words = format!("{words}: {text}");
        }
        source = cause.source();
    }
    words.replace('\n', " ")
}

fn to_words<E: std::error::Error + 'static>(error: E) -> String {
    words_of(&error)
}

fn seconds_since(unix_s: i64) -> u64 {
    let now_unix_s = i64::try_from(unix_ms() / 1000).unwrap_or(i64::MAX);
    now_unix_s.saturating_sub(unix_s).max(0).unsigned_abs()
}

fn unix_ms() -> u64 {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_1970.as_millis()).unwrap_or(u64::MAX)
}
