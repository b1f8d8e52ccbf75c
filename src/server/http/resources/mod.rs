//! The handlers, one file per resource, and what several of them share: [`run`] waits for a worker,
//! [`responses`] writes answers that more than one resource gives.
//!
//! A handler is named after its HTTP method, or after the end of its path where a file has several for one method. No
//! handler parses a mesh or draws: such work goes to the job queue.

pub mod events;
pub mod health;
pub mod jobs;
pub mod meshes;
pub mod metrics;
pub mod pages;
pub mod pictures;
pub mod render;
mod responses;
mod run;
pub mod schema;
pub mod status;
pub mod verdicts;

use axum::extract::Path;
use axum::extract::rejection::PathRejection;

/// The one variable segment of a path. It is a rejection if the segment is not UTF-8.
type PathName = Result<Path<String>, PathRejection>;

/// The segment's text. None if it is not UTF-8.
fn text_of(name: PathName) -> Option<String> {
    name.ok().map(|Path(text)| text)
}
