//! The records in the database of the data folder (jobs, their ends, stored meshes), and the changes
//! that a transaction makes to them. The records are stored as JSON. A new field has a default, and no
//! field changes its meaning, so that a later version can read the folders of earlier ones.

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::digest::Digest;

/// The name of a job: the number of its UUID.
pub type JobKey = u128;

/// A change of the log. The changes of one transaction are made together or not at all.
#[derive(Clone, Debug)]
pub enum Change {
    /// A job was accepted.
    Accepted(Box<JobRecord>),
    /// A worker has begun a job.
    Started(JobKey),
    /// A job has ended.
    Ended(JobKey, Box<EndRecord>),
    /// A client has fetched the result of a job.
    Fetched(JobKey, u64),
    /// Nothing more is sent to the webhook of a job.
    Notified(JobKey, u64),
    /// A job has expired.
    Forgotten(JobKey),
    /// A mesh was stored, by other parties too if it is there: it then gets their names alone.
    MeshStored(Box<MeshRecord>),
    /// A party has deleted a mesh that others have, too.
    MeshDisowned(Digest, String),
    /// A mesh was removed.
    MeshRemoved(Digest),
    /// Bytes that are kept in the log.
    SmallStored(Digest, Bytes),
    /// Bytes that nothing needs any more.
    SmallRemoved(Digest),
}

/// A job as it was accepted.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct JobRecord {
    /// Its name.
    #[serde(with = "hexadecimal")]
    pub key: JobKey,
    /// The time of acceptance in milliseconds since 1970.
    pub accepted_unix_ms: u64,
    /// The request.
    pub request: RequestRecord,
    /// The files of the mesh.
    pub files: Vec<FileRecord>,
    /// True if they are an archive that is not yet unpacked.
    pub is_zip: bool,
    /// The format that the request gives.
    pub format_in: Option<String>,
    /// The file that is the mesh, if the request names it.
    pub entry: Option<String>,
    /// The party that asked for it.
    #[serde(default)]
    pub owner: String,
    /// The id of the request that brought it.
    #[serde(default)]
    pub request_id: String,
    /// The name of the stored mesh that is drawn.
    #[serde(with = "optional_digest", default)]
    pub mesh: Option<Digest>,
    /// The newer one of two meshes that are compared.
    #[serde(default)]
    pub newer: Option<SideRecord>,
    /// The name that the client gave the request.
    #[serde(default)]
    pub claim: Option<ClaimRecord>,
    /// The address that hears of its end.
    #[serde(default)]
    pub webhook: Option<String>,
    /// The request asks for a GPU.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub needs_gpu: bool,
    /// The place of the request in a trace, as a `traceparent` of W3C Trace Context.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traceparent: Option<String>,
}

/// One of two meshes that are compared.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SideRecord {
    /// Its files.
    pub files: Vec<FileRecord>,
    /// True if they are an archive that is not yet unpacked.
    pub is_zip: bool,
    /// Its name, if it is stored.
    #[serde(with = "optional_digest", default)]
    pub mesh: Option<Digest>,
}

/// The name of a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClaimRecord {
    /// The name.
    pub key: String,
    /// The digest of the request.
    #[serde(with = "digest")]
    pub request: Digest,
}

/// A request, as it was sent.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RequestRecord {
    /// The bytes of the document.
    #[serde(with = "optional_digest", default)]
    pub document: Option<Digest>,
    /// True if the document also names its mesh.
    pub names_mesh: bool,
    /// The dotted keys.
    pub overrides: Vec<(String, String)>,
    /// The picture's format, as it was negotiated.
    pub format: String,
    /// The work that is asked for.
    #[serde(default)]
    pub kind: RequestKind,
    /// The name of the upload that a verdict is on.
    #[serde(with = "optional_digest", default)]
    pub upload: Option<Digest>,
}

/// The work that a request asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RequestKind {
    /// A picture.
    #[default]
    Draw,
    /// A verdict on a mesh.
    Check,
    /// The difference between two meshes.
    Diff,
}

/// A file of a mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FileRecord {
    /// Its path in the bundle.
    pub path: String,
    /// Its content.
    #[serde(with = "digest")]
    pub digest: Digest,
}

/// The end of a job.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EndRecord {
    /// The time of the end in milliseconds since 1970.
    pub at_unix_ms: u64,
    /// The time at which a client first fetched the result.
    #[serde(default)]
    pub fetched_unix_ms: Option<u64>,
    /// The time at which its webhook had it, or was given up.
    #[serde(default)]
    pub notified_unix_ms: Option<u64>,
    /// The picture of a job that is done.
    #[serde(default)]
    pub picture: Option<PictureRecord>,
    /// The error of a job that failed. A job with neither was cancelled.
    #[serde(default)]
    pub error: Option<ErrorRecord>,
}

/// A picture and the metadata of its making.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PictureRecord {
    /// Its bytes.
    #[serde(with = "digest")]
    pub digest: Digest,
    /// Its format; `json` for a verdict.
    pub format: String,
    /// True for a verdict that is to be answered with 422.
    #[serde(default)]
    pub has_failed: bool,
    /// The back-end that drew it.
    pub backend: String,
    /// True if the CPU drew it in place of a GPU.
    pub is_substitute: bool,
    /// True if its mesh was in memory.
    pub mesh_was_kept: bool,
    /// Faults of the file in spite of which it was drawn.
    pub warnings: Vec<WarningRecord>,
    /// The techniques that were chosen.
    #[serde(default)]
    pub selection: Option<SelectionRecord>,
    /// The duration of each stage in order, microseconds.
    pub timings_us: [u64; 5],
}

/// A warning.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WarningRecord {
    /// Its name.
    pub code: String,
    /// Its sentence.
    pub detail: String,
}

/// The techniques that were chosen for a request with a quality target.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SelectionRecord {
    /// Samples per pixel; 0 for adaptive ones.
    pub samples: u32,
    /// The methods by which wires were drawn.
    pub wire_methods: Vec<String>,
    /// The back-end.
    pub backend: String,
    /// The expected error.
    pub expected_error: f64,
    /// The expected time, milliseconds.
    pub expected_time_ms: f64,
}

/// The error of a failed job, in the words of the interface.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorRecord {
    /// The party at fault.
    pub fault: String,
    /// The stable name.
    pub code: String,
    /// One sentence.
    pub detail: String,
    /// The flag that raises the limit.
    #[serde(default)]
    pub flag: Option<String>,
}

/// A stored mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeshRecord {
    /// Its name.
    #[serde(with = "digest")]
    pub digest: Digest,
    /// Its files.
    pub files: Vec<FileRecord>,
    /// The way in which it was read for the report: the format that was given.
    pub format_in: Option<String>,
    /// The file that is the mesh, if it was named.
    pub entry: Option<String>,
    /// The party that stored it first.
    #[serde(default)]
    pub owner: String,
    /// Those that stored it later.
    #[serde(default)]
    pub later_owners: Vec<String>,
    /// The bytes of its report.
    #[serde(with = "digest")]
    pub report: Digest,
}

impl MeshRecord {
    /// All parties that have it.
    pub fn owners(&self) -> impl Iterator<Item = &String> {
        [&self.owner].into_iter().chain(&self.later_owners)
    }

    /// Adds the owners of another record of the mesh.
    pub fn add_owners(&mut self, other: &Self) {
        for owner in other.owners() {
            if !self.owners().any(|known| known == owner) {
                self.later_owners.push(owner.clone());
            }
        }
    }

    /// Removes an owner. The last one stays: its mesh is removed whole.
    pub fn remove_owner(&mut self, owner: &str) {
        self.later_owners.retain(|known| known != owner);
        if self.owner == owner && !self.later_owners.is_empty() {
            self.owner = self.later_owners.remove(0);
        }
    }
}

/// A job's key as the hexadecimal digits of its UUID: JSON has no numbers of this size.
mod hexadecimal {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    pub fn serialize<S: Serializer>(key: &u128, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&format!("{key:032x}"))
    }

    pub fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<u128, D::Error> {
        u128::from_str_radix(&String::deserialize(from)?, 16).map_err(D::Error::custom)
    }
}

/// A digest as its text.
mod digest {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    use crate::digest::Digest;

    pub fn serialize<S: Serializer>(digest: &Digest, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(digest)
    }

    pub fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<Digest, D::Error> {
        Digest::parse(&String::deserialize(from)?).ok_or_else(|| D::Error::custom("no SHA-256"))
    }
}

/// The same, or null.
mod optional_digest {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    use crate::digest::Digest;

    pub fn serialize<S: Serializer>(digest: &Option<Digest>, to: S) -> Result<S::Ok, S::Error> {
        match digest {
            Some(digest) => to.collect_str(digest),
            None => to.serialize_none(),
        }
    }

    pub fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<Option<Digest>, D::Error> {
        let parse = |text: String| Digest::parse(&text).ok_or_else(|| D::Error::custom("no SHA-256"));
        Option::<String>::deserialize(from)?.map(parse).transpose()
    }
}
