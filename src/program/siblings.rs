//! The search for the files that a mesh refers to and that lie beside it, such as its textures. They
//! are read where the command allows it: by `--siblings`, for meshes found in a folder that it names,
//! or, if it reads many meshes, by naming the files. Otherwise `render` and `check` advise the user
//! to name them.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::bundle::{self, NamedFiles, comparable, plain};
use crate::error::CliError;
use meshsnap_render::import::bundle::show_all;
use meshsnap_render::import::{self, FileUse, Options};
use meshsnap_render::limits::{Budget, Deadline, Limits};

/// Files that name others, one after the other: a mesh its material library, and that its textures.
const ROUNDS_MAX: usize = 3;

/// One of many meshes, read with the files that belong to it.
pub struct Read<T> {
    /// The result of the reading that had all files.
    pub value: T,
    /// The files that were read, the mesh first.
    pub names: Vec<String>,
    /// Files that the mesh refers to, that lie beside it and may not be read.
    pub unread: Vec<String>,
}

/// The files that one of many meshes may have read beside itself.
#[derive(Clone, Copy)]
pub struct Companions<'a> {
    /// The named files that are no meshes, by their absolute paths.
    pub named: &'a BTreeSet<PathBuf>,
    /// True if all that lie beside a mesh may be read.
    pub all: bool,
}

/// Reads one of many meshes by `read`, and again with the files that it turns out to refer to, until
/// none is missing that may be read.
pub fn read_on<T>(
    mesh: &str,
    companions: Companions<'_>,
    limits: &Limits,
    mut read: impl FnMut(&NamedFiles) -> T,
) -> Result<Read<T>, CliError> {
    let Companions { named, all } = companions;
    let mut names = vec![mesh.to_owned()];
    // The first reading has the mesh alone.
    for _ in 0..=ROUNDS_MAX {
        let files = bundle::read(&names, None, limits)?;
        let value = read(&files);
        let beside = beside(&names, &files.common, &files.file_use, &|path| named.contains(path));
        let may_read = |name: &String| all || named.contains(&comparable(name));
        let (readable, unread): (Vec<String>, Vec<String>) = beside.into_iter().partition(may_read);
        if readable.is_empty() {
            return Ok(Read { value, names, unread });
        }
        names.extend(readable);
    }
    Err(CliError::input(format!("{}: files refer to files without end", mesh)))
}

/// The missing files that lie beside the mesh, as a command would name them. Those that lie outside
/// of the folder of the files that are named count only if they are `known`: a stranger's mesh must
/// not point at them.
pub fn beside(names: &[String], common: &Path, file_use: &FileUse, known: &dyn Fn(&Path) -> bool) -> Vec<String> {
    let written_folder = names.first().map(|name| Path::new(name).parent().unwrap_or(Path::new("")).to_owned());
    let mut found = Vec::new();
    for missing in file_use.missing() {
        let name = missing.name.replace('\\', "/");
        let base_name = name.rsplit('/').next().unwrap_or_default();
        let places = [
            common.join(&missing.folder).join(&name),
            common.join(&missing.folder).join(base_name),
            common.join(base_name),
        ];
        let is_inside = |path: &PathBuf| (path.starts_with(common) || known(path)) && path.is_file();
        let Some(path) = places.iter().map(|path| plain(path)).find(is_inside) else { continue };
        let as_named = shortest(&path, common, written_folder.as_deref(), names.len());
        if !found.contains(&as_named) {
            found.push(as_named);
        }
    }
    found
}

/// All files that belong to a mesh and lie beside it: those that it names, and those that they name.
pub fn all_beside(
    names: &[String],
    entry: Option<&str>,
    options: Options,
    limits: &Limits,
) -> Result<Vec<String>, CliError> {
    let mut all = names.to_vec();
    for _ in 0..ROUNDS_MAX {
        let named = bundle::read(&all, entry.map(str::to_owned), limits)?;
        // A mesh that lacks a file may be an error. The names are noted first.
        let mut budget = Budget::new(limits);
        let _ = import::survey(&named.bundle, options, limits, &mut budget, &Deadline::default());
        let more = beside(&all, &named.common, &named.file_use, &|_| false);
        if more.is_empty() {
            break;
        }
        all.extend(more);
    }
    Ok(all.split_off(names.len()))
}

/// `"cube.mtl" and "wood.png" lie beside it: meshsnap render cube.obj cube.mtl wood.png -o out.png`
pub fn advice(mesh: &str, beside: &[String], last_mesh: &str, command: &[OsString]) -> String {
    let names = show_all(beside.iter().map(String::as_str));
    let lie = if beside.len() == 1 { "which lies" } else { "which lie" };
    format!("{mesh} refers to {names}, {lie} beside it: {}", with_files(command, last_mesh, beside))
}

/// The same for one of many meshes.
pub fn advice_to_add(mesh: &str, beside: &[String]) -> String {
    let names = show_all(beside.iter().map(String::as_str));
    let (lie, them) = if beside.len() == 1 { ("which lies", "it") } else { ("which lie", "them") };
    format!("{mesh} refers to {names}, {lie} beside it: name {them} too, or add --siblings")
}

/// The command with more files after the last mesh, as a shell takes it.
fn with_files(command: &[OsString], last_mesh: &str, files: &[String]) -> String {
    let mut words: Vec<String> = command.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(program) = words.first_mut() {
        *program = "meshsnap".into();
    }
    let at = words.iter().skip(1).position(|word| word == last_mesh).map_or(words.len(), |at| at + 2);
    words.splice(at..at, files.iter().cloned());
    words.iter().map(|word| shell_word(word)).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it: in quotes, where it has to be.
fn shell_word(word: &str) -> String {
    shlex::try_quote(word).map_or_else(|_| word.to_owned(), std::borrow::Cow::into_owned)
}

/// The path as the command would name it: relative as the mesh is named, where the mesh is.
fn shortest(path: &Path, common: &Path, written_folder: Option<&Path>, count: usize) -> String {
    let relative = path.strip_prefix(common).unwrap_or(path);
    match written_folder {
        // Of several files, the first may lie deeper than the folder that they share.
        Some(folder) if count == 1 || folder.as_os_str().is_empty() => folder.join(relative),
        _ => path.to_owned(),
    }
    .to_string_lossy()
    .into_owned()
}
