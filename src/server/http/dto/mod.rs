//! The JSON of answers about jobs, stored meshes, errors and the process. Domain types do not serialise themselves, so
//! that a change of theirs cannot change the interface.
//!
//! Reports on meshes, verdicts and differences are other JSON: the crate `meshsnap-inspect` writes it.

mod capabilities;
mod job;
mod server_status;

pub use capabilities::CapabilitiesDto;
pub use job::{JobDto, JobOfMeshDto, JobsDto};
pub use server_status::ServerStatusDto;

use serde::Serialize;

use super::error::ApiError;
use crate::digest::Digest;
use crate::jobs::Media;
use meshsnap_render::import::Bundle;

/// An error: a problem document (RFC 9457).
#[derive(Serialize)]
pub struct ProblemDto<'a> {
    r#type: String,
    title: &'a str,
    status: u16,
    detail: &'a str,
    code: &'a str,
    request_id: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    flag: Option<&'a str>,
}

impl<'a> ProblemDto<'a> {
    /// The problem document of an error.
    pub fn new(error: &'a ApiError, request_id: &'a str) -> Self {
        let status = error.status();
        Self {
            r#type: format!("urn:meshsnap:error:{}", error.code),
            title: status.canonical_reason().unwrap_or("Error"),
            status: status.as_u16(),
            detail: &error.detail,
            code: error.code,
            request_id,
            flag: error.flag,
        }
    }
}

/// The answer of `/healthz` and `/readyz`.
#[derive(Serialize)]
pub struct StatusDto {
    /// `ok` or `ready`.
    pub status: &'static str,
    /// Faults in spite of which the process takes work.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub problems: Vec<DifficultyDto>,
}

/// Something that does not work for now.
#[derive(Serialize)]
pub struct DifficultyDto {
    /// The code of the error that it is for requests.
    pub code: &'static str,
    /// One sentence.
    pub detail: String,
}

/// The answer of `/version`.
#[derive(Serialize)]
pub struct VersionDto {
    name: &'static str,
    version: &'static str,
    /// The commit that the program is built from, if that is known.
    commit: Option<&'static str>,
}

impl VersionDto {
    /// Name and version of this program.
    pub fn new() -> Self {
        Self { name: "meshsnap", version: env!("CARGO_PKG_VERSION"), commit: option_env!("MESHSNAP_BUILT_FROM") }
    }
}

/// A stored mesh.
#[derive(Serialize)]
pub struct MeshDto {
    sha256: String,
    /// Bytes of its files, as they were sent.
    size_bytes: u64,
    files: usize,
    /// The address of its report.
    pub url: String,
    render_url: String,
}

impl MeshDto {
    /// The stored mesh with this name.
    pub fn new(digest: Digest, bundle: &Bundle) -> Self {
        let url = format!("/v1/meshes/{digest}");
        let render_url = format!("{url}/render.png");
        Self {
            sha256: digest.to_string(),
            size_bytes: bundle.bytes_len(),
            files: bundle.files().len(),
            url,
            render_url,
        }
    }
}

/// The media type of a result.
pub fn media_type(media: Media) -> &'static str {
    match media {
        Media::Picture(format) => format.media_type(),
        Media::Json => "application/json",
    }
}
