//! Takes jobs from the shared queue and lets this daemon's workers do them. The message of a job is acknowledged once the
//! job's end is stored. A daemon that stops before that, however it stops, leaves the message to another.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use tokio::sync::OwnedSemaphorePermit;

use super::accept::note_of;
use super::end::{Untold, with_end};
use super::service::{SharedJobs, id_of};
use crate::digest::Digest;
use crate::durable::{ErrorRecord, FileRecord, JobKey, JobRecord, RecoveredJob, RequestRecord};
use crate::http::address::render_key;
use crate::http::error::{self, ApiError, record_of};
use crate::http::recovery::{self, Side};
use crate::http::state::AppState;
use crate::http::stored_mesh;
use crate::jobs::{Failure, Job, JobState, Owner, Task, Work, end_of};
use crate::keys::Access;
use crate::memory::Account;
use crate::shared_queue::{ACK_WAIT, Delivery, Kind, Note, SIGN_EVERY};
use crate::shared_store::{AcceptedJob, EndedJob, FoundJob, Unavailable};
use crate::telemetry::traces::Trace;
use meshsnap_render::import::BundleFile;

/// The largest number of daemons that may begin a job and then stop.
const STARTS_MAX: u32 = 5;

/// Pause after a failure of the queue or the store.
const PAUSE: Duration = Duration::from_secs(1);

/// Time after which a job is taken again whose picture another daemon draws at this moment.
const SAME_PICTURE: Duration = Duration::from_millis(300);

/// Time for which no other daemon draws a picture that this one draws. It is renewed while the picture is drawn.
const LEASE: Duration = Duration::from_secs(20);

/// Time between two looks at how far a job has come.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The bytes that a record names.
type Blobs = BTreeMap<Digest, Bytes>;

/// The reason why a job is not done now, by this daemon: it is given back to the queue for a while.
struct Later(Duration);

/// The next step with a job.
enum Ready {
    /// A worker is to do it.
    Work(Box<Work>),
    /// It has ended without one.
    Ended(JobState),
}

/// Takes jobs of a kind until the server drains.
pub async fn run(shared: Arc<SharedJobs>, state: Arc<AppState>, kind: Kind) {
    let slots = if kind == Kind::GpuJob { &shared.slots.gpu } else { &shared.slots.any };
    while let Ok(permit) = slots.clone().acquire_owned().await {
        if state.is_draining() {
            return;
        }
        if kind == Kind::GpuJob && shared.others.lacks_gpu() && shared.others.may_have_gpu() {
            tokio::time::sleep(PAUSE).await;
            continue;
        }
        match shared.queue.take(kind).await {
            Ok(None) => {}
            Ok(Some(delivery)) => {
                tokio::spawn(shared.clone().serve(state.clone(), delivery, permit));
            }
            Err(error) => {
                tracing::warn!(%error, "no job was taken");
                tokio::time::sleep(PAUSE).await;
            }
        }
    }
}

impl SharedJobs {
    /// Does the job of a message, and gives signs of life meanwhile.
    async fn serve(self: Arc<Self>, state: Arc<AppState>, delivery: Delivery, _permit: OwnedSemaphorePermit) {
        let Some(key) = delivery.key() else { return delivery.end().await };
        let doing = self.attend(&state, key);
        tokio::pin!(doing);
        let done = loop {
            match tokio::time::timeout(SIGN_EVERY, &mut doing).await {
                Ok(done) => break done,
                Err(_) => delivery.sign_of_life().await,
            }
        };
        match done {
            Ok(()) => delivery.end().await,
            Err(Later(pause)) => delivery.give_back(pause).await,
        }
    }

    /// Does a job, unless it has ended. When this returns Ok, its end is stored.
    async fn attend(&self, state: &Arc<AppState>, key: JobKey) -> Result<(), Later> {
        if state.is_draining() {
            return Err(Later(Duration::ZERO));
        }
        let note = self.queue.note(key).await.map_err(|_| Later(PAUSE))?.map(|(note, _)| note);
        let is_new = note.as_ref().is_some_and(|note| note.starts == 0 && !note.has_ended);
        if !is_new && let Some((ended, _)) = self.store.end(key, &mut |_| true).await.map_err(later)? {
            return self.tell(key, &ended, true).await.map_err(later);
        }
        let memory = state.memory.share(Account::Uploads);
        let mut admit = |bytes| memory.grow(bytes).is_ok();
        let AcceptedJob { record, blobs } = match self.store.job(key, &mut admit).await.map_err(later)? {
            FoundJob::Job(job) => *job,
            FoundJob::NoRoom => return Err(Later(PAUSE)),
            // It was taken back, cancelled, or has ended and was forgotten, perhaps while the queue was away. Its object is
            // left alone: under the name of a request, a new job may be accepted at this moment.
            FoundJob::None => return self.note_end(key).await.map_err(later),
            FoundJob::Damaged => {
                let Note { owner, accepted_unix_ms, starts, .. } = note.unwrap_or_default();
                let unknown = JobRecord { key, owner, accepted_unix_ms, ..JobRecord::default() };
                let record = self.store.job_record(key).await.ok().flatten().unwrap_or(unknown);
                return self.end_surely(state, &record, starts, &failed(Failure::Lost)).await;
            }
        };
        let note = Note { starts: note.map_or(0, |note| note.starts), ..note_of(&record) };
        let ready = self.ready(state, (&record, &blobs), &note).await?;
        // From here on, the work counts its bytes.
        drop((memory, blobs));
        let began = Instant::now();
        let mut ended = match ready {
            Ready::Ended(ended) => Some(ended),
            Ready::Work(work) => self.work(state, &record, *work, note.clone()).await?,
        };
        if let Some(JobState::Failed(failure)) = &ended
            && failure.is_without_gpu()
            && record.needs_gpu
        {
            self.others.note_no_gpu();
            if self.others.may_have_gpu() {
                // It was not begun.
                let _ = self.queue.set_note(key, &note).await;
                return Err(Later(Duration::ZERO));
            }
            ended = Some(failed(Failure::Recorded(record_of(ApiError::no_gpu_anywhere()))));
        }
        // This daemon may have noted since that the job runs.
        let Some(ended) = ended else { return self.note_end(key).await.map_err(later) };
        // After so long, another daemon may have ended it, and it may be forgotten.
        if began.elapsed() > ACK_WAIT && !self.is_still(&record).await.map_err(later)? {
            return Ok(());
        }
        self.end_surely(state, &record, note.starts, &ended).await
    }

    /// True if the end of a job is in the store.
    async fn has_end(&self, key: JobKey) -> bool {
        self.store.end(key, &mut |_| true).await.is_ok_and(|end| end.is_some())
    }

    /// True if the store has this job, and not another one under the same name.
    async fn is_still(&self, record: &JobRecord) -> Result<bool, Unavailable> {
        let found = self.store.job_record(record.key).await?;
        Ok(found.is_some_and(|found| found.accepted_unix_ms == record.accepted_unix_ms))
    }

    /// The work of a job; its end, if that is known without one.
    async fn ready(&self, state: &AppState, job: (&JobRecord, &Blobs), note: &Note) -> Result<Ready, Later> {
        if note.starts >= STARTS_MAX {
            return Ok(Ready::Ended(failed(Failure::Crashed { times: note.starts })));
        }
        let work = match work_of(state, job).await {
            Ok(work) => work,
            Err(Unready::Later(pause)) => return Err(Later(pause)),
            Err(Unready::Failed(failure)) => return Ok(Ready::Ended(failed(failure))),
        };
        match state.jobs.check_mesh(&work) {
            Ok(()) => Ok(Ready::Work(Box::new(work))),
            Err(refusal) => Ok(Ready::Ended(failed(Failure::Recorded(record_of(refusal.into()))))),
        }
    }

    /// The end of a job that a worker does; None if it has another end by then. A picture of a stored mesh that was drawn
    /// already, by whichever daemon, is not drawn again.
    async fn work(
        &self,
        state: &Arc<AppState>,
        record: &JobRecord,
        work: Work,
        note: Note,
    ) -> Result<Option<JobState>, Later> {
        let picture = match (&work.task, record.mesh) {
            (Task::Draw(spec), Some(mesh)) => {
                let reading = recovery::reading(record.format_in.as_deref(), record.entry.clone());
                Some((mesh, render_key(state, mesh, &reading, spec)))
            }
            _ => None,
        };
        let Some((mesh, key)) = picture else { return self.draw(state, record, work, note, None).await };
        if let Some(drawn) = self.drawn(state, (mesh, &key)).await {
            return Ok(Some(drawn));
        }
        let lease = Digest::of(key.as_bytes()).to_string();
        let holder = format!("{} {:032x}", self.server, record.key);
        if !self.queue.lease(&lease, &holder, LEASE).await.map_err(|_| Later(PAUSE))? {
            return Err(Later(SAME_PICTURE));
        }
        // It may have been drawn since the first look.
        let ended = match self.drawn(state, (mesh, &key)).await {
            Some(drawn) => Ok(Some(drawn)),
            None => self.draw(state, record, work, note, Some((&lease, &holder))).await,
        };
        if let Ok(Some(JobState::Done(finished))) = &ended
            && !finished.is_substitute
            && let Err(error) = self.store.put_picture(mesh, &key, finished).await
        {
            tracing::warn!(%error, "a picture was not stored");
        }
        self.queue.release(&lease).await;
        ended
    }

    async fn drawn(&self, state: &AppState, (mesh, key): (Digest, &str)) -> Option<JobState> {
        let picture = self.store.picture(mesh, key).await.ok().flatten()?;
        state.metrics.picture("shared");
        Some(JobState::Done(Arc::new(picture.counted(&state.memory))))
    }

    /// Lets a worker of this daemon do a job, and notes how far it comes.
    async fn draw(
        &self,
        state: &Arc<AppState>,
        record: &JobRecord,
        work: Work,
        mut note: Note,
        lease: Option<(&str, &str)>,
    ) -> Result<Option<JobState>, Later> {
        let key = record.key;
        // Its webhook is told by the service.
        let work = Work { webhook: None, ..work };
        let span = tracing::info_span!("shared job", job = %id_of(key), request_id = record.request_id);
        Trace::of_headers(|name| record.traceparent.as_deref().filter(|_| name == "traceparent")).adopt(&span);
        let job = span.in_scope(|| state.jobs.do_shared((id_of(key), record.accepted_unix_ms), work));
        let job = Waiting { job, state };
        let mut notes = self.queue.follow(key).await.map_err(|_| Later(PAUSE))?;
        let mut looks: u32 = 0;
        loop {
            let (ended, told) = tokio::select! {
                ended = tokio::time::timeout(LOOK_EVERY, job.job.ended()) => (ended.ok(), false),
                Some(note) = notes.next() => (None, note.has_ended),
            };
            if ended.is_some() {
                return Ok(ended);
            }
            // Notes are no truth. A job that is cancelled has its end before its object is removed.
            if told && (self.has_end(key).await || !self.is_still(record).await.unwrap_or(true)) {
                return Ok(None);
            }
            let shown = note_on(&job.job, &note);
            if !shown.is_running && state.is_draining() {
                return Err(Later(Duration::ZERO));
            }
            if shown != note {
                let _ = self.queue.set_note(key, &shown).await;
                note = shown;
            }
            looks += 1;
            if let Some((lease, holder)) = lease.filter(|_| looks.is_multiple_of(LOOKS_PER_LEASE)) {
                let _ = self.queue.lease(lease, holder, LEASE).await;
            }
        }
    }

    /// Ends a job that was begun so often, however long the store or the queue cannot be reached.
    async fn end_surely(&self, state: &AppState, record: &JobRecord, starts: u32, end: &JobState) -> Result<(), Later> {
        let key = record.key;
        let (ended, content) = with_end(EndedJob::of(record), end);
        let (mut is_first, mut letter) = (None, letter_of(record, starts, end));
        loop {
            let done = match (is_first, &letter) {
                (None, _) => {
                    self.store_end(key, &ended, content.clone(), end.name()).await.map(|first| is_first = Some(first))
                }
                (Some(true), Some(bytes)) => {
                    self.queue.bury(key, bytes.clone()).await.map(|()| letter = None).map_err(Untold::from)
                }
                (Some(is_first), _) => match self.tell(key, &ended, is_first).await {
                    Ok(()) => return Ok(()),
                    Err(error) => Err(error),
                },
            };
            let Err(error) = done else { continue };
            tracing::warn!(%error, job = %id_of(key), "the end of a job is not stored and told yet");
            if state.is_draining() {
                return Err(Later(Duration::ZERO));
            }
            tokio::time::sleep(PAUSE).await;
        }
    }
}

/// The dead letter of a job; None if it was not given up. Addresses of webhooks and names of requests may be secrets.
fn letter_of(record: &JobRecord, starts: u32, end: &JobState) -> Option<Vec<u8>> {
    let is_given_up = |failure: &Failure| matches!(failure, Failure::Crashed { .. } | Failure::Lost);
    if !matches!(end, JobState::Failed(failure) if is_given_up(failure)) {
        return None;
    }
    let described = |failure: &Failure| match failure {
        // Clients are told of an internal error.
        Failure::Lost => ErrorRecord { code: "lost".to_owned(), detail: failure.to_string(), ..error::record(failure) },
        _ => error::record(failure),
    };
    let end = end_of(end, None, described);
    let record = JobRecord { webhook: None, claim: None, ..record.clone() };
    let mut letter = RecoveredJob { record, starts, end: Some(end) };
    let bytes = serde_json::to_vec(&letter).ok()?;
    if bytes.len() <= LETTER_BYTES_MAX {
        return Some(bytes);
    }
    letter.record.request = RequestRecord { kind: letter.record.request.kind, ..RequestRecord::default() };
    letter.record.files.truncate(1);
    letter.record.newer = None;
    serde_json::to_vec(&letter).ok()
}

/// The longest dead letter. NATS takes messages of 1 MB.
const LETTER_BYTES_MAX: usize = 512 << 10;

/// Looks at a job after which the lease of its picture is renewed: every five seconds.
const LOOKS_PER_LEASE: u32 = 50;

/// A job of this daemon's workers that is given up when nobody waits for it any more.
struct Waiting<'s> {
    job: Arc<Job>,
    state: &'s AppState,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.state.jobs.cancel(&self.job);
    }
}

/// The note on a job at this moment.
fn note_on(job: &Job, before: &Note) -> Note {
    let is_running = matches!(job.state(), JobState::Running);
    let progress = *job.watch().1.borrow();
    Note {
        is_running,
        starts: before.starts + u32::from(is_running && !before.is_running),
        step: progress.step.name().to_owned(),
        drawn: progress.drawn,
        views: progress.views,
        ..before.clone()
    }
}

/// Reasons why there is no work.
enum Unready {
    Later(Duration),
    Failed(Failure),
}

/// The work of a job: its request is read again, and the stored meshes that it names are found.
async fn work_of(state: &AppState, job: (&JobRecord, &Blobs)) -> Result<Work, Unready> {
    let (record, blobs) = job;
    let lost = || Unready::Failed(Failure::Lost);
    let older = side(state, job, (&record.files, record.is_zip, record.mesh)).await?;
    let newer = match &record.newer {
        Some(newer) => Some(side(state, job, (&newer.files, newer.is_zip, newer.mesh)).await?),
        None => None,
    };
    let document = match record.request.document {
        Some(digest) => Some(blobs.get(&digest).cloned().ok_or_else(lost)?),
        None => None,
    };
    recovery::work_of(state, record, document, older, newer).map_err(Unready::Failed)
}

/// A mesh of a job: a stored one, or one that came with the request.
async fn side(
    state: &AppState,
    (record, blobs): (&JobRecord, &Blobs),
    (files, is_zip, mesh): (&[FileRecord], bool, Option<Digest>),
) -> Result<Side, Unready> {
    if let Some(digest) = mesh {
        let access = Access::of_job(Owner::new(&record.owner));
        let stored = stored_mesh::find(state, Some(&digest.to_string()), &access).await.map_err(unready)?;
        let (bundle, memory, holds) = (stored.mesh.bundle.clone(), stored.memory.clone(), stored.holds.clone());
        return Ok(Side { bundle, memory, holds });
    }
    let found = files.iter().map(|file| {
        let bytes = blobs.get(&file.digest)?.clone();
        Some(BundleFile { path: file.path.clone(), bytes })
    });
    let files = found.collect::<Option<Vec<_>>>().ok_or(Unready::Failed(Failure::Lost))?;
    Ok(Side::sent(state, files, is_zip, Vec::new()))
}

/// A mesh that is deleted fails its job; a store that cannot be reached, or memory that is short, passes.
fn unready(error: ApiError) -> Unready {
    if error.may_pass() {
        return Unready::Later(PAUSE);
    }
    Unready::Failed(Failure::Recorded(record_of(error)))
}

fn failed(failure: Failure) -> JobState {
    JobState::Failed(Arc::new(failure))
}

fn later(error: impl std::fmt::Display) -> Later {
    tracing::warn!(%error, "a job is done later");
    Later(PAUSE)
}
