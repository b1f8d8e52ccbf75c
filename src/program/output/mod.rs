//! The place to which a command writes a picture or a report: a file, standard output, or a device or pipe. A file
//! that is given as an input is refused. A file is replaced as a whole: the bytes are written to a new file beside
//! it, which then takes its name.

mod unfinished;

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};

use same_file::Handle;
use tempfile::NamedTempFile;

use super::bundle::comparable;
use super::files;
use crate::error::CliError;

/// Most symbolic links from a name to its file, as Linux has it.
const LINKS_MAX: usize = 40;

/// The files that a command reads, which no output may replace.
#[derive(Debug, Default)]
pub struct Inputs(HashMap<Identity, String>);

/// The identity that two names of one file share.
#[cfg(unix)]
type Identity = (u64, u64);
/// The identity that two names of one file share. The file stays open, so that no other gets its number.
#[cfg(not(unix))]
type Identity = Handle;

#[cfg(unix)]
fn identity(handle: Handle) -> Identity {
    (handle.dev(), handle.ino())
}

#[cfg(not(unix))]
fn identity(handle: Handle) -> Identity {
    handle
}

/// The place of a picture.
#[derive(Debug)]
pub enum Destination {
    /// Standard output.
    Stdout,
    /// A file, with its symbolic links resolved.
    File(PathBuf),
    /// A device or a pipe, which is written to and not replaced.
    Stream(PathBuf),
}

impl Inputs {
    /// The files with these names. `-` is standard input, which may come from a file.
    pub fn of<'n>(names: impl Iterator<Item = &'n str>) -> Self {
        let handle = |name: &str| match name {
            "-" => Handle::stdin(),
            name => Handle::from_path(name),
        };
        // A file that cannot be opened is reported where it is read.
        Self(names.filter_map(|name| Some((identity(handle(name).ok()?), name.to_owned()))).collect())
    }

    /// The input that the file at `path` is, by whatever name or link.
    fn name_of(&self, path: &Path) -> Option<&str> {
        self.0.get(&identity(Handle::from_path(path).ok()?)).map(String::as_str)
    }
}

impl Destination {
    /// The place that `name` means. Refuses one that is an input, a folder, or in no folder.
    pub fn new(name: &str, inputs: &Inputs) -> Result<Self, CliError> {
        if name == "-" && io::stdout().is_terminal() {
            let sentence = "standard output is a terminal, which shows no pictures; give -o FILE, or a pipe";
            return Err(CliError::usage(sentence));
        }
        if name == "-" {
            return Ok(Self::Stdout);
        }
        let path = resolve_links(name)?;
        let metadata = fs::metadata(&path).ok();
        if name.ends_with(std::path::is_separator) || metadata.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(CliError::usage(format!("{name}: is a folder; give the name of a file")));
        }
        if metadata.as_ref().is_some_and(|metadata| !metadata.is_file()) {
            return Ok(Self::Stream(path));
        }
        if let Some(input) = inputs.name_of(&path) {
            let which = if input == name {
                "is the input itself".into()
            } else {
                format!("is the same file as the input {input}")
            };
            return Err(CliError::usage(format!(
                "{name}: {which}, and inputs are never written over; give another name"
            )));
        }
        if metadata.is_some_and(|metadata| metadata.permissions().readonly()) {
            return Err(CliError::usage(format!("{name}: is read-only; give another name, or make it writable")));
        }
        let folder = folder_of(&path);
        match fs::metadata(folder) {
            Ok(metadata) if metadata.is_dir() => Ok(Self::File(path)),
            Ok(_) => Err(CliError::usage(format!("{name}: cannot be written: {} is no folder", folder.display()))),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let folder = folder.display();
                Err(CliError::usage(format!("{name}: cannot be written: there is no folder {folder}; make it first")))
            }
            Err(error) => Err(unwritable(name, &error)),
        }
    }

    /// True if both are one file, which need not exist yet. Streams are written one after the other.
    pub fn is_same_file(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::File(path), Self::File(other)) => {
                let exist_as_one = || same_file::is_same_file(path, other).unwrap_or(false);
                comparable(path) == comparable(other) || exist_as_one()
            }
            _ => false,
        }
    }

    /// Writes all bytes, or none of them under the file's name.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        match self {
            Self::Stdout => files::print(bytes),
            Self::Stream(path) => {
                let mut stream = OpenOptions::new().write(true).open(path).map_err(|error| unwritable(name, &error))?;
                stream.write_all(bytes).map_err(|error| unwritable(name, &error))
            }
            Self::File(path) => replace(path, bytes).map_err(|error| unwritable(name, &error)),
        }
    }
}

/// Writes a file beside `path` and renames it, so that `path` has its old content, or none, or all
/// of the new.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = unfinished::create(|| create_beside(path))?;
    let written = file.as_file_mut().write_all(bytes).and_then(|()| keep_permissions(path, file.as_file()));
    unfinished::finish(file, |file| match written {
        Ok(()) => file.persist(path).map(drop).map_err(|error| error.error),
        Err(error) => Err(error),
    })
}

/// A new file with a name of its own in the folder of `path`.
fn create_beside(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".meshsnap-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // As of any new file: what the umask takes away is not there.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

/// Gives the new file the permissions of the one that it replaces.
fn keep_permissions(path: &Path, file: &File) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(metadata) => file.set_permissions(metadata.permissions()),
        Err(_) => Ok(()),
    }
}

/// Follows symbolic links to the file that is to be replaced, which need not exist.
fn resolve_links(name: &str) -> Result<PathBuf, CliError> {
    let mut path = PathBuf::from(name);
    for _ in 0..LINKS_MAX {
        let Ok(target) = fs::read_link(&path) else { return Ok(path) };
        path = folder_of(&path).join(target);
    }
    Err(CliError::usage(format!("{name}: its symbolic links lead in a circle")))
}

/// The folder that a path is in.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn unwritable(name: &str, error: &io::Error) -> CliError {
    let sentence = format!("{name}: cannot be written: {error}");
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::PermissionDenied | ErrorKind::IsADirectory | ErrorKind::ReadOnlyFilesystem => {
            CliError::usage(sentence)
        }
        _ => CliError::ours(sentence),
    }
}
