//! Reads the files named on the command line as one bundle. Files that a mesh refers to must be
//! named too.

use std::path::{Component, Path, PathBuf};

use super::files;
use crate::cli::error::CliError;
use crate::import::{Bundle, BundleFile};
use crate::limits::{self, Limits};

/// The name of a bundle in messages: its first file.
pub fn name(names: &[String]) -> &str {
    names.first().map_or("", String::as_str)
}

/// Reads the files. Their paths in the bundle are relative to the folder that they have in common,
/// so that references between them work as on disk.
pub fn read(names: &[String], entry: Option<String>, limits: &Limits) -> Result<Bundle, CliError> {
    if names.iter().filter(|name| *name == "-").count() > 1 {
        return Err(CliError::usage("`-`, standard input, can be given once"));
    }
    if let [single] = names {
        let bytes = files::read(single, limits.memory_bytes)?;
        if single == "-" {
            return Ok(Bundle::of_one(bytes).with_entry(entry));
        }
        let file = BundleFile::new(&relative_to(&folder_of(single)?, single)?, bytes.clone());
        // A single file may have any name, also one that no file of a bundle may have.
        let bundle = file.map_or_else(|_| Bundle::of_one(bytes), |file| Bundle::of_files(vec![file]));
        return Ok(bundle.with_entry(entry));
    }
    let count = names.len() as u64;
    limits::check("the number of files", count, limits.bundle_entries, "--limit-bundle-entries")
        .map_err(|limit| CliError::input(limit.to_string()))?;
    let mut common = folder_of(name(names))?;
    for name in names {
        let folder = folder_of(name)?;
        common = common.components().zip(folder.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect();
    }
    let (mut all, mut left): (Vec<BundleFile>, _) = (Vec::new(), limits.memory_bytes);
    for name in names {
        let bytes = files::read(name, left)?;
        left -= bytes.len() as u64;
        let file = BundleFile::new(&relative_to(&common, name)?, bytes);
        let file = file.map_err(|error| CliError::input(format!("{name}: {error}")))?;
        file.check_new(&all).map_err(|error| CliError::usage(format!("{name}: {error}")))?;
        all.push(file);
    }
    Ok(Bundle::of_files(all).with_entry(entry))
}

fn folder_of(name: &str) -> Result<PathBuf, CliError> {
    Ok(absolute(name)?.parent().map(Path::to_path_buf).unwrap_or_default())
}

/// The absolute path without `.` and `..`; links are not followed. Standard input is in the current
/// folder.
fn absolute(name: &str) -> Result<PathBuf, CliError> {
    let path = std::path::absolute(name).map_err(|error| CliError::input(format!("{name}: {error}")))?;
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    Ok(plain)
}

fn relative_to(folder: &Path, name: &str) -> Result<String, CliError> {
    let path = absolute(name)?;
    Ok(path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned())
}
