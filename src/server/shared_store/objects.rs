//! The form of the objects in the shared store: one line of JSON that describes them, then bytes. `head -n 1` prints the
//! line. What is read is checked against digests, so that a damaged object is no mesh and no picture.

use bytes::Bytes;
use object_store::PutPayload;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::durable::PictureRecord;
use crate::jobs::{Finished, Owner, picture_record, read_picture as finished};
use crate::store::{NewMesh, Reading};
use meshsnap_render::import::{Bundle, BundleFile, Format};

/// The first line of a stored mesh. The report's bytes follow, then those of each file.
#[derive(Serialize, Deserialize)]
struct MeshHead {
    /// The party that stored it.
    owner: String,
    /// The way in which it was read for the report.
    format_in: Option<String>,
    entry: Option<String>,
    report_bytes: usize,
    report_sha256: String,
    files: Vec<FileHead>,
}

#[derive(Serialize, Deserialize)]
struct FileHead {
    path: String,
    bytes: usize,
}

/// A stored mesh as one of its owners has it.
pub fn of_mesh(mesh: &NewMesh, owner: &Owner) -> PutPayload {
    let files = mesh.bundle.files();
    let head = MeshHead {
        owner: owner.to_string(),
        format_in: mesh.reading.format_in.map(|format| format.name().to_owned()),
        entry: mesh.reading.entry.clone(),
        report_bytes: mesh.report.len(),
        report_sha256: Digest::of(&mesh.report).to_string(),
        files: files.iter().map(|file| FileHead { path: file.path.clone(), bytes: file.bytes.len() }).collect(),
    };
    let parts = [line_of(&head), mesh.report.clone()].into_iter();
    parts.chain(files.iter().map(|file| file.bytes.clone())).collect()
}

/// The mesh of this name. None if the bytes are not an object of it.
pub fn read_mesh(digest: Digest, object: Bytes) -> Option<NewMesh> {
    let (head, mut rest) = split::<MeshHead>(object)?;
    let mut take = |bytes: usize| (bytes <= rest.len()).then(|| rest.split_to(bytes));
    let format_in = match &head.format_in {
        // A later version may know more formats.
        Some(name) => Some(Format::from_name(name)?),
        None => None,
    };
    let report = take(head.report_bytes)?;
    if Digest::of(&report).to_string() != head.report_sha256 {
        return None;
    }
    let mut files = Vec::new();
    for file in head.files {
        files.push(BundleFile { path: file.path, bytes: take(file.bytes)? });
    }
    // A file is named by its bytes, a form by its list of files.
    let is_file = files.len() == 1 && Digest::of(&files[0].bytes) == digest;
    if !is_file && Digest::of_files(&files) != digest {
        return None;
    }
    Some(NewMesh {
        digest,
        bundle: Bundle::of_files(files),
        reading: Reading { format_in, entry: head.entry },
        report,
        owners: vec![Owner::new(&head.owner)],
    })
}

/// A picture.
pub fn of_picture(picture: &Finished) -> PutPayload {
    let record = picture_record(picture, Digest::of(&picture.content));
    [line_of(&record), picture.content.clone()].into_iter().collect()
}

/// A picture. None if the bytes are not an object of one, or if this version does not know a word of it.
pub fn read_picture(object: Bytes) -> Option<Finished> {
    let (record, content) = split::<PictureRecord>(object)?;
    if Digest::of(&content) != record.digest {
        return None;
    }
    finished(record, content)
}

pub(super) fn line_of(head: &impl Serialize) -> Bytes {
    // Structs of texts and numbers always have JSON.
    let mut line = serde_json::to_vec(head).unwrap_or_default();
    line.push(b'\n');
    line.into()
}

pub(super) fn split<H: DeserializeOwned>(mut object: Bytes) -> Option<(H, Bytes)> {
    let end = object.iter().position(|&byte| byte == b'\n')?;
    let line = object.split_to(end + 1);
    Some((serde_json::from_slice(&line).ok()?, object))
}
