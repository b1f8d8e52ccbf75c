//! A request for a verdict on a mesh: the mesh, or the name of a stored one, and rules.

use std::sync::Arc;

use axum::extract::Request;

use super::body::{self, BodyKind};
use super::idempotency::{self, Sent};
use super::keys::Keys;
use super::query::{Query, bad, quote};
use super::sender::Sender;
use super::{document_of, read_upload, upload};
use crate::digest::Digest;
use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::http::stored_mesh;
use crate::jobs::{Checking, Class, Job, Recipe, Task, Work};
use crate::store::Reading;
use meshsnap_inspect::check::RuleSet;

/// The keys of a check, beside those that say how the mesh is read.
const KEYS: [&str; 4] = ["rules", "warn", "fail", "places"];

/// A request for a verdict, once it is read.
pub enum Asked {
    /// One that was found valid.
    New {
        /// The work for a worker.
        work: Box<Work>,
        /// The name of its answer: a digest of all that decides it.
        key: String,
    },
    /// One that was accepted before, as this job.
    Known(Arc<Job>),
}

/// Reads a request for a verdict. Every fault that shows without reading the mesh is found here.
pub async fn receive(state: &AppState, request: Request, class: Class) -> Result<Asked, ApiError> {
    body::check_header(request.headers(), state.body_bytes_max)?;
    let (reading, mut keys) = Keys::of_query(request.uri(), &KEYS)?;
    // Before the upload, so that a mistake costs none.
    task(&keys, Digest::of(b""))?;
    let sender = Sender::of(state, &request, class)?;
    sender.check_room(state, request.headers(), class)?;
    let headers = request.headers().clone();
    let upload = read_upload(state, request).await?;
    let claim = match &sender.name {
        None => None,
        Some(name) => {
            let pairs = keys.pairs().iter().cloned().chain([("kind".to_owned(), "check".to_owned())]);
            let query = Query { reading: reading.clone(), overrides: pairs.collect() };
            let digest = idempotency::digest(&query, &upload, &headers).await?;
            match idempotency::check(state, name, digest).await? {
                Sent::First(claim) => Some(claim),
                Sent::Again(job) => return Ok(Asked::Known(job)),
            }
        }
    };
    let (work, digest) = if let Some(document) = document_of(&upload, &reading, &headers) {
        let [digest] = keys.add_document(document, &KEYS, ["mesh"])?;
        let stored = stored_mesh::find(state, Some(&digest.to_string()), &sender.access).await?;
        let recipe = Recipe { document: None, overrides: keys.pairs().into(), mesh: Some(digest) };
        let work = stored_mesh::work_on(&stored, reading.clone(), task(&keys, digest)?);
        (Work { recipe: Some(Arc::new(recipe)), ..work }, digest)
    } else {
        if upload.kind != BodyKind::Form {
            upload.bundle.check_sent().map_err(|error| ApiError::from(&error))?;
        }
        let named = upload::name(upload).await?;
        let recipe = Recipe { document: None, overrides: keys.pairs().into(), mesh: None };
        let work = stored_mesh::work(named.bundle, reading.clone(), task(&keys, named.digest)?, named.memory);
        (Work { recipe: Some(Arc::new(recipe)), ..work }, named.digest)
    };
    let key = key(digest, &reading, &keys)?;
    Ok(Asked::New { work: Box::new(sender.sign(work, claim)), key })
}

/// The task of these keys on the upload of this name.
pub fn task(keys: &Keys, digest: Digest) -> Result<Task, ApiError> {
    let (rules, all_places, may_fail) = (rules(keys)?, all_places(keys)?, keys.may_fail()?);
    Ok(Task::Check(Box::new(Checking { rules, all_places, digest, may_fail })))
}

fn all_places(keys: &Keys) -> Result<bool, ApiError> {
    match keys.get("places") {
        None | Some("first") => Ok(false),
        Some("all") => Ok(true),
        Some(other) => Err(bad("out_of_range", format!("`places` is {}, and allowed are first, all", quote(other)))),
    }
}

fn rules(keys: &Keys) -> Result<RuleSet, ApiError> {
    let (given, warn) = (keys.get("rules"), keys.get("warn"));
    if given.is_none() && warn.is_none() {
        return Ok(RuleSet::default());
    }
    let split = |list: Option<&str>| RuleSet::split(list.unwrap_or_default());
    let (given, warn) = (split(given), split(warn));
    if given.is_empty() && warn.is_empty() {
        return Err(bad("out_of_range", "`rules` names no rule: rules=watertight,max-triangles:100000".to_owned()));
    }
    RuleSet::parse(given.iter().map(String::as_str), warn.iter().map(String::as_str))
        .map_err(|error| bad("unknown_rule", format!("`rules`: {error}")))
}

/// The name of an answer. Debug output has every field, exact numbers and quoted text.
fn key(digest: Digest, reading: &Reading, keys: &Keys) -> Result<String, ApiError> {
    let version = env!("CARGO_PKG_VERSION");
    let (rules, all_places) = (rules(keys)?, all_places(keys)?);
    let key = format!("check {version} {digest} {reading:?} {rules:?} {all_places} {}", keys.may_fail()?);
    Ok(format!("\"{}\"", Digest::of(key.as_bytes())))
}
