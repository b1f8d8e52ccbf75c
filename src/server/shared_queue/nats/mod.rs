//! The shared queue on NATS JetStream, through the crate async-nats.

mod delivery;
mod list;
mod news;
mod prepare;

pub use delivery::{Delivery, Following};
pub use list::{list_dead, list_live};
pub use news::{Heard, News, Question};

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use async_nats::jetstream::Context;
use async_nats::jetstream::consumer::PullConsumer;
use async_nats::jetstream::kv::{self, CreateErrorKind, Operation, UpdateErrorKind};
use async_nats::jetstream::message::PublishMessage;
use async_nats::jetstream::stream::{LastRawMessageErrorKind, Stream};
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

/// Time after which streams that were found or made are looked for again when something fails.
const PREPARE_EVERY: Duration = Duration::from_secs(1);

/// Time in which the files of a stream that was deleted are gone. One that is made anew before takes no messages (NATS 2.9.10).
const DELETION_TIME: Duration = Duration::from_millis(500);

/// The longest time between two attempts to reach it at the start.
const ATTEMPT_EVERY_MAX: Duration = Duration::from_secs(10);

/// The shared queue.
pub struct SharedQueue {
    client: Client,
    context: Context,
    settings: QueueSettings,
    handles: RwLock<Arc<Handles>>,
}

/// The streams and the bucket of the queue in JetStream. They are replaced when they were lost and made anew.
struct Handles {
    jobs: Place,
    gpu_jobs: Place,
    webhooks: Place,
    notes: kv::Store,
    dead: Stream,
    since: Instant,
}

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

    /// The inner error is one that may pass.
    async fn try_open(settings: &QueueSettings) -> Result<Result<Self, String>, OpenError> {
        let (client, context) = match connect(settings).await? {
            Ok(connected) => connected,
            Err(cause) => return Ok(Err(cause)),
        };
        match prepare(&context, settings).await {
            Ok(handles) => {
                let handles = RwLock::new(Arc::new(handles));
                Ok(Ok(Self { client, context, settings: settings.clone(), handles }))
            }
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
        let sent = self.twice(|_| async move {
            let message = PublishMessage::build().message_id(name);
            let sending = self.context.send_publish(self.subject(kind, key), message).await.map_err(to_words)?;
            match sending.await.map_err(to_words) {
                Ok(_) => Ok(true),
                Err(words) if words.contains("maximum messages exceeded") => Ok(false),
                Err(words) => Err(words),
            }
        });
        if sent.await? { Ok(()) } else { Err(QueueError::Full) }
    }

    /// Waits for a message, no longer than some seconds. Dropped before its end, it may leave a message to nobody until
    /// [`ACK_WAIT`](crate::shared_queue::ACK_WAIT) has passed.
    pub async fn take(&self, kind: Kind) -> Result<Option<Delivery>, QueueError> {
        let taken = self.twice(|handles| async move {
            let taking = async {
                let batch = handles.place(kind).consumer.batch().max_messages(1).expires(TAKE_TIME);
                let mut batch = batch.messages().await.map_err(to_words)?;
                batch.next().await.transpose().map_err(|error| words_of(&*error))
            };
            let taken = tokio::time::timeout(TAKE_TIME + ANSWER_TIME, taking).await;
            taken.unwrap_or_else(|_| Err("no answer".to_owned()))
        });
        Ok(taken.await?.map(|message| Delivery { message }))
    }

    /// The jobs about which there are messages that are not acknowledged.
    pub async fn live(&self, kind: Kind) -> Result<HashSet<JobKey>, QueueError> {
        let filter = format!("{}.{}.*", self.settings.address.name, word_of(kind));
        let filter = &filter;
        let keys = self.twice(|handles| async move { keys_in(&handles.place(kind).stream, filter).await });
        Ok(keys.await?.into_iter().collect())
    }

    /// Removes the message about a job.
    pub async fn remove(&self, kind: Kind, key: JobKey) -> Result<(), QueueError> {
        let subject = &self.subject(kind, key);
        let removing = self.twice(|handles| async move {
            let stream = &handles.place(kind).stream;
            // After a purge of the subject, NATS 2.9.10 delivers other messages that were not acknowledged no more.
            match stream.get_last_raw_message_by_subject(subject).await {
                Ok(message) => stream.delete_message(message.sequence).await.map(drop).map_err(to_words),
                Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(()),
                Err(error) => Err(words_of(&error)),
            }
        });
        removing.await
    }

    /// The note on a job, and its age.
    pub async fn note(&self, key: JobKey) -> Result<Option<(Note, Duration)>, QueueError> {
        self.twice(|handles| async move { note_of(&handles.notes, key).await }).await
    }

    /// Replaces the note on a job, and tells those who follow it.
    pub async fn set_note(&self, key: JobKey, note: &Note) -> Result<(), QueueError> {
        let bytes = Bytes::from(serde_json::to_vec(note).unwrap_or_default());
        let bytes = &bytes;
        let setting = self.twice(|handles| async move {
            handles.notes.put(name_of(key), bytes.clone()).await.map(drop).map_err(to_words)
        });
        setting.await
    }

    /// Follows the notes on a job from now on. Notes may be missed while NATS cannot be reached.
    pub async fn follow(&self, key: JobKey) -> Result<Following, QueueError> {
        // A bucket is a stream of the subjects of its keys, and who listens to a subject hears of it at once.
        self.check_connection()?;
        let subject = format!("{}{}", self.handles.read().await.notes.prefix, name_of(key));
        match tokio::time::timeout(ANSWER_TIME, self.client.subscribe(subject)).await {
            Ok(Ok(notes)) => Ok(Following { notes }),
            Ok(Err(error)) => Err(self.error(error.to_string())),
            Err(_) => Err(self.error("no answer".to_owned())),
        }
    }

    /// Takes a lease, or makes it last longer. False if another holder has it. The clocks of the machines decide when it
    /// has ended.
    pub async fn lease(&self, name: &str, holder: &str, time: Duration) -> Result<bool, QueueError> {
        let until_unix_ms = unix_ms() + u64::try_from(time.as_millis()).unwrap_or(u64::MAX);
        let lease = &Lease { holder: holder.to_owned(), until_unix_ms };
        self.twice(|handles| async move { take_lease(&handles.notes, &format!("lease.{name}"), lease).await }).await
    }

    /// Gives a lease back. It ends by itself where that fails.
    pub async fn release(&self, name: &str) {
        let handles = self.handles.read().await.clone();
        if self.is_connected() {
            let _ = tokio::time::timeout(ANSWER_TIME, handles.notes.delete(format!("lease.{name}"))).await;
        }
    }

    /// The load of the queue.
    pub async fn load(&self) -> Result<QueueLoad, QueueError> {
        self.twice(|handles| async move {
            let mut load = QueueLoad::default();
            for kind in Kind::ALL {
                let Place { stream, consumer } = handles.place(kind);
                let state = stream.get_info().await.map_err(to_words)?.state;
                *match kind {
                    Kind::Job => &mut load.jobs,
                    Kind::GpuJob => &mut load.gpu_jobs,
                    Kind::Webhook => &mut load.webhooks,
                } = state.messages;
                if kind == Kind::Webhook {
                    continue;
                }
                load.redelivered += consumer.get_info().await.map_err(to_words)?.num_redelivered as u64;
                if state.messages > 0 {
                    let age = Duration::from_secs(seconds_since(state.first_timestamp.unix_timestamp()));
                    load.oldest = load.oldest.max(age);
                }
            }
            load.dead = handles.dead.get_info().await.map_err(to_words)?.state.messages;
            Ok(load)
        })
        .await
    }

    /// Keeps a job that was given up, with the reason, for people to look at.
    pub async fn bury(&self, key: JobKey, letter: Vec<u8>) -> Result<(), QueueError> {
        let letter = &Bytes::from(letter);
        let burying = self.twice(|_| async move {
            let subject = format!("{}.dead.{}", self.settings.address.name, name_of(key));
            let sending = self.context.publish(subject, letter.clone()).await.map_err(to_words)?;
            sending.await.map(drop).map_err(to_words)
        });
        burying.await
    }

    /// Does something with the streams and the bucket. If that fails, they may be gone: they are made anew, and it is done
    /// once more.
    async fn twice<T, F: Future<Output = Result<T, String>>>(
        &self,
        does: impl Fn(Arc<Handles>) -> F,
    ) -> Result<T, QueueError> {
        self.check_connection()?;
        let handles = self.handles.read().await.clone();
        let since = handles.since;
        let cause = match does(handles).await {
            Ok(done) => return Ok(done),
            Err(cause) => cause,
        };
        tracing::debug!(cause, "an operation of the shared queue is tried again");
        tokio::time::sleep(DELETION_TIME).await;
        self.check_connection()?;
        if since.elapsed() < PREPARE_EVERY {
            let handles = self.handles.read().await.clone();
            return does(handles).await.map_err(|cause| self.error(cause));
        }
        let made = prepare(&self.context, &self.settings).await.map_err(|error| match error {
            Unprepared::ForNow(cause) => self.error(cause),
            Unprepared::ForGood(error) => self.error(error.to_string()),
        })?;
        let made = Arc::new(made);
        *self.handles.write().await = made.clone();
        does(made).await.map_err(|cause| self.error(cause))
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

impl Handles {
    fn place(&self, kind: Kind) -> &Place {
        match kind {
            Kind::Job => &self.jobs,
            Kind::GpuJob => &self.gpu_jobs,
            Kind::Webhook => &self.webhooks,
        }
    }
}

async fn take_lease(notes: &kv::Store, name: &str, lease: &Lease) -> Result<bool, String> {
    let bytes = Bytes::from(serde_json::to_vec(lease).unwrap_or_default());
    match notes.create(name, bytes.clone()).await {
        Ok(_) => return Ok(true),
        Err(error) if error.kind() == CreateErrorKind::AlreadyExists => {}
        Err(error) => return Err(words_of(&error)),
    }
    let Some(entry) = notes.entry(name).await.map_err(to_words)? else { return Ok(false) };
    let known: Option<Lease> = serde_json::from_slice(&entry.value).ok();
    let is_taken = |known: &Lease| known.holder != lease.holder && known.until_unix_ms > unix_ms();
    if entry.operation == Operation::Put && known.as_ref().is_some_and(is_taken) {
        return Ok(false);
    }
    match notes.update(name, bytes, entry.revision).await {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => Ok(false),
        Err(error) => Err(words_of(&error)),
    }
}

async fn note_of(notes: &kv::Store, key: JobKey) -> Result<Option<(Note, Duration)>, String> {
    let found = notes.entry(name_of(key)).await.map_err(to_words)?;
    let Some(entry) = found.filter(|entry| entry.operation == Operation::Put) else { return Ok(None) };
    let age = Duration::from_secs(seconds_since(entry.created.unix_timestamp()));
    Ok(serde_json::from_slice(&entry.value).ok().map(|note| (note, age)))
}

/// The jobs whose subjects in a stream match a filter.
async fn keys_in(stream: &Stream, filter: &str) -> Result<Vec<JobKey>, String> {
    let subjects = stream.info_with_subjects(filter).await.map_err(to_words)?;
    let subjects: Vec<(String, usize)> = subjects.try_collect().await.map_err(to_words)?;
    Ok(subjects.iter().filter_map(|(subject, _)| key_of(subject)).collect())
}

fn word_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Job => "jobs",
        Kind::GpuJob => "gpu",
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
