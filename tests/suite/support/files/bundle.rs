//! Bundles of several files, honest archives, and the models of `tests/data` that consist of
//! several files.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use crate::support::files::mesh::Read;
use std::io::{Cursor, Write as _};

use crate::support::data;
use meshsnap_render::import::{Bundle, BundleFile, MeshError, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};

/// Files under names that must be good.
pub fn files(files: &[(&str, &[u8])]) -> Vec<BundleFile> {
    files.iter().map(|(name, bytes)| BundleFile::new(name, bytes.to_vec()).unwrap()).collect()
}

/// Imports a bundle with default limits.
pub fn read_bundle(bundle: &Bundle) -> Result<Read, MeshError> {
    let limits = Limits::default();
    import(bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default()).map(Read::from)
}

/// An honest archive.
pub fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let options = zip::write::SimpleFileOptions::default();
        if name.ends_with('/') {
            writer.add_directory(*name, options).unwrap();
        } else {
            writer.start_file(*name, options).unwrap();
            writer.write_all(bytes).unwrap();
        }
    }
    writer.finish().unwrap().into_inner()
}

/// A model with its material library and its picture.
pub struct Model {
    pub files: Vec<(String, Vec<u8>)>,
    pub material: &'static str,
}

impl Model {
    /// Those of `tests/data`.
    pub fn all() -> Vec<Self> {
        let folder = data::folder("models/made");
        let model = |names: &[&str], material| {
            let read = |name: &&str| (name.to_string(), std::fs::read(folder.join(name)).unwrap());
            Self { files: names.iter().map(read).collect(), material }
        };
        vec![
            model(&["chequered.obj", "chequered.mtl", "chequered.png"], "chequered-paint"),
            model(&["spaced.obj", "spaced.obj.mtl", "spaced picture.png"], "a-material"),
        ]
    }

    pub fn files(&self) -> Vec<(&str, &[u8])> {
        self.files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect()
    }
}
