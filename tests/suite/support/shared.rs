//! Where the public test meshes are, on machines that have them.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::path::PathBuf;

/// The folder `name` of the shared data, or nothing (said on standard error) where there is none.
pub fn folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MESHSNAP_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("{} is not there, so this test has nothing to do", folder.display());
    None
}

/// All files below a folder, sorted.
pub fn files(folder: &std::path::Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}
