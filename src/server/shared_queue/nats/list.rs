//! Lists of what a queue has, for people. Nothing is made in JetStream.

use async_nats::jetstream::context::GetStreamErrorKind;
use async_nats::jetstream::stream::{LastRawMessageErrorKind, Stream};
use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _, stream};

use super::prepare::connect;
use super::{keys_in, name_of, note_of, word_of, words_of};
use crate::durable::JobKey;
use crate::shared_queue::{Kind, Note, OpenError, QueueSettings};

/// Questions to NATS at a time.
const ASKED: usize = 32;

/// The jobs of a queue that have not ended, with what is known of them.
pub async fn list_live(settings: &QueueSettings) -> Result<Vec<(JobKey, Option<Note>)>, OpenError> {
    let (name, error) = (&settings.address.name, |cause| setup(settings, cause));
    let (_, context) = reach(settings).await?;
    let mut keys = Vec::new();
    for kind in [Kind::Job, Kind::GpuJob] {
        let word = word_of(kind);
        if let Some(jobs) = found(settings, context.get_stream(format!("{name}-{word}")).await)? {
            keys.extend(keys_in(&jobs, &format!("{name}.{word}.*")).await.map_err(error)?);
        } else if kind == Kind::Job {
            return Err(error("there is no queue of this name".to_owned()));
        }
    }
    let notes = context.get_key_value(name).await.map_err(|cause| error(words_of(&cause)))?;
    let notes = &notes;
    let jobs = stream::iter(keys).map(|key| async move { Ok((key, note_of(notes, key).await?.map(|(note, _)| note))) });
    jobs.buffered(ASKED).try_collect().await.map_err(error)
}

/// The dead letters of a queue.
pub async fn list_dead(settings: &QueueSettings) -> Result<Vec<(JobKey, Bytes)>, OpenError> {
    let (name, error) = (&settings.address.name, |cause| setup(settings, cause));
    let (_, context) = reach(settings).await?;
    let Some(dead) = found(settings, context.get_stream(format!("{name}-dead")).await)? else {
        return Err(error("there is no queue of this name".to_owned()));
    };
    let keys = keys_in(&dead, &format!("{name}.dead.*")).await.map_err(error)?;
    let dead = &dead;
    let letters = stream::iter(keys).map(|key| async move {
        match dead.get_last_raw_message_by_subject(&format!("{name}.dead.{}", name_of(key))).await {
            Ok(letter) => Ok(Some((key, letter.payload))),
            // It has become too old in this moment.
            Err(cause) if cause.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(None),
            Err(cause) => Err(words_of(&cause)),
        }
    });
    let letters: Vec<Option<_>> = letters.buffered(ASKED).try_collect().await.map_err(error)?;
    Ok(letters.into_iter().flatten().collect())
}

async fn reach(settings: &QueueSettings) -> Result<(async_nats::Client, async_nats::jetstream::Context), OpenError> {
    let address = settings.address.words();
    connect(settings).await?.map_err(|cause| OpenError::Unreachable { address, cause })
}

/// None for a stream that is missing.
fn found(
    settings: &QueueSettings,
    outcome: Result<Stream, async_nats::jetstream::context::GetStreamError>,
) -> Result<Option<Stream>, OpenError> {
    match outcome {
        Ok(stream) => Ok(Some(stream)),
        Err(error) => match error.kind() {
            GetStreamErrorKind::JetStream(cause) if cause.code() == 404 => Ok(None),
            _ => Err(setup(settings, words_of(&error))),
        },
    }
}

fn setup(settings: &QueueSettings, cause: String) -> OpenError {
    OpenError::Setup { address: settings.address.words(), cause }
}
