//! The sender of a request for a job: what it may do and see, the request's id, and the headers `Idempotency-Key` (a
//! name for the job) and `Webhook` (an address that is told of its end). It also refuses, before the body is read, a
//! request for which the queue or the memory has no room, unless it may need no worker.

use std::sync::Arc;

use axum::extract::Request;
use axum::http::HeaderMap;

use super::{access_of, body, idempotency, webhook};
use crate::http::error::ApiError;
use crate::http::middleware::observe;
use crate::http::state::AppState;
use crate::jobs::{Claim, ClaimName, Class, Work};
use crate::keys::Access;

/// Longest document, bytes, that is read although the queue is full: that of a stored mesh's picture, which
/// may be in memory.
const DOCUMENT_BYTES_MAX: u64 = 64 << 10;

/// The party that sends a request, and the names of the request.
pub struct Sender {
    /// Its access to stored things.
    pub access: Access,
    /// The name that the client gave its job.
    pub name: Option<ClaimName>,
    request_id: Arc<str>,
    webhook: Option<Arc<str>>,
}

impl Sender {
    /// The sender of a request for a job of this class.
    pub fn of(state: &AppState, request: &Request, class: Class) -> Result<Self, ApiError> {
        let access = access_of(request);
        let name = idempotency::name_of(request.headers(), &access.owner)?.filter(|_| class == Class::Batch);
        let webhook = webhook::of(state, request.headers(), class)?;
        Ok(Self { access, name, request_id: observe::id_of(request), webhook })
    }

    /// Refuses a request before its body is read, if no worker will take it. A short document may name a picture or an
    /// answer that is in memory, and a request that was accepted before has its job: they need no worker.
    pub fn check_room(&self, state: &AppState, headers: &HeaderMap, class: Class) -> Result<(), ApiError> {
        let is_sent_again = self.name.as_ref().is_some_and(|name| state.jobs.has_claim(name));
        if is_short_json(headers) || is_sent_again {
            return Ok(());
        }
        match state.shared_jobs.as_ref().filter(|_| class == Class::Batch) {
            // One that was sent before needs no queue.
            Some(_) if self.name.is_some() => Ok(()),
            Some(shared) => shared.check(),
            None => Ok(state.jobs.would_accept(class, &self.access.owner)?),
        }
    }

    /// Work as this sender's.
    pub fn sign(&self, work: Work, claim: Option<Arc<Claim>>) -> Work {
        let (request_id, webhook) = (self.request_id.clone(), self.webhook.clone());
        Work { owner: self.access.owner.clone(), request_id, webhook, claim, ..work }
    }
}

/// True for a document that names its mesh, and so is short.
fn is_short_json(headers: &HeaderMap) -> bool {
    body::is_json(headers) && body::announced_length(headers).is_some_and(|length| length <= DOCUMENT_BYTES_MAX)
}
