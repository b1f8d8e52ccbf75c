//! Stored meshes, as the handlers use them: finds one by its digest, and makes the work of a job on
//! it, or on an upload. Where daemons share a
//! store, [`shared`] does this; [`service`] has its state.

pub mod service;
pub mod shared;

use std::sync::Arc;

use super::error::{ApiError, ErrorKind};
use super::state::AppState;
use crate::digest::Digest;
use crate::jobs::{Owner, Task, Work};
use crate::keys::Access;
use crate::memory::MemoryShare;
use crate::store::{Reading, Removed, StoredMesh};
use meshsnap_render::import::Bundle;

/// The stored mesh with this name, if the sender sees it. None is a path segment that is not text.
pub async fn find(state: &AppState, name: Option<&str>, access: &Access) -> Result<Arc<StoredMesh>, ApiError> {
    let digest = digest(name)?;
    match &state.shared {
        Some(shared) => shared::find_mesh(state, shared, digest, access).await,
        None => state.meshes.find(digest, access).ok_or_else(unknown),
    }
}

/// Removes what a party has of a mesh from this process, and from its data folder.
pub fn remove(state: &AppState, digest: Digest, access: &Access) -> Removed {
    let removed = state.meshes.remove(digest, access);
    if removed == Removed::Gone {
        state.residents.forget(&digest.to_string());
    }
    removed
}

/// The digest that a path segment names.
pub fn digest(name: Option<&str>) -> Result<Digest, ApiError> {
    name.and_then(Digest::parse).ok_or_else(|| {
        let detail = "the path names no SHA-256, which is 64 lower-case hexadecimal digits";
        ApiError::new(ErrorKind::BadRequest, "bad_digest", detail)
    })
}

/// The error for a digest that is not in the store.
pub fn unknown() -> ApiError {
    let detail =
        "no mesh of this name is stored: it never was, or was deleted, or made room for others; send it to /v1/meshes";
    ApiError::new(ErrorKind::NotFound, "mesh_unknown", detail)
}

/// A worker's task on a stored mesh.
pub fn work_on(stored: &StoredMesh, reading: Reading, task: Task) -> Work {
    let (mesh_key, holds) = (Some(key(stored.mesh.digest, &reading)), stored.holds.clone());
    Work { mesh_key, holds, ..work(stored.mesh.bundle.clone(), reading, task, stored.memory.clone()) }
}

/// The name under which a mesh stays in memory that is read in the given way.
pub fn key(digest: Digest, reading: &Reading) -> String {
    // Debug output has every field, and quotes texts: two ways of reading never share a key.
    format!("{digest} {reading:?}")
}

/// A worker's task on a bundle that is read in the given way.
pub fn work(bundle: Bundle, reading: Reading, task: Task, memory: Arc<MemoryShare>) -> Work {
    let Reading { format_in, entry } = reading;
    Work {
        bundle: bundle.with_entry(entry),
        format_in,
        mesh_key: None,
        task,
        memory,
        lender: None,
        recipe: None,
        owner: Owner::default(),
        request_id: "".into(),
        holds: [].into(),
        claim: None,
        webhook: None,
    }
}
