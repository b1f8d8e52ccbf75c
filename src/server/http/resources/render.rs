//! `POST /v1/render`: draws the mesh in the body, or a stored one that the body names.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderValue, header};
use axum::response::Response;

use super::{jobs, responses, run};
use crate::http::conditional;
use crate::http::error::ApiError;
use crate::http::negotiate;
use crate::http::receive::{self, Received, Reception};
use crate::http::shared_jobs;
use crate::http::state::AppState;
use crate::http::stored_mesh::shared;
use crate::jobs::{Class, Job};

/// Draws while the client waits. With `Prefer: respond-async`, accepts a job instead.
pub async fn post(State(state): State<Arc<AppState>>, request: Request) -> Result<Response, ApiError> {
    let respond_async = negotiate::prefer(request.headers()).respond_async;
    let class = if respond_async { Class::Batch } else { Class::Interactive };
    let received = match receive::receive(&state, request, class).await? {
        Reception::New(received) => *received,
        Reception::Known(job) => return Ok(accepted(&job)),
        Reception::Many(meshes) => return Ok(applied(jobs::accept_all(&state, meshes).await?)),
    };
    let Received { work, key, address, is_negotiated } = received;
    if respond_async {
        return Ok(accepted(&*shared_jobs::accept(&state, work).await?));
    }
    let mesh = work.recipe.as_ref().and_then(|recipe| recipe.mesh);
    let drawing = run::draw(&state, work);
    let mut response = match key.zip(mesh) {
        Some((key, mesh)) => {
            let tag = address.as_ref().map(|at| at.etag.as_str());
            let found = state.pictures.find(&key, shared::picture(&state, (mesh, &key), drawing)).await?;
            state.metrics.picture(found.source.name());
            responses::found(&found, tag)
        }
        None => responses::result(&*drawing.await?),
    };
    if is_negotiated {
        response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    }
    if let Some((location, (name, etag))) =
        address.and_then(|at| Some((HeaderValue::from_str(&at.url).ok()?, conditional::etag(&at.etag))))
    {
        // The answer is the picture at that address, so it has the tag of that address.
        response.headers_mut().insert(header::CONTENT_LOCATION, location);
        response.headers_mut().insert(name, etag);
    }
    Ok(response)
}

fn accepted(job: &Job) -> Response {
    applied(responses::accepted(job))
}

fn applied(mut response: Response) -> Response {
    responses::set_preference_applied(&mut response, "respond-async");
    response
}
