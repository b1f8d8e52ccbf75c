//! Verdicts on meshes: [`check`] judges one, [`diff`] compares two. Both answer while the client waits, at once if the
//! answer is in memory, or accept a job whose answer is fetched later.

pub mod check;
pub mod diff;

use axum::response::Response;

use super::{responses, run};
use crate::http::error::ApiError;
use crate::http::receive::check::Asked;
use crate::http::shared_jobs;
use crate::http::state::AppState;
use crate::pictures::Source;

/// The answer to a request that a client waits for.
async fn answer(state: &AppState, asked: Asked) -> Result<Response, ApiError> {
    match asked {
        Asked::New { work, key } => {
            let judging = async { Ok::<_, ApiError>((run::draw(state, *work).await?, Source::Miss)) };
            let found = state.pictures.find(&key, judging).await?;
            state.metrics.picture(found.source.name());
            Ok(responses::found(&found, Some(&key)))
        }
        // Unreachable: requests that a client waits for have no names.
        Asked::Known(job) => Ok(responses::accepted(&job)),
    }
}

/// The answer to a request for a job: always 202.
async fn accepted(state: &AppState, asked: Asked) -> Result<Response, ApiError> {
    match asked {
        Asked::New { work, .. } => Ok(responses::accepted(&*shared_jobs::accept(state, *work).await?)),
        Asked::Known(job) => Ok(responses::accepted(&job)),
    }
}

fn applied(mut response: Response) -> Response {
    responses::set_preference_applied(&mut response, "respond-async");
    response
}
