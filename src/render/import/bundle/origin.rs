//! The origin of an upload: an HTTP request, a command, or a call of the library. It decides the
//! words of messages: a file is missing because "the upload lacks" it or because "the command does
//! not name" it.
//!
//! Here is also the record (`FileUse`) of the files that a mesh used, and of those that it named
//! and that are not there.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::show;

/// Most missing files that are remembered. Messages name fewer.
const MISSING_MAX: usize = 100;

/// Who gave the files of a bundle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum Origin {
    /// An HTTP request.
    #[default]
    Request,
    /// The arguments of a command.
    Command,
    /// A caller of the library.
    Library,
}

impl Origin {
    /// A single file without a name.
    pub fn unnamed(self) -> &'static str {
        match self {
            Self::Request => "the body",
            Self::Command => "the input",
            Self::Library => "the file",
        }
    }

    /// All files, as a place that names may lead out of.
    pub fn whole(self) -> &'static str {
        match self {
            Self::Request => "the upload",
            Self::Command => "the folder of the files that are named",
            Self::Library => "the files that were given",
        }
    }

    /// The beginning of a sentence that ends with the names of missing files.
    pub fn lacks(self) -> &'static str {
        match self {
            Self::Request => "the upload lacks",
            Self::Command => "the command does not name",
            Self::Library => "the reader was not given",
        }
    }

    /// What to do with an archive that is not opened because it is not alone.
    pub fn send_alone(self) -> &'static str {
        match self {
            Self::Request => "only one that is the whole upload is opened: send it alone, or the files that are in it",
            Self::Command => {
                "only one that is named alone is opened: name nothing else, or name the files that are in it"
            }
            Self::Library => "only one that is alone is opened: give it alone, or the files that are in it",
        }
    }

    /// How the format of the mesh is named.
    pub fn format_option(self) -> &'static str {
        match self {
            Self::Request => "format_in",
            Self::Command => "--format-in",
            Self::Library => "`MeshReader::format`",
        }
    }

    /// How the mesh among several is named.
    pub fn entry_option(self) -> &'static str {
        match self {
            Self::Request => "`entry`",
            Self::Command => "--entry",
            Self::Library => "`MeshReader::entry`",
        }
    }
}

/// A record of the files that a mesh used, and of those that it named in vain. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct FileUse(Arc<Mutex<Seen>>);

#[derive(Debug, Default)]
struct Seen {
    used: BTreeSet<String>,
    missing: BTreeSet<Missing>,
}

/// A file that is named in another and is not in the bundle.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct Missing {
    /// The folder of the file that names it, in the bundle.
    pub folder: String,
    /// The name, shortened.
    pub name: String,
}

impl FileUse {
    /// The paths of the files that were used.
    pub fn used(&self) -> BTreeSet<String> {
        self.with(|seen| seen.used.clone())
    }

    /// The names that led to no file.
    pub fn missing(&self) -> Vec<Missing> {
        self.with(|seen| seen.missing.iter().cloned().collect())
    }

    /// Notes that a file was used.
    pub(crate) fn add_used(&self, path: &str) {
        self.with(|seen| {
            if !seen.used.contains(path) {
                seen.used.insert(path.to_owned());
            }
        });
    }

    /// Notes that a file in `folder` names one that is not there.
    pub(crate) fn add_missing(&self, folder: &str, name: &str) {
        self.with(|seen| {
            if seen.missing.len() < MISSING_MAX {
                seen.missing.insert(Missing { folder: folder.to_owned(), name: show(name) });
            }
        });
    }

    fn with<T>(&self, work: impl FnOnce(&mut Seen) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
