//! The connection to NATS, and what JetStream has of a queue: it is found there, or made.

use std::time::{Duration, Instant};

use async_nats::jetstream::consumer::{AckPolicy, pull};
use async_nats::jetstream::stream::{self, DiscardPolicy, RetentionPolicy, StorageType};
use async_nats::jetstream::{Context, context::ContextBuilder};
use async_nats::{Client, ConnectErrorKind, ConnectOptions, Event};

use super::{ANSWER_TIME, Handles, Place, word_of, words_of};
use crate::shared_queue::{ACK_WAIT, Kind, OpenError, QueueSettings};

/// The time within which a message that was sent under the same name is the same message.
const DUPLICATE_TIME: Duration = Duration::from_secs(120);

/// Messages that may be with daemons at a time: more than there are workers.
const ON_WAY_MAX: i64 = 100_000;

/// Daemons that may wait for messages at a time.
const WAITING_MAX: i64 = 10_000;

/// The name of the consumer that all daemons share.
const CONSUMER: &str = "servers";

/// The number of dead letters that are kept, and their age.
const DEAD: (i64, Duration) = (10_000, Duration::from_secs(30 * 24 * 3600));

/// The first line of a certificate in PEM.
const CERTIFICATE: &[u8] = b"-----BEGIN CERTIFICATE-----";

/// Reasons why a queue is not ready.
pub(super) enum Unprepared {
    /// It may be later.
    ForNow(String),
    /// It will never be.
    ForGood(OpenError),
}

/// A connection to NATS. The inner error is one that may pass.
pub(super) async fn connect(settings: &QueueSettings) -> Result<Result<(Client, Context), String>, OpenError> {
    let address = settings.address.words();
    let options = options_of(settings).await?;
    match options.connect(settings.address.servers.as_slice()).await {
        Ok(client) => {
            let context = ContextBuilder::new().timeout(ANSWER_TIME).ack_timeout(ANSWER_TIME).build(client.clone());
            Ok(Ok((client, context)))
        }
        Err(error) => {
            let cause = words_of(&error);
            match error.kind() {
                ConnectErrorKind::Authentication | ConnectErrorKind::AuthorizationViolation => {
                    Err(OpenError::Refused { address, cause })
                }
                ConnectErrorKind::ServerParse => Err(OpenError::Setup { address, cause }),
                _ => Ok(Err(cause)),
            }
        }
    }
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
                // One for each attempt to connect again.
                Event::ClientError(error) => tracing::debug!(%error, "the shared queue"),
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
        let text = tokio::fs::read(path).await.map_err(error)?;
        if !text.windows(CERTIFICATE.len()).any(|part| part == CERTIFICATE) {
            return Err(error(std::io::Error::other("it has no certificate in PEM")));
        }
        options = options.add_root_certificates(path.clone());
    }
    Ok(options)
}

/// Finds or makes what JetStream has of the queue.
pub(super) async fn prepare(context: &Context, settings: &QueueSettings) -> Result<Handles, Unprepared> {
    let jobs = place_of(context, settings, Kind::Job).await?;
    let gpu_jobs = place_of(context, settings, Kind::GpuJob).await?;
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
    let dead = context.get_or_create_stream(dead_letters(&settings.address.name)).await;
    let dead = dead.map_err(|error| unprepared(settings, &error))?;
    Ok(Handles { jobs, gpu_jobs, webhooks, notes, dead, since: Instant::now() })
}

/// The stream of dead letters. The oldest go first.
fn dead_letters(name: &str) -> stream::Config {
    stream::Config {
        name: format!("{name}-dead"),
        description: Some("Jobs that servers of meshsnap gave up".to_owned()),
        subjects: vec![format!("{name}.dead.*")],
        storage: StorageType::File,
        discard: DiscardPolicy::Old,
        max_messages: DEAD.0,
        max_age: DEAD.1,
        max_messages_per_subject: 1,
        ..stream::Config::default()
    }
}

async fn place_of(context: &Context, settings: &QueueSettings, kind: Kind) -> Result<Place, Unprepared> {
    let (name, word) = (&settings.address.name, word_of(kind));
    let wanted = stream::Config {
        name: format!("{name}-{word}"),
        description: Some(format!("meshsnap, store {}", settings.store)),
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
            // Its jobs are in one store: servers with another would take their messages, and find nothing.
            ("description", config.description.clone().unwrap_or_default()),
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
