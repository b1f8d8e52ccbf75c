//! A request for the difference between two meshes: both, or the names of stored ones.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::Request;
use axum::http::HeaderMap;

use super::body::{self, BodyLimits, sides};
use super::check::Asked;
use super::idempotency::{self, Sent};
use super::keys::Keys;
use super::query::bad;
use super::sender::Sender;
use crate::digest::Digest;
use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::http::{negotiate, stored_mesh};
use crate::jobs::{Class, Comparing, Newer, Recipe, Task, Work};
use crate::keys::Access;
use crate::memory::MemoryShare;
use crate::store::Reading;
use meshsnap_inspect::diff;
use meshsnap_render::image::ImageFormat;
use meshsnap_render::import::Bundle;
use meshsnap_render::request;
use meshsnap_render::spec::Spec;

/// The keys of a difference, beside those that say how the meshes are read: first its own, then those of the picture.
const KEYS: [&str; 11] = [
    "max_distance",
    "fail",
    "format",
    "size",
    "view",
    "up",
    "background",
    "camera.azimuth_deg",
    "camera.elevation_deg",
    "camera.projection",
    "image.effort",
];
const OWN_KEYS: usize = 3;

/// Least width and height of each side in a picture, pixels.
const SIDE_PX_MIN: u32 = 16;

/// Two meshes with their names.
struct Meshes {
    digests: [Digest; 2],
    older: Work,
    newer: Newer,
    /// True if both are stored.
    are_stored: bool,
}

/// Reads a request for a difference. Every fault that shows without reading the meshes is found here.
pub async fn receive(state: &AppState, request: Request, class: Class) -> Result<Asked, ApiError> {
    body::check_header(request.headers(), state.body_bytes_max)?;
    let (reading, mut keys) = Keys::of_query(request.uri(), &KEYS)?;
    // Before the upload, so that a mistake costs none.
    Answer::of(state, &keys, form_of_answer(&keys, request.headers())?)?;
    let sender = Sender::of(state, &request, class)?;
    sender.check_room(state, request.headers(), class)?;
    let headers = request.headers().clone();
    let (bytes, files, time) = (state.body_bytes_max, state.rules.limits.bundle_entries, state.body_timeout);
    let (least_rate, memory) = (state.least_rate, &state.memory);
    let limits = BodyLimits { bytes, files, meshes: None, time, least_rate, memory };
    let meshes = match sides::read(request, limits).await? {
        sides::Sides::Document(document) => stored(state, &document, &mut keys, &reading, &sender.access).await?,
        sides::Sides::Meshes { bundles, reservations } => sent(bundles, reservations, &reading).await?,
    };
    let answer = Answer::of(state, &keys, form_of_answer(&keys, &headers)?)?;
    let key = answer.key(&meshes.digests, &reading);
    let claim = match &sender.name {
        None => None,
        Some(name) => match idempotency::check(state, name, Digest::of(key.as_bytes())).await? {
            Sent::First(claim) => Some(claim),
            Sent::Again(job) => return Ok(Asked::Known(job)),
        },
    };
    let mesh = meshes.are_stored.then_some(meshes.digests[0]);
    let recipe = Some(Arc::new(Recipe { document: None, overrides: keys.pairs().into(), mesh }));
    let work = Work { task: answer.task(meshes.newer), recipe, ..meshes.older };
    Ok(Asked::New { work: Box::new(sender.sign(work, claim)), key })
}

/// The stored meshes that a document names.
async fn stored(
    state: &AppState,
    document: &Bytes,
    keys: &mut Keys,
    reading: &Reading,
    access: &Access,
) -> Result<Meshes, ApiError> {
    let digests = keys.add_document(document, &KEYS, sides::PARTS)?;
    let [a, b] = digests.map(|digest| digest.to_string());
    let (a, b) = (stored_mesh::find(state, Some(&a), access).await?, stored_mesh::find(state, Some(&b), access).await?);
    let bundle = b.mesh.bundle.clone().with_entry(reading.entry.clone());
    let newer = Newer { bundle, memory: b.memory.clone(), holds: b.holds.clone(), mesh: Some(digests[1]) };
    let work = stored_mesh::work_on(&a, reading.clone(), Task::Inspect { time_s: None });
    // Meshes in memory have no report of their import, so they are read anew.
    Ok(Meshes { digests, older: Work { mesh_key: None, ..work }, newer, are_stored: true })
}

/// Two meshes that were sent.
async fn sent(bundles: [Bundle; 2], memory: [MemoryShare; 2], reading: &Reading) -> Result<Meshes, ApiError> {
    for bundle in &bundles {
        bundle.check_sent().map_err(|error| ApiError::from(&error))?;
    }
    // Hashing large bodies would block other requests.
    let naming = tokio::task::spawn_blocking(move || {
        let digests = bundles.each_ref().map(|bundle| match bundle.files() {
            [single] => Digest::of(&single.bytes),
            files => Digest::of_files(files),
        });
        (bundles, memory, digests)
    });
    let ([a, b], [memory_a, memory_b], digests) = naming.await.map_err(|_| ApiError::internal())?;
    let bundle = b.with_entry(reading.entry.clone());
    let newer = Newer { bundle, memory: Arc::new(memory_b), holds: [].into(), mesh: None };
    let older = stored_mesh::work(a, reading.clone(), Task::Inspect { time_s: None }, Arc::new(memory_a));
    Ok(Meshes { digests, older, newer, are_stored: false })
}

/// The form of the answer: a picture of this format, or else JSON.
pub fn form_of_answer(keys: &Keys, headers: &HeaderMap) -> Result<Option<ImageFormat>, ApiError> {
    match keys.get("format") {
        Some("json") => Ok(None),
        Some("png") => Ok(Some(ImageFormat::Png)),
        Some("webp") => Ok(Some(ImageFormat::Webp)),
        Some("jpeg") => Ok(Some(ImageFormat::Jpeg)),
        Some(other) => {
            let detail =
                format!("`format` is {}, and allowed is one of json, png, webp, jpeg", super::query::quote(other));
            Err(bad("out_of_range", detail))
        }
        None => negotiate::json_or_image(headers),
    }
}

/// The form of an answer about two meshes, and its tolerance.
pub struct Answer {
    max_distance: Option<f64>,
    picture: Option<Box<Spec>>,
    may_fail: bool,
}

impl Answer {
    /// Reads the keys.
    pub fn of(state: &AppState, keys: &Keys, format: Option<ImageFormat>) -> Result<Self, ApiError> {
        let max_distance = keys.get("max_distance").map(|text| {
            let distance = text.parse::<f64>().ok().filter(|distance| distance.is_finite() && *distance >= 0.0);
            let given = super::query::quote(text);
            distance.ok_or_else(|| {
                bad(
                    "out_of_range",
                    format!("`max_distance` is {given}, and allowed is a number from 0 on, such as 0.01"),
                )
            })
        });
        let may_fail = keys.may_fail()?;
        if may_fail && format.is_some() {
            let detail = "`fail` is for JSON, and the answer is a picture: ask for one of both";
            return Err(bad("conflicting_keys", detail.to_owned()));
        }
        let given = keys.pairs().iter().filter(|(key, _)| KEYS[OWN_KEYS..].contains(&key.as_str()));
        let mut pairs: Vec<(String, String)> = given.cloned().collect();
        for (key, value) in diff::PICTURE_KEYS {
            if keys.get(key).is_none() {
                pairs.push((key.to_owned(), value.to_owned()));
            }
        }
        let mut spec = request::read(None, &pairs, &state.rules)?;
        let [width_px, height_px] = [spec.image.width_px, spec.image.height_px];
        if width_px < SIDE_PX_MIN * 2 || height_px < SIDE_PX_MIN {
            let detail = format!(
                "`size` is {width_px}x{height_px}, and a picture of two sides has {}x{SIDE_PX_MIN} pixels or more",
                2 * SIDE_PX_MIN
            );
            return Err(bad("out_of_range", detail));
        }
        let picture = format.map(|format| {
            request::set_format(&mut spec, format);
            Box::new(spec)
        });
        Ok(Self { max_distance: max_distance.transpose()?, picture, may_fail })
    }

    /// The task of comparing with a newer mesh.
    pub fn task(self, newer: Newer) -> Task {
        let Self { max_distance, picture, may_fail } = self;
        Task::Diff(Box::new(Comparing { newer, max_distance, picture, may_fail }))
    }

    /// The name of the answer. Debug output has every field, exact numbers and quoted text.
    fn key(&self, [a, b]: &[Digest; 2], reading: &Reading) -> String {
        let Self { max_distance, picture, may_fail } = self;
        let version = env!("CARGO_PKG_VERSION");
        let key = format!("diff {version} {a} {b} {reading:?} {max_distance:?} {picture:?} {may_fail}");
        format!("\"{}\"", Digest::of(key.as_bytes()))
    }
}
