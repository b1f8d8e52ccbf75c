//! Jobs in the shared store. The object `jobs/ID` has all that is needed to do a job. It is there from the job's
//! acceptance to its end. From then on `results/ID` has the end: the result, the error, or the word that it was
//! cancelled. `webhooks/ID` is there, empty, while the webhook of a job is to be told of its end.
//!
//! Both are created once, by a conditional write: of two servers that accept a job under one id, or that end one job, one
//! is the first, and the other learns it. So a job that is done twice ends once.

use std::collections::BTreeMap;
use std::time::Duration;

use bytes::Bytes;
use futures_util::TryStreamExt as _;
use object_store::path::Path;
use object_store::{GetOptions, ObjectStoreExt as _, PutMode, PutPayload};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::objects::{line_of, split};
use super::{ATTEMPTS_MORE, MARK, MARK_TEXT, OpenError, SharedStore, Unavailable};
use crate::digest::Digest;
use crate::durable::{ClaimRecord, EndRecord, JobKey, JobRecord};

/// A job that was accepted.
#[derive(Clone, Debug)]
pub struct AcceptedJob {
    /// Its record. It has no files for a mesh that is stored.
    pub record: JobRecord,
    /// The bytes that the record names.
    pub blobs: BTreeMap<Digest, Bytes>,
}

/// The first line of an accepted job. The bytes that the record names follow.
#[derive(Serialize, Deserialize)]
struct JobHead {
    record: JobRecord,
    blobs: Vec<BlobHead>,
}

#[derive(Serialize, Deserialize)]
struct BlobHead {
    sha256: String,
    bytes: usize,
}

/// A job that has ended: the first line of its object. The bytes of its result follow.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EndedJob {
    /// The party that asked for it.
    pub owner: String,
    /// The time of acceptance in milliseconds since 1970.
    pub accepted_unix_ms: u64,
    /// The name that the client gave the request.
    #[serde(default)]
    pub claim: Option<ClaimRecord>,
    /// The address that hears of its end.
    #[serde(default)]
    pub webhook: Option<String>,
    /// The end.
    pub end: EndRecord,
}

/// The outcome of a look for a job.
#[derive(Debug)]
pub enum FoundJob {
    /// It has ended, or never was.
    None,
    /// There is no memory for its bytes.
    NoRoom,
    /// Its object is damaged.
    Damaged,
    /// The job.
    Job(Box<AcceptedJob>),
}

/// The objects of jobs that exist, each with the time since it was written.
pub type Ages = Vec<(JobKey, Duration)>;

/// The queue of a store, and the store's name: the object `service`.
#[derive(Serialize, Deserialize)]
struct Service {
    store: String,
    queue: String,
}

const SERVICE: &str = "service";
const JOBS: &str = "jobs";
const RESULTS: &str = "results";
const WEBHOOKS: &str = "webhooks";

/// Bytes in which the first line of the object of a job is looked for, of which nearly all are short.
const HEAD_BYTES: [u64; 2] = [16 << 10, 4 << 20];

impl EndedJob {
    /// A job whose end is not known yet.
    pub fn of(record: &JobRecord) -> Self {
        Self {
            owner: record.owner.clone(),
            accepted_unix_ms: record.accepted_unix_ms,
            claim: record.claim.clone(),
            webhook: record.webhook.clone(),
            end: EndRecord::default(),
        }
    }
}

impl SharedStore {
    /// Checks that the store refuses to create an object that exists. Some servers of S3 ignore the condition.
    pub async fn check_conditions(&self) -> Result<(), OpenError> {
        loop {
            match self.create(&Path::from(MARK), MARK_TEXT.into()).await {
                Ok(false) => return Ok(()),
                Ok(true) => return Err(OpenError::Unconditional { address: self.address.clone() }),
                Err(error) => tracing::warn!(%error, "waiting for the shared store"),
            }
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
    }

    /// The name of this store, by which the queue `queue` knows it. The first server gives it one. A store has the jobs of
    /// one queue.
    pub async fn join(&self, queue: &str) -> Result<String, OpenError> {
        let place = Path::from(SERVICE);
        loop {
            let found = match self.read_service(&place).await {
                Ok(Some(found)) if found.queue == queue => return Ok(found.store),
                Ok(Some(found)) => {
                    let (address, needed) = (self.address.clone(), queue.to_owned());
                    return Err(OpenError::OtherQueue { address, found: found.queue, needed });
                }
                Ok(None) => {
                    let new = Service { store: Uuid::now_v7().to_string(), queue: queue.to_owned() };
                    self.create(&place, line_of(&new).into()).await.map(drop)
                }
                Err(error) => Err(error),
            };
            if let Err(error) = found {
                tracing::warn!(%error, "waiting for the shared store");
                tokio::time::sleep(Duration::from_secs(1)).await;
            }
        }
    }

    async fn read_service(&self, place: &Path) -> Result<Option<Service>, Unavailable> {
        let bytes = match self.objects.get(place).await {
            Ok(found) => found.bytes().await.map_err(|cause| self.unavailable(cause))?,
            Err(object_store::Error::NotFound { .. }) => return Ok(None),
            Err(cause) => return Err(self.unavailable(cause)),
        };
        let unreadable = |_| Service { store: String::new(), queue: "(unreadable)".to_owned() };
        Ok(Some(serde_json::from_slice(&bytes).unwrap_or_else(unreadable)))
    }

    /// Stores a job that is accepted. False if there is one with its id.
    pub async fn create_job(&self, job: &AcceptedJob) -> Result<bool, Unavailable> {
        self.is_there().await?;
        let blobs = job.blobs.iter();
        let blobs = blobs.map(|(digest, bytes)| BlobHead { sha256: digest.to_string(), bytes: bytes.len() }).collect();
        let head = line_of(&JobHead { record: job.record.clone(), blobs });
        let object = [head].into_iter().chain(job.blobs.values().cloned()).collect();
        if self.create(&place(JOBS, job.record.key), object).await? {
            return Ok(true);
        }
        // An answer may have been lost, and the write tried again: then the one that is there is this one.
        let found = self.job_record(job.record.key).await?;
        let name = |record: &JobRecord| (record.accepted_unix_ms, record.request_id.clone());
        Ok(found.is_some_and(|found| name(&found) == name(&job.record)))
    }

    /// A job that has not ended, if `admit` says that its bytes may be read.
    pub async fn job(&self, key: JobKey, admit: &mut (dyn FnMut(u64) -> bool + Send)) -> Result<FoundJob, Unavailable> {
        let found = match self.objects.get(&place(JOBS, key)).await {
            Ok(found) => found,
            Err(object_store::Error::NotFound { .. }) => return Ok(FoundJob::None),
            Err(cause) => return Err(self.unavailable(cause)),
        };
        if !admit(found.meta.size) {
            return Ok(FoundJob::NoRoom);
        }
        let bytes = found.bytes().await.map_err(|cause| self.unavailable(cause))?;
        // Hashing many bytes would block other requests.
        let reading = tokio::task::spawn_blocking(move || read_job(bytes));
        Ok(reading.await.ok().flatten().map_or(FoundJob::Damaged, |job| FoundJob::Job(Box::new(job))))
    }

    /// The record of a job that has not ended.
    pub async fn job_record(&self, key: JobKey) -> Result<Option<JobRecord>, Unavailable> {
        // The files of the mesh follow the record, and are not needed.
        for length in HEAD_BYTES {
            let head = GetOptions::new().with_range(Some(0..length));
            let reading = async { self.objects.get_opts(&place(JOBS, key), head).await?.bytes().await };
            match reading.await.map(split::<JobHead>) {
                Ok(Some((head, _))) => return Ok(Some(head.record)),
                Ok(None) => {}
                Err(object_store::Error::NotFound { .. }) => return Ok(None),
                Err(cause) => return Err(self.unavailable(cause)),
            }
        }
        Ok(None)
    }

    /// Removes the object of a job that has ended, or was not accepted after all.
    pub async fn delete_job(&self, key: JobKey) -> Result<(), Unavailable> {
        self.delete(&place(JOBS, key)).await
    }

    /// Stores the end of a job. False if it has ended already.
    pub async fn create_end(&self, key: JobKey, ended: &EndedJob, content: Bytes) -> Result<bool, Unavailable> {
        self.is_there().await?;
        self.create(&place(RESULTS, key), [line_of(ended), content].into_iter().collect()).await
    }

    /// The end of a job, and the bytes of its result, if `admit` says that they may be read. None if the job has not ended,
    /// was forgotten, or may not be read.
    pub async fn end(
        &self,
        key: JobKey,
        admit: &mut (dyn FnMut(u64) -> bool + Send),
    ) -> Result<Option<(EndedJob, Bytes)>, Unavailable> {
        let found = match self.objects.get(&place(RESULTS, key)).await {
            Ok(found) => found,
            Err(object_store::Error::NotFound { .. }) => return Ok(None),
            Err(cause) => return Err(self.unavailable(cause)),
        };
        if !admit(found.meta.size) {
            return Ok(None);
        }
        let bytes = found.bytes().await.map_err(|cause| self.unavailable(cause))?;
        Ok(split::<EndedJob>(bytes))
    }

    /// Forgets a job that has ended.
    pub async fn delete_end(&self, key: JobKey) -> Result<(), Unavailable> {
        self.delete(&place(RESULTS, key)).await
    }

    /// Notes that the webhook of a job is to be told of its end.
    pub async fn owe_webhook(&self, key: JobKey) -> Result<(), Unavailable> {
        let noted = self.objects.put(&place(WEBHOOKS, key), PutPayload::new()).await;
        noted.map(drop).map_err(|cause| self.unavailable(cause))
    }

    /// True if the webhook of a job is to be told of its end.
    pub async fn owes_webhook(&self, key: JobKey) -> Result<bool, Unavailable> {
        match self.objects.head(&place(WEBHOOKS, key)).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(cause) => Err(self.unavailable(cause)),
        }
    }

    /// The webhook of a job was told of its end.
    pub async fn settle_webhook(&self, key: JobKey) -> Result<(), Unavailable> {
        self.delete(&place(WEBHOOKS, key)).await
    }

    /// The jobs whose webhooks were not told.
    pub async fn owed_webhooks(&self) -> Result<Ages, Unavailable> {
        self.ages(WEBHOOKS).await
    }

    /// The jobs that have not ended, and those whose object was not removed yet.
    pub async fn jobs(&self) -> Result<Ages, Unavailable> {
        self.ages(JOBS).await
    }

    /// The jobs that have ended.
    pub async fn ends(&self) -> Result<Ages, Unavailable> {
        self.ages(RESULTS).await
    }

    async fn ages(&self, folder: &str) -> Result<Ages, Unavailable> {
        let now = std::time::SystemTime::now();
        let age = |at| now.duration_since(at).unwrap_or_default();
        let folder = Path::from(folder);
        let found = self.objects.list(Some(&folder)).try_filter_map(|meta| async move {
            let key = meta.location.filename().and_then(|name| JobKey::from_str_radix(name, 16).ok());
            Ok(key.map(|key| (key, age(meta.last_modified.into()))))
        });
        found.try_collect().await.map_err(|cause| self.unavailable(cause))
    }

    /// Writes an object that does not exist. False if it does, which may be by this write: it is tried again where its
    /// answer is lost, because the crate does not.
    async fn create(&self, place: &Path, object: PutPayload) -> Result<bool, Unavailable> {
        let mut attempt = 0;
        loop {
            match self.objects.put_opts(place, object.clone(), PutMode::Create.into()).await {
                Ok(_) => return Ok(true),
                Err(object_store::Error::AlreadyExists { .. } | object_store::Error::Precondition { .. }) => {
                    return Ok(false);
                }
                Err(_) if attempt < ATTEMPTS_MORE => attempt += 1,
                Err(cause) => return Err(self.unavailable(cause)),
            }
        }
    }
}

fn place(folder: &str, key: JobKey) -> Path {
    Path::from_iter([folder, &format!("{key:032x}")])
}

fn read_job(object: Bytes) -> Option<AcceptedJob> {
    let (head, mut rest) = split::<JobHead>(object)?;
    let mut blobs = BTreeMap::new();
    for blob in head.blobs {
        let bytes = (blob.bytes <= rest.len()).then(|| rest.split_to(blob.bytes))?;
        // What is damaged is lost, and its job says so.
        let digest = Digest::parse(&blob.sha256).filter(|digest| Digest::of(&bytes) == *digest);
        blobs.extend(digest.map(|digest| (digest, bytes)));
    }
    Some(AcceptedJob { record: head.record, blobs })
}
