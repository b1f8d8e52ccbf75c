//! `GET /v1/jobs/{id}/events`: server-sent events, from the queue to the end of a job.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::connect_info::ConnectInfo;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream;
use serde_json::json;
use tokio::sync::watch;

use super::{PathName, jobs};
use crate::http::connection::activity::{Busy, Client};
use crate::http::dto::JobDto;
use crate::http::error::ApiError;
use crate::http::event_streams::OpenStream;
use crate::http::shared_jobs;
use crate::http::state::AppState;
use crate::jobs::{Job, JobState, Progress, Step};
use crate::keys::Access;

/// Time without an event after which a comment is sent, so that proxies keep the connection open.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

const LAST_EVENT_ID: HeaderName = HeaderName::from_static("last-event-id");

/// The place of an event in the life of a job, by which it is known what a client has seen.
type Rank = (Step, u32);

/// The part of a job's life that a client has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Nothing,
    UpTo(Rank),
    End,
}

/// A job that is followed.
struct Following {
    state: Arc<AppState>,
    job: Arc<Job>,
    states: watch::Receiver<JobState>,
    progress: watch::Receiver<Progress>,
    seen: Seen,
    ready: VecDeque<Event>,
    stream: OpenStream,
    /// The connection is in use, however silent it is.
    _busy: Option<Busy>,
}

/// Follows a job until it ends. `Last-Event-ID` says what the client has seen; one that has seen the end gets 204,
/// upon which browsers ask no more.
pub async fn get(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    client: Option<Extension<ConnectInfo<Client>>>,
    id: PathName,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let job = jobs::find(&state, &access, id).await?;
    let seen = headers.get(LAST_EVENT_ID).and_then(|id| id.to_str().ok()).map_or(Seen::Nothing, seen);
    if seen == Seen::End && job.state().is_final() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let stream = state.event_streams.open(&access.owner)?;
    shared_jobs::follow(&state, &job);
    let (states, progress) = job.watch();
    let busy = client.map(|Extension(ConnectInfo(client))| client.activity.begin());
    let following = Following { state, job, states, progress, seen, ready: VecDeque::new(), stream, _busy: busy };
    let events = stream::unfold(following, |mut following| async {
        let event = following.next().await?;
        Some((Ok::<_, Infallible>(event), following))
    });
    let mut response = Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    // Some proxies collect answers otherwise.
    headers.insert(HeaderName::from_static("x-accel-buffering"), HeaderValue::from_static("no"));
    Ok(response)
}

impl Following {
    /// The next event. None after the end.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            if self.seen == Seen::End {
                return None;
            }
            // Marked as seen before they are read, so that no change is missed.
            let state = self.states.borrow_and_update().clone();
            let progress = *self.progress.borrow_and_update();
            self.collect(&state, progress);
            if !self.ready.is_empty() || self.seen == Seen::End {
                continue;
            }
            tokio::select! {
                changed = self.states.changed() => changed.ok()?,
                changed = self.progress.changed() => changed.ok()?,
                () = self.stream.closing() => return None,
            }
        }
    }

    /// Adds the events that the client has not seen: each step that was reached, and the end.
    fn collect(&mut self, state: &JobState, progress: Progress) {
        for step in Step::ALL.into_iter().filter(|&step| step <= progress.step) {
            // Of the views, the newest number is enough.
            let drawn = if step >= Step::Drawing { progress.drawn } else { 0 };
            let is_new = match self.seen {
                Seen::Nothing => true,
                Seen::UpTo(seen) => (step, drawn) > seen,
                Seen::End => false,
            };
            if is_new {
                self.seen = Seen::UpTo((step, drawn));
                self.ready.extend(step_event(&self.job, (step, drawn), progress.views));
            }
        }
        if state.is_final() && self.seen != Seen::End {
            self.seen = Seen::End;
            self.ready.extend(event(state.name(), state.name().to_owned(), &JobDto::new(&self.job)));
            // The state is all that there is to fetch of a job without a result.
            if matches!(state, JobState::Failed(_) | JobState::Cancelled) {
                self.state.jobs.fetched(&self.job);
            }
        }
    }
}

fn step_event(job: &Job, (step, drawn): Rank, views: u32) -> Option<Event> {
    let id = job.id.to_string();
    match step {
        Step::Drawing => {
            event(step.name(), format!("drawing-{drawn}"), &json!({ "id": id, "drawn": drawn, "views": views }))
        }
        _ => event(step.name(), step.name().to_owned(), &json!({ "id": id })),
    }
}

/// An event. None if it cannot be written, which does not happen: JSON has no line breaks.
fn event(name: &str, id: String, data: &impl serde::Serialize) -> Option<Event> {
    Event::default().event(name).id(id).json_data(data).ok()
}

/// The part that a client has seen that names its last event: nothing, if it names none of ours.
fn seen(id: &str) -> Seen {
    if ["done", "failed", "cancelled"].contains(&id) {
        return Seen::End;
    }
    if let Some(drawn) = id.strip_prefix("drawing-").and_then(|drawn| drawn.parse().ok()) {
        return Seen::UpTo((Step::Drawing, drawn));
    }
    match Step::ALL.into_iter().find(|step| step.name() == id) {
        None | Some(Step::Drawing) => Seen::Nothing,
        // All views are drawn by then.
        Some(Step::Encoding) => Seen::UpTo((Step::Encoding, u32::MAX)),
        Some(step) => Seen::UpTo((step, 0)),
    }
}
