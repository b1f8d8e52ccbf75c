//! The jobs of a queue that several servers share: those that have not ended, or its dead letters.

use std::path::PathBuf;
use std::time::Duration;

use meshsnap_server::config::Config;
use meshsnap_server::durable::{EndRecord, ErrorRecord, JobKey, JobRecord, RecoveredJob};
use meshsnap_server::shared_queue::{Address, Note, OpenError, QueueSettings, list_dead, list_live};

use super::JobsArgs;
use crate::error::CliError;

/// Jobs of a queue, the oldest first.
pub enum Found {
    /// Jobs that have not ended, with what is known of them.
    Live(Vec<(JobKey, Option<Note>)>),
    /// Jobs that were given up.
    Dead(Vec<RecoveredJob>),
}

/// Looks into the queue at this address. Returns its name for messages, too.
pub fn find(address: &str, arguments: &JobsArgs) -> Result<(Found, String), CliError> {
    let address = Address::read(address).map_err(|error| CliError::usage(error.to_string()))?;
    let words = address.words();
    let defaults = Config::default();
    let file = |given: &Option<PathBuf>| given.clone().filter(|path| !path.as_os_str().is_empty());
    let settings = QueueSettings {
        address,
        credentials: file(&arguments.queue_credentials_file),
        ca: file(&arguments.queue_ca),
        store: String::new(),
        jobs_max: defaults.queue_jobs,
        note_time: Duration::from_millis(defaults.unfetched_ttl_ms),
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CliError::ours(error.to_string()))?;
    let found = runtime.block_on(async { if arguments.dead { dead(&settings).await } else { live(&settings).await } });
    Ok((found.map_err(|error| CliError::usage(error.to_string()))?, words))
}

async fn live(settings: &QueueSettings) -> Result<Found, OpenError> {
    let mut jobs = list_live(settings).await?;
    jobs.sort_by_key(|(key, note)| (note.as_ref().map_or(0, |note| note.accepted_unix_ms), *key));
    Ok(Found::Live(jobs))
}

async fn dead(settings: &QueueSettings) -> Result<Found, OpenError> {
    let letters = list_dead(settings).await?;
    let read = letters.iter().map(|(key, letter)| serde_json::from_slice(letter).unwrap_or_else(|_| unreadable(*key)));
    let mut jobs: Vec<RecoveredJob> = read.collect();
    jobs.sort_by_key(|job| (job.record.accepted_unix_ms, job.record.key));
    Ok(Found::Dead(jobs))
}

/// A job whose letter somebody else has written.
fn unreadable(key: JobKey) -> RecoveredJob {
    let error = ErrorRecord {
        fault: "internal".to_owned(),
        code: "unreadable".to_owned(),
        detail: "the dead letter cannot be read".to_owned(),
        flag: None,
    };
    let end = EndRecord { error: Some(error), ..EndRecord::default() };
    RecoveredJob { record: JobRecord { key, ..JobRecord::default() }, starts: 0, end: Some(end) }
}
