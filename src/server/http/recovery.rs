//! The take-over of what an earlier process has left in the data folder: its stored meshes, its jobs that have not
//! ended (they are queued again, except those that were begun five times or cannot be read any more), and the results
//! of those that have.

use std::sync::Arc;

use bytes::Bytes;

use super::error::{ApiError, record_of};
use super::hear_of_ends;
use super::receive::keys::Keys;
use super::receive::{check, diff};
use super::state::AppState;
use super::stored_mesh::{self, service::Shared};
use crate::durable::{
    Change, ClaimRecord, FileRecord, Hold, JobRecord, MeshRecord, Recovered, RecoveredJob, RequestKind,
};
use crate::jobs::{
    Claim, ClaimName, Failure, JSON, JobId, JobState, Named, Newer, Owner, Recipe, Restored, Task, Work, read_end,
    value_of,
};
use crate::memory::{Account, MemoryShare};
use crate::shared_store::OpenError;
use crate::store::{NewMesh, Reading};
use meshsnap_render::import::{Bundle, BundleFile, Format};
use meshsnap_render::request;

/// How often a job may be begun by processes that then ended.
const STARTS_MAX: u32 = 5;

/// Files of a record, and the holds on them.
type Files = (Vec<BundleFile>, Vec<Arc<Hold>>);

/// Takes everything over. Jobs that have not ended are queued in the order of acceptance.
pub fn recover(state: &AppState, mut recovered: Recovered) {
    let meshes = std::mem::take(&mut recovered.meshes);
    let jobs = std::mem::take(&mut recovered.jobs);
    let (mesh_count, job_count) = (meshes.len(), jobs.len());
    for record in meshes {
        restore_mesh(state, &recovered, record);
    }
    let mut queued = 0;
    for job in jobs {
        let name = Restored {
            id: JobId::from_key(job.record.key),
            accepted_unix_ms: job.record.accepted_unix_ms,
            owner: Owner::new(&job.record.owner),
            claim: claim(state, &job.record),
        };
        if job.end.is_some() {
            let (id, end) = (name.id, job.end.as_ref());
            let is_told = end.is_some_and(|end| end.notified_unix_ms.is_some());
            let webhook = job.record.webhook.clone().filter(|_| !is_told);
            restore_result(state, &recovered, name, job);
            tell(state, id, webhook.as_deref());
            continue;
        }
        match resumed(state, &recovered, &job) {
            Ok((work, holds)) => {
                queued += 1;
                let work = Work { claim: name.claim, ..work };
                state.jobs.resume((name.id, name.accepted_unix_ms), work, holds);
            }
            Err(failure) => {
                let id = name.id;
                state.jobs.restore(name, JobState::Failed(Arc::new(failure)), None, Vec::new());
                tell(state, id, job.record.webhook.as_deref());
            }
        }
    }
    if mesh_count + job_count > 0 {
        tracing::info!(meshes = mesh_count, jobs = job_count, queued, "taken over from the data folder");
    }
}

/// Puts the stored meshes of the data folder into the shared store, and removes them from the folder: where daemons share
/// a store, it has all stored meshes. Each leaves the folder as soon as it is in the store.
pub async fn hand_over(state: &AppState, shared: &Shared, recovered: &mut Recovered) -> Result<(), OpenError> {
    let mut count = 0;
    for record in std::mem::take(&mut recovered.meshes) {
        let digest = record.digest;
        if let Some((mesh, _)) = mesh_of(recovered, record) {
            shared.store.put_mesh(&mesh).await?;
            if let Some(durable) = &state.durable {
                durable.store(vec![Change::MeshRemoved(digest)], Vec::new()).await?;
            }
            count += 1;
        }
    }
    if count > 0 {
        tracing::info!(meshes = count, "handed over to the shared store");
    }
    Ok(())
}

/// Tells the webhook of a job of its end, of which an earlier process has not told it.
fn tell(state: &AppState, id: JobId, webhook: Option<&str>) {
    if let (Some(address), Some(job)) = (webhook, state.jobs.find(id)) {
        hear_of_ends::send(state.webhooks.as_ref(), &job, address);
    }
}

fn restore_mesh(state: &AppState, recovered: &Recovered, record: MeshRecord) {
    let digest = record.digest;
    let Some((mesh, holds)) = mesh_of(recovered, record) else { return };
    if let Err(error) = state.meshes.insert(mesh, holds.into()) {
        tracing::warn!(mesh = %digest, %error, "a stored mesh does not fit any more");
    }
}

/// A stored mesh of the data folder, and its bytes there. None if they are lost.
fn mesh_of(recovered: &Recovered, record: MeshRecord) -> Option<(NewMesh, Vec<Arc<Hold>>)> {
    let Some((files, mut holds)) = files(recovered, &record.files) else {
        tracing::warn!(mesh = %record.digest, "a stored mesh is lost: its file is missing or damaged");
        return None;
    };
    let (report, hold) = recovered.bytes(record.report)?;
    holds.push(hold);
    let reading = reading(record.format_in.as_deref(), record.entry.clone());
    let mesh = NewMesh {
        digest: record.digest,
        bundle: Bundle::of_files(files),
        reading,
        report,
        owners: record.owners().map(|owner| Owner::new(owner)).collect(),
    };
    Some((mesh, holds))
}

fn restore_result(state: &AppState, recovered: &Recovered, name: Restored, job: RecoveredJob) {
    let Some(end) = job.end else { return };
    let found = end.picture.as_ref().and_then(|picture| recovered.bytes(picture.digest));
    let (content, hold) = found.unzip();
    let (ended, holds) = (read_end(&end, content, &state.memory), hold.into_iter().collect());
    state.jobs.restore(name, ended, Some(&end), holds);
}

/// The work of a job that has not ended, or the reason why it cannot be done.
fn resumed(state: &AppState, recovered: &Recovered, job: &RecoveredJob) -> Result<(Work, Vec<Arc<Hold>>), Failure> {
    if job.starts >= STARTS_MAX {
        return Err(Failure::Crashed { times: job.starts });
    }
    let record = &job.record;
    let side = |records: &[FileRecord], is_zip| {
        let (files, holds) = files(recovered, records).ok_or(Failure::Lost)?;
        Ok::<_, Failure>(Side::sent(state, files, is_zip, holds))
    };
    let older = side(&record.files, record.is_zip)?;
    let newer = record.newer.as_ref().map(|newer| side(&newer.files, newer.is_zip)).transpose()?;
    let found = record.request.document.map(|digest| recovered.bytes(digest).ok_or(Failure::Lost)).transpose()?;
    let (document, hold) = found.unzip();
    let mut holds: Vec<_> = older.holds.iter().cloned().collect();
    holds.extend(newer.iter().flat_map(|side| side.holds.iter().cloned()).chain(hold));
    // The holds are the job's own.
    let older = Side { holds: [].into(), ..older };
    Ok((work_of(state, record, document, older, newer)?, holds))
}

/// The bytes of a mesh of a recorded job, and their memory.
pub struct Side {
    /// The mesh and the files beside it.
    pub bundle: Bundle,
    /// The memory of `bundle`.
    pub memory: Arc<MemoryShare>,
    /// The bundle's files in the data folder.
    pub holds: Arc<[Arc<Hold>]>,
}

impl Side {
    /// A mesh that was sent with its request.
    pub fn sent(state: &AppState, files: Vec<BundleFile>, is_zip: bool, holds: Vec<Arc<Hold>>) -> Self {
        let bundle = Bundle::restored(files, is_zip, None);
        let memory = state.memory.share(Account::Uploads);
        memory.take(bundle.bytes_len());
        Self { bundle, memory: Arc::new(memory), holds: holds.into() }
    }
}

/// The work of a recorded job: its request is read again. `newer` is the second mesh of a comparison.
pub fn work_of(
    state: &AppState,
    record: &JobRecord,
    document: Option<Bytes>,
    older: Side,
    newer: Option<Side>,
) -> Result<Work, Failure> {
    let of_newer = record.newer.as_ref().and_then(|record| record.mesh);
    let newer = newer.map(|Side { bundle, memory, holds }| Newer {
        bundle: bundle.with_entry(record.entry.clone()),
        memory,
        holds,
        mesh: of_newer,
    });
    let task = task(state, record, document.as_deref(), newer)?;
    let recipe = Recipe { document, overrides: record.request.overrides.clone().into(), mesh: record.mesh };
    let reading = reading(record.format_in.as_deref(), record.entry.clone());
    let mesh_key = record.mesh.map(|digest| stored_mesh::key(digest, &reading));
    Ok(Work {
        bundle: older.bundle.with_entry(record.entry.clone()),
        format_in: reading.format_in,
        mesh_key,
        task,
        memory: older.memory,
        lender: None,
        recipe: Some(Arc::new(recipe)),
        owner: Owner::new(&record.owner),
        request_id: record.request_id.as_str().into(),
        holds: older.holds,
        claim: None,
        webhook: record.webhook.as_deref().map(Into::into),
    })
}

/// The name of the job's request, so that the request is known when it is sent again.
fn claim(state: &AppState, record: &JobRecord) -> Option<Arc<Claim>> {
    let ClaimRecord { key, request } = record.claim.as_ref()?;
    let name = ClaimName { owner: Owner::new(&record.owner), key: key.as_str().into() };
    match state.jobs.claim(&name, *request) {
        Named::New(claim) => Some(claim),
        Named::Known(_) | Named::Pending | Named::Other => None,
    }
}

/// The request is read again, under the limits of this process.
fn task(state: &AppState, record: &JobRecord, document: Option<&[u8]>, newer: Option<Newer>) -> Result<Task, Failure> {
    let (overrides, rules) = (&record.request.overrides, &state.rules);
    let recorded = |error| Failure::Recorded(record_of(error));
    match record.request.kind {
        RequestKind::Draw => {}
        RequestKind::Check => {
            let digest = record.request.upload.ok_or(Failure::Lost)?;
            return check::task(&Keys::stored(overrides), digest).map_err(recorded);
        }
        RequestKind::Diff => {
            let format = (record.request.format != JSON).then(|| value_of(&record.request.format).ok_or(Failure::Lost));
            let answer = diff::Answer::of(state, &Keys::stored(overrides), format.transpose()?).map_err(recorded)?;
            return Ok(answer.task(newer.ok_or(Failure::Lost)?));
        }
    }
    let read = match document.filter(|_| record.request.names_mesh) {
        Some(document) => request::read_with_mesh(document, overrides, rules).map(|(_, spec)| spec),
        None => request::read(document, overrides, rules),
    };
    let mut spec = read.map_err(|error| recorded(ApiError::from(error)))?;
    request::set_format(&mut spec, value_of(&record.request.format).ok_or(Failure::Lost)?);
    Ok(Task::Draw(Box::new(spec)))
}

fn files(recovered: &Recovered, records: &[FileRecord]) -> Option<Files> {
    let found = records.iter().map(|record| {
        let (bytes, hold) = recovered.bytes(record.digest)?;
        Some((BundleFile { path: record.path.clone(), bytes }, hold))
    });
    found.collect()
}

/// The way in which a recorded mesh is read.
pub fn reading(format_in: Option<&str>, entry: Option<String>) -> Reading {
    Reading { format_in: format_in.and_then(Format::from_name), entry }
}
