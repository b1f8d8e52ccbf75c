//! The list of meshes among the files, folders and patterns that a command line names, with the name of a picture for
//! each, as `render -o DIR/` writes them. `check` and `inspect --jsonl` use the list, too.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::bundle::comparable;
use crate::error::CliError;
use meshsnap_render::import::Format;

/// One picture to draw.
#[derive(Debug, PartialEq, Eq)]
pub struct Task {
    /// The mesh as it is named, or found in a folder.
    pub mesh: String,
    /// Its picture, relative to the folder of pictures.
    pub picture: PathBuf,
    /// True if the files beside it may be read: those of a folder are all named.
    pub has_folder: bool,
}

/// The work of one command.
#[derive(Debug, Default)]
pub struct Tasks {
    /// One for each mesh, in the order of the command; in a folder, in that of their names.
    pub all: Vec<Task>,
    /// Named files that are no meshes, for meshes that refer to them.
    pub companions: Vec<String>,
    /// True if some meshes are left out, because they have not changed.
    pub is_part: bool,
}

impl Tasks {
    /// Leaves out the meshes that are not among these absolute paths, unless one of the paths is no mesh
    /// of its own: then any mesh may refer to it, and all stay.
    pub fn keep_only(&mut self, paths: &BTreeSet<PathBuf>) {
        let meshes: BTreeSet<PathBuf> = self.all.iter().map(|task| comparable(&task.mesh)).collect();
        if paths.is_subset(&meshes) {
            self.is_part = paths.len() < meshes.len();
            self.all.retain(|task| paths.contains(&comparable(&task.mesh)));
        }
    }
}

/// The names with patterns replaced by the files that fit them now.
pub fn expand(names: &[String]) -> Vec<String> {
    let files = |name: &String| match is_pattern(name) && fs::metadata(name).is_err() {
        true => of_pattern(name).unwrap_or_default(),
        false => vec![name.clone()],
    };
    names.iter().flat_map(files).collect()
}

/// Finds the meshes among the named files, folders and patterns. `extension` is that of pictures.
pub fn find(names: &[String], extension: &str) -> Result<Tasks, CliError> {
    let mut tasks = Tasks::default();
    let mut meshes: Vec<(String, bool)> = Vec::new();
    for name in names {
        if name == "-" {
            return Err(CliError::usage("`-`, standard input, is one mesh without a name: give -o FILE, not a folder"));
        }
        let before = meshes.len();
        match fs::metadata(name) {
            Ok(metadata) if metadata.is_dir() => {
                of_folder(Path::new(name), &mut meshes)?;
                if meshes.len() == before {
                    return Err(CliError::input(format!(
                        "{name}: there is no mesh in this folder ({})",
                        Format::list()
                    )));
                }
            }
            Err(_) if is_pattern(name) => {
                for file in of_pattern(name)? {
                    sort_in(file, &mut meshes, &mut tasks.companions);
                }
            }
            _ => sort_in(name.clone(), &mut meshes, &mut tasks.companions),
        }
    }
    if meshes.is_empty() {
        return Err(CliError::input(format!("none of the files is named as a mesh ({})", Format::list())));
    }
    let mut seen = BTreeSet::new();
    meshes.retain(|(mesh, _)| seen.insert(comparable(mesh)));
    let pictures = pictures(&meshes, extension);
    let task = |((mesh, has_folder), picture)| Task { mesh, picture, has_folder };
    tasks.all = meshes.into_iter().zip(pictures).map(task).collect();
    Ok(tasks)
}

/// Adds a named file to the meshes or to their companions, by its extension. One that is neither in
/// name is taken for a mesh, and refused by name if it is none.
fn sort_in(name: String, meshes: &mut Vec<(String, bool)>, companions: &mut Vec<String>) {
    match is_companion(Path::new(&name)) {
        true => companions.push(name),
        false => meshes.push((name, false)),
    }
}

fn extension_of(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn is_mesh(path: &Path) -> bool {
    let extension = extension_of(path);
    extension == "zip" || Format::from_extension(&extension).is_some()
}

/// True for files that meshes refer to, by the extension.
pub fn is_companion(path: &Path) -> bool {
    const EXTENSIONS: [&str; 12] =
        ["mtl", "bin", "png", "jpg", "jpeg", "webp", "bmp", "tga", "dds", "ktx2", "basis", "txt"];
    EXTENSIONS.contains(&extension_of(path).as_str())
}

/// The meshes in a folder and the folders in it, sorted. Hidden ones are left out, links to folders are not
/// followed, and what is no file is passed over: reading a pipe or a device might never end.
fn of_folder(folder: &Path, meshes: &mut Vec<(String, bool)>) -> Result<(), CliError> {
    let failed = |error: std::io::Error| CliError::input(format!("{}: cannot be read: {error}", folder.display()));
    let mut entries: Vec<_> = fs::read_dir(folder).map_err(failed)?.collect::<Result<_, _>>().map_err(failed)?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        if kind.is_dir() {
            of_folder(&path, meshes)?;
        } else if is_mesh(&path) && fs::metadata(&path).map_or(true, |target| target.is_file()) {
            // A link to nothing is told as one.
            meshes.push((path.to_string_lossy().into_owned(), true));
        }
    }
    Ok(())
}

fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?', '['])
}

/// The files that a pattern means, sorted; a shell that expands patterns leaves none to do here.
fn of_pattern(pattern: &str) -> Result<Vec<String>, CliError> {
    let as_shells = glob::MatchOptions { require_literal_leading_dot: true, ..glob::MatchOptions::default() };
    let paths = glob::glob_with(pattern, as_shells)
        .map_err(|error| CliError::usage(format!("{pattern}: is no pattern: {error}")))?;
    let files: Vec<String> =
        paths.flatten().filter(|path| path.is_file()).map(|path| path.to_string_lossy().into_owned()).collect();
    if files.is_empty() {
        return Err(CliError::input(format!("{pattern}: no file fits this pattern")));
    }
    Ok(files)
}

/// A picture for each mesh: its path from the folder that all share, with another extension. Meshes that
/// differ in their extensions alone keep them.
fn pictures(meshes: &[(String, bool)], extension: &str) -> Vec<PathBuf> {
    let paths: Vec<PathBuf> = meshes.iter().map(|(mesh, _)| comparable(mesh)).collect();
    let folders = paths.iter().map(|path| path.parent().unwrap_or(Path::new("")).to_owned());
    let shared = |a: PathBuf, b: PathBuf| {
        a.components().zip(b.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
    };
    let common = folders.reduce(shared).unwrap_or_default();
    let relative: Vec<&Path> = paths.iter().map(|path| path.strip_prefix(&common).unwrap_or(path)).collect();
    let mut stems: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for path in &relative {
        *stems.entry(path.with_extension("")).or_default() += 1;
    }
    let picture = |path: &&Path| match stems.get(&path.with_extension("")) {
        Some(1) => path.with_extension(extension),
        _ => PathBuf::from(format!("{}.{extension}", path.to_string_lossy())),
    };
    relative.iter().map(picture).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mesh_has_a_picture_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for name in
            ["b/x.obj", "b/x.stl", "b/x.mtl", "b/deep/y.glb", "a.ply", "b/.hidden.obj", "b/readme.md", "b/q.zip"]
        {
            fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
            fs::write(root.join(name), "").unwrap();
        }
        let at = |name: &str| root.join(name).to_string_lossy().into_owned();
        let found = |names: &[&str]| -> Vec<(String, String, bool)> {
            let names: Vec<String> = names.iter().map(|name| at(name)).collect();
            let tasks = find(&names, "webp").unwrap().all;
            let of = |task: Task| {
                let mesh = Path::new(&task.mesh).strip_prefix(root).unwrap().to_string_lossy().into_owned();
                (mesh, task.picture.to_string_lossy().into_owned(), task.has_folder)
            };
            tasks.into_iter().map(of).collect()
        };
        let row = |mesh: &str, picture: &str, has_folder| (mesh.to_owned(), picture.to_owned(), has_folder);
        assert_eq!(
            found(&["b"]),
            [
                row("b/deep/y.glb", "deep/y.webp", true),
                row("b/q.zip", "q.webp", true),
                row("b/x.obj", "x.obj.webp", true),
                row("b/x.stl", "x.stl.webp", true)
            ]
        );
        assert_eq!(
            found(&["b/x.obj", "a.ply", "b/x.obj"]),
            [row("b/x.obj", "b/x.webp", false), row("a.ply", "a.webp", false)]
        );
        assert_eq!(found(&["b/*.obj"]), [row("b/x.obj", "x.webp", false)]);
        assert_eq!(expand(&[at("b/*.obj"), at("b"), at("c*")]), [at("b/x.obj"), at("b")]);
        let kept = |changed: &[&str]| {
            let mut tasks = find(&[at("b")], "png").unwrap();
            tasks.keep_only(&changed.iter().map(|name| comparable(at(name))).collect());
            (tasks.all.len(), tasks.is_part)
        };
        assert_eq!(kept(&["b/x.obj", "b/q.zip"]), (2, true));
        assert_eq!(kept(&["b/x.obj", "b/x.mtl"]), (4, false));
        assert_eq!(kept(&["b/gone.obj"]), (4, false));
        let tasks = find(&[at("b/x.obj"), at("b/x.mtl"), at("b/readme.md")], "png").unwrap();
        assert_eq!((tasks.all.len(), tasks.companions), (2, vec![at("b/x.mtl")]));
        for (name, part) in [("c*", "no file fits"), ("b/x.mtl", "none of the files"), ("[", "is no pattern")] {
            let error = find(&[at(name)], "png").unwrap_err();
            assert!(error.sentence.contains(part), "{name}: {error:?}");
        }
        fs::create_dir(root.join("empty")).unwrap();
        assert!(find(&[at("empty")], "png").unwrap_err().sentence.contains("no mesh in this folder"));
        assert!(find(&["-".to_owned()], "png").is_err());
    }
}
