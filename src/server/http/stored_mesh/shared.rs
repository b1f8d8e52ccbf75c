//! Stored meshes and pictures of a service of several daemons, as the handlers use them: this daemon's memory first, then
//! the shared store.
//!
//! A mesh that is at hand is looked up in the shared store again after some seconds ([`KNOWN_FOR`]), because another
//! daemon may have deleted it. While the store cannot be reached, what is at hand is still drawn, and nothing is accepted
//! that would have to be stored.
//!
//! [`KNOWN_FOR`]: super::service::KNOWN_FOR

use std::sync::Arc;
use std::time::Instant;

use super::service::{Shared, is_recent};
use crate::digest::Digest;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::state::AppState;
use crate::http::stored_mesh;
use crate::jobs::Finished;
use crate::keys::Access;
use crate::memory::Account;
use crate::pictures::Source;
use crate::shared_store::Unavailable;
use crate::store::{NewMesh, Removed, StoreError, StoredMesh};

/// Finds a mesh that the sender sees, wherever it was stored.
pub async fn find_mesh(
    state: &AppState,
    shared: &Shared,
    digest: Digest,
    access: &Access,
) -> Result<Arc<StoredMesh>, ApiError> {
    let look = shared.look(digest, access);
    let mut seen = look.lock().await;
    let at_hand = state.meshes.find(digest, access);
    if at_hand.is_some() && is_recent(*seen) {
        return at_hand.ok_or_else(stored_mesh::unknown);
    }
    let is_in_trouble = shared.store.is_in_trouble();
    let looked = if is_in_trouble { None } else { Some(shared.store.find_mesh(digest, access).await) };
    let found = match (looked, at_hand) {
        (Some(Ok(None)), _) => {
            *seen = None;
            stored_mesh::remove(state, digest, access);
            return Err(stored_mesh::unknown());
        }
        (Some(Ok(Some(_))), Some(mesh)) => {
            *seen = Some(Instant::now());
            return Ok(mesh);
        }
        (None | Some(Err(_)), Some(mesh)) => return Ok(mesh),
        (None, None) => return Err(unavailable()),
        (Some(Err(error)), None) => return Err(error.into()),
        (Some(Ok(Some(found))), None) => found,
    };
    state.meshes.check_size(found.bytes)?;
    let memory = state.memory.share(Account::Uploads);
    memory.grow(found.bytes)?;
    let mesh = shared.store.read_mesh(digest, &found).await?.ok_or_else(stored_mesh::unknown)?;
    state.meshes.insert(mesh, [].into())?;
    *seen = Some(Instant::now());
    state.meshes.find(digest, access).ok_or_else(|| StoreError::Busy { flag: "--mesh-bytes" }.into())
}

/// Stores a mesh for all daemons. False if the sender has it already: it is written all the same, because what is there may
/// be damaged.
pub async fn store_mesh(state: &AppState, shared: &Shared, mesh: NewMesh, access: &Access) -> Result<bool, ApiError> {
    if shared.store.is_in_trouble() {
        return Err(unavailable());
    }
    state.meshes.check_size(mesh.size_bytes())?;
    let is_new = shared.store.find_mesh(mesh.digest, access).await?.is_none();
    shared.store.put_mesh(&mesh).await?;
    let (look, digest) = (shared.look(mesh.digest, access), mesh.digest);
    *look.lock().await = Some(Instant::now());
    // It is stored. Without room here, the next request reads it.
    if let Err(error) = state.meshes.insert(mesh, [].into()) {
        tracing::warn!(%error, mesh = %digest, "there is no room for a stored mesh in memory");
    }
    Ok(is_new)
}

/// Deletes a mesh for all daemons. Another one that has it at hand may draw it for some seconds yet.
pub async fn delete_mesh(
    state: &AppState,
    shared: &Shared,
    digest: Digest,
    access: &Access,
) -> Result<Removed, ApiError> {
    let was_stored = shared.store.delete_mesh(digest, access).await?;
    *shared.look(digest, access).lock().await = None;
    match stored_mesh::remove(state, digest, access) {
        Removed::Unknown if was_stored => Ok(Removed::Gone),
        removed => Ok(removed),
    }
}

/// The picture of a stored mesh under a render key: from the shared store, or else drawn, and written to it.
pub async fn picture(
    state: &AppState,
    (mesh, key): (Digest, &str),
    draw: impl Future<Output = Result<Arc<Finished>, ApiError>>,
) -> Result<(Arc<Finished>, Source), ApiError> {
    let Some(shared) = state.shared.as_ref().filter(|shared| !shared.store.is_in_trouble()) else {
        return Ok((draw.await?, Source::Miss));
    };
    match shared.store.picture(mesh, key).await {
        Ok(Some(picture)) => return Ok((Arc::new(picture.counted(&state.memory)), Source::Shared)),
        Ok(None) => {}
        // It can be drawn.
        Err(error) => tracing::warn!(%error, "a picture was not read"),
    }
    let picture = draw.await?;
    let permit = shared.writes.clone().try_acquire_owned().ok().filter(|_| !picture.is_substitute);
    if let Some(permit) = permit {
        let (store, picture, key) = (shared.store.clone(), picture.clone(), key.to_owned());
        tokio::spawn(async move {
            if let Err(error) = store.put_picture(mesh, &key, &picture).await {
                tracing::warn!(%error, "a picture was not stored");
            }
            drop(permit);
        });
    }
    Ok((picture, Source::Miss))
}

/// The error while the store cannot be reached.
pub fn unavailable() -> ApiError {
    let detail = "the store that the servers share cannot be reached; try again shortly";
    ApiError::new(ErrorKind::Unavailable, "store_unavailable", detail).retry_after(5)
}

impl From<Unavailable> for ApiError {
    fn from(error: Unavailable) -> Self {
        tracing::error!(%error, "an operation of the shared store failed");
        unavailable()
    }
}
