//! `/v1/jobs`: pictures and verdicts that are fetched later.

use std::collections::HashMap;
use std::sync::Arc;

use axum::extract::{Extension, Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse as _, Response};

use super::verdicts::{check, diff};
use super::{PathName, responses, run, text_of};
use crate::http::dto::{JobOfMeshDto, JobsDto};
use crate::http::error::{ApiError, ErrorKind};
use crate::http::negotiate;
use crate::http::receive::meshes::MeshOfForm;
use crate::http::receive::{self, Reception};
use crate::http::shared_jobs;
use crate::http::state::AppState;
use crate::jobs::{Class, Job, JobId, JobState};
use crate::keys::Access;

/// The work of a job, by the key `kind` of the query.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Render,
    Check,
    Diff,
}

/// Accepts a job, or one for each `mesh` part of a form, always with 202. A request that is sent again under its `Idempotency-Key` gets the job that it has.
pub async fn post(State(state): State<Arc<AppState>>, mut request: Request) -> Result<Response, ApiError> {
    match take_kind(&mut request)? {
        Kind::Render => {}
        Kind::Check => return check::accept(&state, request).await,
        Kind::Diff => return diff::accept(&state, request).await,
    }
    match receive::receive(&state, request, Class::Batch).await? {
        Reception::New(received) => Ok(responses::accepted(&*shared_jobs::accept(&state, received.work).await?)),
        Reception::Known(job) => Ok(responses::accepted(&job)),
        Reception::Many(meshes) => accept_all(&state, meshes).await,
    }
}

/// Removes the key `kind` from the query.
fn take_kind(request: &mut Request) -> Result<Kind, ApiError> {
    let Some(query) = request.uri().query() else { return Ok(Kind::Render) };
    let (kinds, others): (Vec<&str>, Vec<&str>) = query.split('&').partition(|pair| pair.starts_with("kind="));
    let kind = match kinds.as_slice() {
        [] => return Ok(Kind::Render),
        ["kind=render"] => Kind::Render,
        ["kind=check"] => Kind::Check,
        ["kind=diff"] => Kind::Diff,
        _ => {
            let detail = "`kind` is given once, and allowed is one of render, check, diff";
            return Err(ApiError::new(ErrorKind::BadRequest, "out_of_range", detail));
        }
    };
    let address = format!("{}?{}", request.uri().path(), others.join("&"));
    *request.uri_mut() = address.parse().map_err(|_| ApiError::internal())?;
    Ok(kind)
}

/// Accepts a job for each mesh of a form that has none: all of them or, with an error, none.
pub(super) async fn accept_all(state: &AppState, meshes: Vec<MeshOfForm>) -> Result<Response, ApiError> {
    let (mut names, mut works, mut known) = (Vec::new(), Vec::new(), HashMap::new());
    for (index, mesh) in meshes.into_iter().enumerate() {
        names.push(mesh.name);
        match mesh.job {
            Ok(job) => _ = known.insert(index, job),
            Err(work) => works.push(*work),
        }
    }
    let mut accepted = shared_jobs::accept_all(state, works).await?.into_iter();
    let jobs = names.into_iter().enumerate().filter_map(|(index, name)| {
        let job = known.remove(&index).or_else(|| accepted.next())?;
        Some(JobOfMeshDto::new(name, &job))
    });
    let body = JobsDto { jobs: jobs.collect() };
    Ok((StatusCode::ACCEPTED, responses::uncached(body)).into_response())
}

/// The job's state. With `Prefer: wait=N`, the answer comes when the job has ended or after N
/// seconds.
pub async fn get(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    id: PathName,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let job = find(&state, &access, id).await?;
    let wait = negotiate::prefer(&headers).wait;
    if let Some(wait) = wait {
        shared_jobs::follow(&state, &job);
        // A timeout is no error: the answer then says that the job has not ended.
        let _ = tokio::time::timeout(wait, job.ended()).await;
    }
    // The state is all that there is to fetch of a job without a result.
    if matches!(job.state(), JobState::Failed(_) | JobState::Cancelled) {
        state.jobs.fetched(&job);
    }
    let mut response = responses::job_state(&job);
    let Some(wait) = wait else { return Ok(response) };
    responses::set_preference_applied(&mut response, &format!("wait={}", wait.as_secs()));
    Ok(response)
}

/// Cancels a job that has not ended, or forgets one that has, and answers with its state.
pub async fn delete(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    id: PathName,
) -> Result<Response, ApiError> {
    let job = find(&state, &access, id).await?;
    if job.is_mirror() {
        return Ok(responses::job_state(&*shared_jobs::delete(&state, job).await?));
    }
    if job.state().is_final() {
        state.jobs.forget(&job);
    } else {
        state.jobs.cancel(&job);
        // The end may have to be stored first.
        job.ended().await;
    }
    Ok(responses::job_state(&job))
}

/// The picture or the verdict, or the error that a waiting client would have got.
pub async fn result(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    id: PathName,
) -> Result<Response, ApiError> {
    let job = find(&state, &access, id).await?;
    let conflict = |code, detail| ApiError::new(ErrorKind::Conflict, code, detail);
    let ended = job.state();
    if ended.is_final() {
        state.jobs.fetched(&job);
    }
    match ended {
        JobState::Done(finished) => Ok(responses::result(&finished)),
        JobState::Failed(failure) => Err(run::job_error(&job, &failure)),
        JobState::Queued | JobState::Running => {
            Err(conflict("not_finished", "the job has not ended yet; ask again shortly").retry_after(1))
        }
        // Unreachable: jobs that inspect a mesh are not kept, so they have no address.
        JobState::Inspected(_) => Err(ApiError::internal()),
        JobState::Cancelled => Err(conflict("cancelled", "the job was cancelled, so it has no result")),
    }
}

/// The job, if this client sees it. Addresses are no identity: without keys, who knows the id may have it.
pub(super) async fn find(state: &AppState, access: &Access, id: PathName) -> Result<Arc<Job>, ApiError> {
    let job = match text_of(id).and_then(|id| JobId::parse(&id)) {
        Some(id) => shared_jobs::find(state, id).await?,
        None => None,
    };
    let job = job.filter(|job| access.sees(&job.owner));
    job.ok_or_else(shared_jobs::unknown)
}
