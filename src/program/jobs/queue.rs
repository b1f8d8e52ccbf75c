//! The jobs of a queue that several servers share: those that have not ended, or its dead letters.

use meshsnap_server::config::Config;
use meshsnap_server::durable::{JobKey, RecoveredJob};
use meshsnap_server::shared_queue::{Address, Kind, Note, QueueSettings, SharedQueue};

use super::JobsArgs;
use crate::error::CliError;

/// What is listed of a queue.
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
    let file = |given: &Option<std::path::PathBuf>| given.clone().filter(|path| !path.as_os_str().is_empty());
    let settings = QueueSettings {
        address,
        credentials: file(&arguments.queue_credentials_file),
        ca: file(&arguments.queue_ca),
        jobs_max: defaults.queue_jobs,
        note_time: std::time::Duration::from_millis(defaults.unfetched_ttl_ms),
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CliError::ours(error.to_string()))?;
    let looking = async {
        let queue = SharedQueue::open_made(settings).await.map_err(|error| CliError::usage(error.to_string()))?;
        let found = if arguments.dead { dead(&queue).await } else { live(&queue).await };
        found.map_err(|error| CliError::ours(error.to_string()))
    };
    Ok((runtime.block_on(looking)?, words))
}

async fn dead(queue: &SharedQueue) -> Result<Found, meshsnap_server::shared_queue::QueueError> {
    let letters = queue.dead().await?;
    Ok(Found::Dead(letters.iter().filter_map(|letter| serde_json::from_slice(letter).ok()).collect()))
}

async fn live(queue: &SharedQueue) -> Result<Found, meshsnap_server::shared_queue::QueueError> {
    let mut keys: Vec<JobKey> = queue.live(Kind::Job).await?.into_iter().collect();
    keys.extend(queue.live(Kind::GpuJob).await?);
    let mut jobs = Vec::new();
    for key in keys {
        jobs.push((key, queue.note(key).await?.map(|(note, _)| note)));
    }
    jobs.sort_by_key(|(key, note)| (note.as_ref().map_or(0, |note| note.accepted_unix_ms), *key));
    Ok(Found::Live(jobs))
}
