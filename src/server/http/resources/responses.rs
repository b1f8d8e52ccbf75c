//! Answers that several resources give: a picture or a verdict with its headers, the state of a job, and JSON that caches
//! must not keep. A verdict that failed gets its 422 here, if the request asks for that (`fail=422`).

use axum::Json;
use axum::body::Body;
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde::Serialize;

use crate::http::conditional;
use crate::http::dto::{JobDto, media_type};
use crate::http::error::IsAnswer;
use crate::jobs::{Finished, Job, Media, Timings};
use crate::pictures::{FoundPicture, Source};

/// A picture, with its back-end, timings and warnings as headers, or a verdict.
pub fn result(finished: &Finished) -> Response {
    with_tag(finished, &conditional::content_tag(&finished.content))
}

fn with_tag(finished: &Finished, tag: &str) -> Response {
    match finished.media {
        Media::Picture(_) => picture_with_tag(finished, tag),
        Media::Json => verdict_with_tag(finished, tag),
    }
}

fn verdict_with_tag(finished: &Finished, tag: &str) -> Response {
    let Timings { queue, parse, render, .. } = finished.timings;
    let timings = [("queue", queue), ("parse", parse), ("judge", render)];
    let timings = timings.map(|(name, took)| format!("{name};dur={:.3}", took.as_secs_f64() * 1e3));
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type(finished.media))),
        conditional::etag(tag),
        (HeaderName::from_static("server-timing"), header_text(&timings.join(", "))),
    ];
    let status = if finished.has_failed { StatusCode::UNPROCESSABLE_ENTITY } else { StatusCode::OK };
    let mut response = (status, headers, finished.content.clone()).into_response();
    response.extensions_mut().insert(IsAnswer);
    response
}

fn picture_with_tag(finished: &Finished, tag: &str) -> Response {
    // The stages of drawing are parts of `render`.
    let drawing = finished.draw_times.parts().map(|(stage, took)| (stage.name(), took));
    let timings = finished.timings.parts().into_iter().chain(drawing);
    let timings: Vec<_> = timings
        .map(|(name, took)| {
            let note = if name == "parse" && finished.mesh_was_kept { ";desc=resident" } else { "" };
            format!("{name};dur={:.3}{note}", took.as_secs_f64() * 1e3)
        })
        .collect();
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type(finished.media))),
        conditional::etag(tag),
        (HeaderName::from_static("x-render-backend"), HeaderValue::from_static(finished.backend.name())),
        (HeaderName::from_static("server-timing"), header_text(&timings.join(", "))),
    ];
    // Codes only: the sentences are in the job's state.
    let mut codes: Vec<&str> = Vec::new();
    for warning in &finished.warnings {
        if !codes.contains(&warning.code) {
            codes.push(warning.code);
        }
    }
    let warnings = (!codes.is_empty()).then(|| (HeaderName::from_static("x-warnings"), header_text(&codes.join(", "))));
    let choice = finished.selection.as_ref().map(|choice| {
        [
            (HeaderName::from_static("x-expected-error"), header_text(&choice.expected_error.to_string())),
            (HeaderName::from_static("x-chosen"), header_text(&choice.to_string())),
        ]
    });
    let mut response = (StatusCode::OK, headers, finished.content.clone()).into_response();
    response.headers_mut().extend(choice.into_iter().flatten().chain(warnings));
    response
}

/// As [`result`], and whether it was in memory. A picture that this request has not drawn brings its
/// age instead of timings. Its tag is `tag`, if it has an address; the bytes are then not hashed.
pub fn found(found: &FoundPicture, tag: Option<&str>) -> Response {
    let mut response = match tag {
        Some(tag) => with_tag(&found.finished, tag),
        None => result(&found.finished),
    };
    let headers = response.headers_mut();
    headers.insert("x-cache", HeaderValue::from_static(found.source.name()));
    if found.source != Source::Miss {
        headers.remove("server-timing");
        headers.insert(header::AGE, HeaderValue::from(found.age.as_secs()));
    }
    response
}

/// 202 with the state and the location of an accepted job.
pub fn accepted(job: &Job) -> Response {
    let mut response = (StatusCode::ACCEPTED, job_state(job)).into_response();
    response.headers_mut().insert(header::LOCATION, header_text(&format!("/v1/jobs/{}", job.id)));
    response
}

/// The state of a job.
pub fn job_state(job: &Job) -> Response {
    uncached(JobDto::new(job))
}

/// JSON that caches must not keep, because it changes.
pub fn uncached(body: impl Serialize) -> Response {
    ([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response()
}

/// The body of an answer to HEAD whose content was not made: its length is unknown.
pub fn body_of_unknown_length() -> Body {
    Body::from_stream(futures_util::stream::empty::<Result<Bytes, std::convert::Infallible>>())
}

/// Sets `Preference-Applied`.
pub fn set_preference_applied(response: &mut Response, preference: &str) {
    response.headers_mut().insert("preference-applied", header_text(preference));
}

/// A header's value; empty if the text cannot stand in a header.
pub fn header_text(text: &str) -> HeaderValue {
    HeaderValue::from_str(text).unwrap_or_else(|_| HeaderValue::from_static(""))
}
