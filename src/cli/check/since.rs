//! `--since REF`: the meshes that changed, by the `git` program.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::cli::error::CliError;
use crate::cli::render::{Task, Tasks, is_companion};

/// Leaves out the meshes that have not changed since a commit, here or in git. A mesh counts as changed, too, where a
/// file that it may refer to has, such as a texture in its folder or below.
pub fn keep_changed(tasks: &mut Tasks, reference: &str) -> Result<(), CliError> {
    let changed = changed(reference)?;
    let companions: Vec<&PathBuf> = changed.iter().filter(|path| is_companion(path)).collect();
    let has_changed = |task: &Task| {
        let Ok(path) = fs::canonicalize(&task.mesh) else { return true };
        let folder = path.parent().unwrap_or(Path::new("/"));
        changed.contains(&path) || companions.iter().any(|companion| companion.starts_with(folder))
    };
    let before = tasks.all.len();
    tasks.all.retain(has_changed);
    tasks.is_part |= tasks.all.len() < before;
    Ok(())
}

/// The files that differ from those of a commit, and those that git does not know, as absolute paths.
fn changed(reference: &str) -> Result<BTreeSet<PathBuf>, CliError> {
    let top =
        git(&["rev-parse", "--show-toplevel"]).map_err(|error| error.sentence("--since needs a git repository"))?;
    let top = PathBuf::from(path_of(top.trim_ascii_end()));
    // A name that begins with a hyphen is no option, and what the name means is asked for once.
    let commit = format!("{reference}^{{commit}}");
    let commit = git(&["rev-parse", "--verify", "--quiet", "--end-of-options", &commit])
        .map_err(|error| error.sentence(&format!("--since {reference}: git knows no such commit")))?;
    let commit = String::from_utf8_lossy(commit.trim_ascii_end()).into_owned();
    let in_top = ["-C", &top.to_string_lossy()].map(str::to_owned);
    let list = |words: &[&str]| {
        let words: Vec<&str> = in_top.iter().map(String::as_str).chain(words.iter().copied()).collect();
        git(&words).map_err(|error| error.sentence("the changes cannot be listed"))
    };
    let differ = ["diff", "--name-only", "-z", "--no-ext-diff", "--no-renames", "--diff-filter=d", &commit, "--"];
    let unknown = ["ls-files", "--others", "--exclude-standard", "-z"];
    let lists = [list(&differ)?, list(&unknown)?];
    let names = lists.iter().flat_map(|list| list.split(|byte| *byte == 0)).filter(|name| !name.is_empty());
    Ok(names.filter_map(|name| fs::canonicalize(top.join(path_of(name))).ok()).collect())
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
fn git(words: &[&str]) -> Result<Vec<u8>, GitError> {
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
