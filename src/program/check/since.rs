//! `meshsnap check --since REF`: leaves out the meshes that have not changed since a git commit, and reads files as
//! they were in that commit, both by the program `git`. A mesh also counts as changed if a file that it names, such
//! as a texture, is new, has changed or is gone in its folder or below.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use percent_encoding::utf8_percent_encode;

use super::SEGMENT;
use crate::error::CliError;
use crate::render::{Task, Tasks, is_companion};

/// The largest mesh in which names of files are looked for, bytes. A larger one counts as changed with any file beside it.
const SEARCHED_BYTES_MAX: u64 = 256 << 20;

/// The largest material library that is searched, bytes.
const LIBRARY_BYTES_MAX: u64 = 16 << 20;

/// The largest pointer of Git LFS, bytes.
const LARGE_FILE_BYTES_MAX: usize = 1024;

/// Leaves out the meshes that have not changed since a commit, here or in git. A mesh counts as changed, too, where a
/// file has, or is gone, whose name is in it, such as a texture in its folder or below, or in its material library.
pub fn keep_changed(tasks: &mut Tasks, reference: &str) -> Result<Commit, CliError> {
    let commit = Commit::find(reference)?;
    let changed = commit.changed()?;
    let companions: Vec<&PathBuf> = changed.iter().filter(|path| is_companion(path)).collect();
    let has_changed = |task: &Task| {
        let Ok(path) = fs::canonicalize(&task.mesh) else { return true };
        let folder = path.parent().unwrap_or(Path::new("/"));
        let beside: Vec<&PathBuf> = companions.iter().copied().filter(|one| one.starts_with(folder)).collect();
        changed.contains(&path) || !beside.is_empty() && names_any(&path, &beside)
    };
    let before = tasks.all.len();
    tasks.all.retain(has_changed);
    tasks.is_part |= tasks.all.len() < before;
    Ok(commit)
}

/// True if a mesh names one of these files, or a material library in its folder that does. Importers find a file by its
/// base name, too, so that is what is looked for, as it is or percent-encoded.
fn names_any(mesh: &Path, files: &[&PathBuf]) -> bool {
    let size = |path: &Path| fs::metadata(path).map_or(u64::MAX, |data| data.len());
    if size(mesh) > SEARCHED_BYTES_MAX {
        return true;
    }
    let Ok(text) = fs::read(mesh) else { return true };
    let mut names: Vec<Vec<u8>> = files.iter().flat_map(|file| spellings(file)).collect();
    let libraries = fs::read_dir(mesh.parent().unwrap_or(Path::new("/"))).into_iter().flatten().flatten();
    let libraries = libraries.map(|entry| entry.path()).filter(|path| {
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mtl")) && size(path) <= LIBRARY_BYTES_MAX
    });
    let naming = libraries.filter(|path| fs::read(path).is_ok_and(|text| has_any(&text, &names)));
    let naming: Vec<Vec<u8>> = naming.flat_map(|path| spellings(&path)).collect();
    names.extend(naming);
    has_any(&text, &names)
}

/// The base name of a file, as texts may spell it, in lower case.
fn spellings(file: &Path) -> Vec<Vec<u8>> {
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let encoded = utf8_percent_encode(&name, SEGMENT).to_string().to_ascii_lowercase();
    // glTF is JSON, which may escape what is not ASCII.
    let escaped = name.encode_utf16().map(|unit| match u8::try_from(unit) {
        Ok(byte) if byte.is_ascii() => char::from(byte).to_string(),
        _ => format!("\\u{unit:04x}"),
    });
    let escaped: String = escaped.collect();
    [name.into_bytes(), encoded.into_bytes(), escaped.into_bytes()].into()
}

/// True if one of these, in lower case, is in a text.
fn has_any(text: &[u8], names: &[Vec<u8>]) -> bool {
    let text = text.to_ascii_lowercase();
    names.iter().any(|name| !name.is_empty() && memchr::memmem::find(&text, name).is_some())
}

/// A commit of the repository of the current folder.
#[derive(Debug)]
pub struct Commit {
    /// The folder of the repository.
    top: PathBuf,
    /// Its full name.
    id: String,
}

impl Commit {
    /// The commit that a name means.
    pub fn find(reference: &str) -> Result<Self, CliError> {
        let top =
            git(&["rev-parse", "--show-toplevel"]).map_err(|error| error.sentence("--since needs a git repository"))?;
        // A name that begins with a hyphen is no option, and what the name means is asked for once.
        let commit = format!("{reference}^{{commit}}");
        let id = git(&["rev-parse", "--verify", "--quiet", "--end-of-options", &commit])
            .map_err(|error| error.sentence(&format!("--since {reference}: git knows no such commit")))?;
        Ok(Self {
            top: PathBuf::from(path_of(top.trim_ascii_end())),
            id: String::from_utf8_lossy(id.trim_ascii_end()).into_owned(),
        })
    }

    /// The files that differ from those of the commit, those that are gone, and those that git does not know, as absolute
    /// paths.
    fn changed(&self) -> Result<BTreeSet<PathBuf>, CliError> {
        let list = |words: &[&str]| self.git(words).map_err(|error| error.sentence("the changes cannot be listed"));
        let differ = ["diff", "--name-only", "-z", "--no-ext-diff", "--no-renames", &self.id, "--"];
        let unknown = ["ls-files", "--others", "--exclude-standard", "-z"];
        let lists = [list(&differ)?, list(&unknown)?];
        let names = lists.iter().flat_map(|list| list.split(|byte| *byte == 0)).filter(|name| !name.is_empty());
        // By the path where git has it, which may be gone or have become a link, and by that without links.
        let top = fs::canonicalize(&self.top).unwrap_or_else(|_| self.top.clone());
        let paths = names.map(|name| top.join(path_of(name)));
        Ok(paths.flat_map(|path| fs::canonicalize(&path).into_iter().chain([path])).collect())
    }

    /// A file as it is in the commit, of at most so many bytes. None if it is not there. The error says why it cannot be
    /// read.
    pub fn file(&self, path: &Path, bytes_max: u64) -> Result<Option<Vec<u8>>, String> {
        let Some(name) = fs::canonicalize(path).ok().and_then(|path| self.name_of(&path)) else { return Ok(None) };
        let Ok(size) = self.git(&[OsStr::new("cat-file"), OsStr::new("-s"), &name]) else { return Ok(None) };
        let size = std::str::from_utf8(size.trim_ascii_end()).ok().and_then(|size| size.parse::<u64>().ok());
        if size.is_none_or(|size| size > bytes_max) {
            return Err(format!("{} is larger than {bytes_max} bytes there", path.display()));
        }
        let bytes = self.git(&[OsStr::new("cat-file"), OsStr::new("blob"), &name]);
        let bytes = bytes.map_err(|error| error.sentence(&path.display().to_string()).sentence)?;
        match large_file(&bytes) {
            Some(oid) => self.large_file(oid, path, bytes_max).map(Some),
            None => Ok(Some(bytes)),
        }
    }

    /// The name that git has for a file in the commit.
    fn name_of(&self, path: &Path) -> Option<OsString> {
        let top = fs::canonicalize(&self.top).ok()?;
        let mut name = OsString::from(&self.id);
        for (number, part) in path.strip_prefix(top).ok()?.components().enumerate() {
            name.push(if number == 0 { ":" } else { "/" });
            name.push(part);
        }
        Some(name)
    }

    /// The content of a file of Git LFS, from where `git lfs fetch` keeps it. Nothing is fetched here.
    fn large_file(&self, oid: &str, path: &Path, bytes_max: u64) -> Result<Vec<u8>, String> {
        let folder = self.git(&["rev-parse", "--git-common-dir"]);
        let folder = folder.map_err(|error| error.sentence("the folder of git is not found").sentence)?;
        let objects = self.top.join(path_of(folder.trim_ascii_end())).join("lfs/objects");
        let object = objects.join(&oid[..2]).join(&oid[2..4]).join(oid);
        let lacks =
            format!("{} is a pointer of Git LFS there, and its content is not here: git lfs fetch", path.display());
        match fs::metadata(&object) {
            Ok(data) if data.len() > bytes_max => {
                Err(format!("{} is larger than {bytes_max} bytes there", path.display()))
            }
            Ok(_) => fs::read(&object).map_err(|_| lacks),
            Err(_) => Err(lacks),
        }
    }

    /// Runs git in the folder of the repository.
    fn git<W: AsRef<OsStr>>(&self, words: &[W]) -> Result<Vec<u8>, GitError> {
        let folder = [OsStr::new("-C"), self.top.as_os_str()];
        let words: Vec<&OsStr> = folder.into_iter().chain(words.iter().map(AsRef::as_ref)).collect();
        git(&words)
    }
}

/// The SHA-256 by which a pointer of Git LFS names its content; None if the file is no pointer.
fn large_file(bytes: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(bytes.get(..LARGE_FILE_BYTES_MAX.min(bytes.len()))?).ok()?;
    let text = text.strip_prefix("version https://git-lfs.github.com/spec/")?;
    let oid = text.lines().find_map(|line| line.strip_prefix("oid sha256:"))?.trim_end();
    (oid.len() == 64 && oid.bytes().all(|byte| byte.is_ascii_hexdigit())).then_some(oid)
}

/// The reason why git gave no answer.
enum GitError {
    /// There is no such program, or it cannot be started.
    Absent(std::io::Error),
    /// Its message on standard error.
    Refused(String),
}

impl GitError {
    fn sentence(self, what: &str) -> CliError {
        CliError::usage(match self {
            Self::Absent(error) if error.kind() == ErrorKind::NotFound => {
                format!("{what}, and the program `git` is not installed")
            }
            Self::Absent(error) => format!("{what}, and the program `git` cannot be started: {error}"),
            Self::Refused(said) if said.is_empty() => what.to_owned(),
            Self::Refused(said) => format!("{what} (git says: {said})"),
        })
    }
}

/// Runs git in the current folder and returns what it prints. No shell is between, and nothing that a repository
/// configures is started.
fn git<W: AsRef<OsStr>>(words: &[W]) -> Result<Vec<u8>, GitError> {
    let mut command = Command::new("git");
    command.args(["-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null"]).args(words);
    command.env("GIT_OPTIONAL_LOCKS", "0").env("LC_ALL", "C").stdin(Stdio::null());
    let output = command.output().map_err(GitError::Absent)?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(GitError::Refused(said.lines().next().unwrap_or_default().chars().take(200).collect()))
}

#[cfg(unix)]
fn path_of(bytes: &[u8]) -> &OsStr {
    use std::os::unix::ffi::OsStrExt as _;
    OsStr::from_bytes(bytes)
}

#[cfg(not(unix))]
fn path_of(bytes: &[u8]) -> &OsStr {
    OsStr::new(std::str::from_utf8(bytes).unwrap_or_default())
}
