//! The shared queue on NATS JetStream, through the crate async-nats.

use std::collections::HashSet;
use std::time::{Duration, SystemTime};

use async_nats::jetstream::consumer::{AckPolicy, PullConsumer, pull};
use async_nats::jetstream::context::ContextBuilder;
use async_nats::jetstream::kv::{self, CreateErrorKind, Operation, UpdateErrorKind};
use async_nats::jetstream::message::PublishMessage;
use async_nats::jetstream::stream::{self, DiscardPolicy, RetentionPolicy, Stream};
use async_nats::jetstream::{AckKind, Context, Message};
use async_nats::{Client, ConnectErrorKind, ConnectOptions, Event, Subscriber, connection};
use futures_util::StreamExt as _;
use serde::{Deserialize, Serialize};
use tokio::sync::RwLock;

use super::{ACK_WAIT, Kind, Note, OpenError, QueueError, QueueLoad, QueueSettings};
use crate::durable::JobKey;

/// The longest time for which an answer of NATS is waited for.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// The longest time for which [`SharedQueue::take`] waits for a message.
const TAKE_TIME: Duration = Duration::from_secs(2);

/// The time within which a message that was sent under the same name is the same message.
const DUPLICATE_TIME: Duration = Duration::from_secs(120);

/// The longest time between two attempts to reach it at the start.
const ATTEMPT_EVERY_MAX: Duration = Duration::from_secs(10);

/// Messages that may be with daemons at a time: more than there are workers.
const ON_WAY_MAX: i64 = 100_000;

/// Daemons that may wait for messages at a time.
const WAITING_MAX: i64 = 10_000;

/// The name of the consumer that all daemons share.
const CONSUMER: &str = "servers";

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
    webhooks: Place,
    notes: kv::Store,
}

#[derive(Clone)]
struct Place {
    stream: Stream,
    consumer: PullConsumer,
}

/// A message that this daemon has.
pub struct Delivery {
    message: Message,
}

/// The notes on a job, as they change.
pub struct Following {
    notes: Subscriber,
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
        let address = settings.address.words();
        let options = options_of(settings).await?;
        let client = match options.connect(settings.address.servers.as_slice()).await {
            Ok(client) => client,
            Err(error) => {
                let cause = words_of(&error);
                return match error.kind() {
                    ConnectErrorKind::Authentication | ConnectErrorKind::AuthorizationViolation => {
                        Err(OpenError::Refused { address, cause })
                    }
                    ConnectErrorKind::ServerParse => Err(OpenError::Setup { address, cause }),
                    _ => Ok(Err(cause)),
                };
            }
        };
        let context = ContextBuilder::new().timeout(ANSWER_TIME).ack_timeout(ANSWER_TIME).build(client.clone());
        match prepare(&context, settings).await {
            Ok(handles) => Ok(Ok(Self { client, context, settings: settings.clone(), handles: RwLock::new(handles) })),
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
    /// [`ACK_WAIT`] has passed.
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
        let mut subjects = match stream.info_with_subjects(self.subjects(kind)).await {
            Ok(subjects) => subjects,
            Err(error) => {
                self.prepare_again().await?;
                return Err(self.unavailable(&error));
            }
        };
        let mut live = HashSet::new();
        while let Some(subject) = subjects.next().await {
            let (subject, _) = subject.map_err(|error| self.unavailable(&error))?;
            live.extend(key_of(&subject));
        }
        Ok(live)
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
        let Handles { jobs, webhooks, .. } = self.handles.read().await.clone();
        let of_jobs = jobs.stream.get_info().await.map_err(|error| self.unavailable(&error))?;
        let of_webhooks = webhooks.stream.get_info().await.map_err(|error| self.unavailable(&error))?;
        let consumer = jobs.consumer.get_info().await.map_err(|error| self.unavailable(&error))?;
        let oldest = match of_jobs.state.messages {
            0 => 0,
            _ => seconds_since(of_jobs.state.first_timestamp.unix_timestamp()),
        };
        Ok(QueueLoad {
            jobs: of_jobs.state.messages,
            webhooks: of_webhooks.state.messages,
            redelivered: consumer.num_redelivered as u64,
            oldest: Duration::from_secs(oldest),
        })
    }

    async fn place(&self, kind: Kind) -> Place {
        let handles = self.handles.read().await;
        match kind {
            Kind::Job => handles.jobs.clone(),
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

    fn subjects(&self, kind: Kind) -> String {
        format!("{}.{}.*", self.settings.address.name, word_of(kind))
    }

    fn unavailable(&self, error: &(dyn std::error::Error + 'static)) -> QueueError {
        self.error(words_of(error))
    }

    fn error(&self, cause: String) -> QueueError {
        QueueError::Unavailable { address: self.settings.address.words(), cause }
    }
}

impl Following {
    /// The next note. None if there will be no more.
    pub async fn next(&mut self) -> Option<Note> {
        loop {
            let message = self.notes.next().await?;
            // What is no note is the end of one.
            if let Ok(note) = serde_json::from_slice(&message.payload) {
                return Some(note);
            }
        }
    }
}

impl Delivery {
    /// The job that it is about. None if the message was sent by somebody else.
    pub fn key(&self) -> Option<JobKey> {
        key_of(&self.message.subject)
    }

    /// Keeps the message for longer.
    pub async fn sign_of_life(&self) {
        let _ = tokio::time::timeout(ANSWER_TIME, self.message.ack_with(AckKind::Progress)).await;
    }

    /// Lets another daemon have it, after a while.
    pub async fn give_back(&self, after: Duration) {
        let _ = tokio::time::timeout(ANSWER_TIME, self.message.ack_with(AckKind::Nak(Some(after)))).await;
    }

    /// Ends the message. Returns once JetStream has said that it has. If it does not, the message comes again.
    pub async fn end(&self) {
        if let Ok(Err(error)) = tokio::time::timeout(ANSWER_TIME, self.message.double_ack()).await {
            tracing::info!(%error, "a message of the shared queue may come again");
        }
    }
}

enum Unprepared {
    ForNow(String),
    ForGood(OpenError),
}

async fn options_of(settings: &QueueSettings) -> Result<ConnectOptions, OpenError> {
    let mut options = ConnectOptions::new()
        .name("meshsnap")
        .connection_timeout(ANSWER_TIME)
        .request_timeout(Some(ANSWER_TIME))
        .ping_interval(Duration::from_secs(5))
        .event_callback(|event| async move {
            match event {
                Event::Connected => tracing::info!("connected to the shared queue"),
                Event::Disconnected => tracing::error!("the shared queue cannot be reached"),
                other => tracing::warn!(event = %other, "the shared queue"),
            }
        });
    if let Some((user, password)) = settings.address.login.clone() {
        options = options.user_and_password(user, password);
    }
    if let Some(path) = &settings.credentials {
        let error = |cause: std::io::Error| OpenError::File {
            setting: "--queue-credentials-file",
            cause: format!("{}: {cause}", path.display()),
        };
        options = options.credentials_file(path).await.map_err(error)?;
    }
    if let Some(path) = &settings.ca {
        let error = |cause: std::io::Error| OpenError::File {
            setting: "--queue-ca",
            cause: format!("{}: {cause}", path.display()),
        };
        tokio::fs::metadata(path).await.map_err(error)?;
        options = options.add_root_certificates(path.clone());
    }
    Ok(options)
}

/// Finds or makes what JetStream has of the queue.
async fn prepare(context: &Context, settings: &QueueSettings) -> Result<Handles, Unprepared> {
    let jobs = place_of(context, settings, Kind::Job).await?;
    let webhooks = place_of(context, settings, Kind::Webhook).await?;
    let bucket = &settings.address.name;
    // A bucket is a stream of this form. The crate's own call would ask for the account's reservations, of which NATS 2.9
    // says nothing.
    let config = stream::Config {
        name: format!("KV_{bucket}"),
        description: Some("What servers of meshsnap know of their jobs".to_owned()),
        subjects: vec![format!("$KV.{bucket}.>")],
        max_messages_per_subject: 1,
        max_age: settings.note_time,
        discard: DiscardPolicy::New,
        allow_rollup: true,
        deny_delete: true,
        allow_direct: true,
        ..stream::Config::default()
    };
    context.get_or_create_stream(config).await.map_err(|error| unprepared(settings, &error))?;
    let notes = context.get_key_value(bucket).await.map_err(|error| unprepared(settings, &error))?;
    Ok(Handles { jobs, webhooks, notes })
}

async fn place_of(context: &Context, settings: &QueueSettings, kind: Kind) -> Result<Place, Unprepared> {
    let (name, word) = (&settings.address.name, word_of(kind));
    let wanted = stream::Config {
        name: format!("{name}-{word}"),
        description: Some(format!("The {word} of servers of meshsnap")),
        subjects: vec![format!("{name}.{word}.*")],
        retention: RetentionPolicy::WorkQueue,
        discard: DiscardPolicy::New,
        max_messages: i64::try_from(settings.jobs_max).unwrap_or(i64::MAX),
        duplicate_window: DUPLICATE_TIME,
        ..stream::Config::default()
    };
    let made = context.get_or_create_stream(wanted.clone()).await;
    let mut stream = made.map_err(|error| unprepared(settings, &error))?;
    let found = stream.info().await.map_err(|error| unprepared(settings, &error))?.config.clone();
    let texts = |config: &stream::Config| {
        [
            ("retention", format!("{:?}", config.retention)),
            ("discard policy", format!("{:?}", config.discard)),
            ("subjects", config.subjects.join(" ")),
            ("max_msgs", config.max_messages.to_string()),
        ]
    };
    for ((what, found), (_, needed)) in texts(&found).into_iter().zip(texts(&wanted)) {
        if found != needed {
            let (address, name) = (settings.address.words(), wanted.name);
            return Err(Unprepared::ForGood(OpenError::Other { address, name, what, found, needed }));
        }
    }
    let config = pull::Config {
        durable_name: Some(CONSUMER.to_owned()),
        ack_policy: AckPolicy::Explicit,
        ack_wait: ACK_WAIT,
        max_deliver: -1,
        max_ack_pending: ON_WAY_MAX,
        max_waiting: WAITING_MAX,
        ..pull::Config::default()
    };
    let consumer =
        stream.get_or_create_consumer(CONSUMER, config).await.map_err(|error| unprepared(settings, &error))?;
    Ok(Place { stream, consumer })
}

/// An answer of JetStream that says no is for good; none at all, or one of a server that only starts, may pass.
fn unprepared(settings: &QueueSettings, error: &(dyn std::error::Error + 'static)) -> Unprepared {
    let cause = words_of(error);
    let may_pass = ["timed out", "not available", "temporarily unavailable", "no suitable peers", "offline"];
    if may_pass.iter().any(|words| cause.contains(words)) {
        return Unprepared::ForNow(cause);
    }
    Unprepared::ForGood(OpenError::Setup { address: settings.address.words(), cause })
}

fn word_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Job => "jobs",
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
