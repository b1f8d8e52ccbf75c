//! A form with several meshes (`mesh` parts): it becomes a job for each of them, all with the same document and query.

use std::sync::Arc;

use axum::http::HeaderMap;

use super::body::Upload;
use super::idempotency::{self, Sent};
use super::query::Query;
use super::sender::Sender;
use crate::digest::Digest;
use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::http::{negotiate, stored_mesh};
use crate::jobs::{ClaimName, Job, Recipe, Task, Work};
use meshsnap_render::import::Bundle;
use meshsnap_render::request;

/// A mesh of a form.
pub struct MeshOfForm {
    /// Its name in the form.
    pub name: String,
    /// Its job, or the work of one that is to be accepted.
    pub job: Result<Arc<Job>, Box<Work>>,
}

/// Reads the request of a form and makes work of each of its meshes. One that was accepted before, under the
/// `Idempotency-Key` of the form, has its job.
pub async fn understand(
    state: &AppState,
    query: Query,
    upload: Upload,
    headers: &HeaderMap,
    (sender, named): (&Sender, Option<(&ClaimName, Digest)>),
) -> Result<Vec<MeshOfForm>, ApiError> {
    let Query { reading, overrides } = query;
    let mut spec = request::read(upload.document.as_deref(), &overrides, &state.rules)?;
    let format = negotiate::image_format(spec.image.format, headers)?;
    request::set_format(&mut spec, format);
    let recipe = Arc::new(Recipe { document: upload.document, overrides, mesh: None });
    let reservation = upload.reservation;
    let mut meshes = Vec::new();
    for (index, file) in upload.bundle.into_files().into_iter().enumerate() {
        let memory = Arc::new(reservation.split(file.bytes.len() as u64));
        let name = file.path.clone();
        let claim = match named {
            None => None,
            Some((named, digest)) => {
                match idempotency::check(state, &idempotency::name_of_mesh(named, index), digest).await? {
                    Sent::First(claim) => Some(claim),
                    Sent::Again(job) => {
                        meshes.push(MeshOfForm { name, job: Ok(job) });
                        continue;
                    }
                }
            }
        };
        let bundle = Bundle::of_files(vec![file]);
        bundle.check_sent().map_err(|error| ApiError::from(&error))?;
        let task = Task::Draw(Box::new(spec.clone()));
        let work = Work { recipe: Some(recipe.clone()), ..stored_mesh::work(bundle, reading.clone(), task, memory) };
        meshes.push(MeshOfForm { name, job: Err(Box::new(sender.sign(work, claim))) });
    }
    Ok(meshes)
}
