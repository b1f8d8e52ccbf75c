//! The metadata of a glTF file, for reports: the program that wrote it, its extensions, and its
//! numbers of scenes, nodes, meshes and the like. They are read from the JSON alone, and do not
//! depend on what is drawn.

use crate::import::metadata::tidy;
use crate::import::{FileMetadata, text};
use serde::Deserialize;
use serde::de::IgnoredAny;

/// Most names of extensions that are kept.
const EXTENSIONS_MAX: usize = 100;

/// The few fields that are counted. Entries themselves are ignored.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Document {
    asset: Asset,
    scenes: Vec<IgnoredAny>,
    nodes: Vec<IgnoredAny>,
    meshes: Vec<CountedMesh>,
    animations: Vec<IgnoredAny>,
    skins: Vec<IgnoredAny>,
    cameras: Vec<IgnoredAny>,
    extensions_used: Vec<String>,
    extensions_required: Vec<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Asset {
    generator: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct CountedMesh {
    primitives: Vec<IgnoredAny>,
}

/// Metadata of a document whose parsing was paid for before. A list of an unexpected type leaves
/// the metadata empty and is no error.
pub fn metadata(json: &[u8]) -> FileMetadata {
    let json = text::trim_start(json);
    let Ok(document) = serde_json::from_slice::<Document>(json) else { return FileMetadata::default() };
    let primitives = || document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let names = |names: &[String]| names.iter().take(EXTENSIONS_MAX).filter_map(|name| tidy(name.as_bytes())).collect();
    FileMetadata {
        generator: document.asset.generator.as_deref().and_then(|generator| tidy(generator.as_bytes())),
        scenes: Some(document.scenes.len() as u64),
        nodes: Some(document.nodes.len() as u64),
        meshes: Some(document.meshes.len() as u64),
        primitives: Some(primitives().count() as u64),
        animations: Some(document.animations.len() as u64),
        skins: Some(document.skins.len() as u64),
        cameras: Some(document.cameras.len() as u64),
        extensions_used: names(&document.extensions_used),
        extensions_required: names(&document.extensions_required),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_counted_once() {
        let json = br#" {"asset":{"version":"2.0","generator":"by\nhand"},"scenes":[{},{}],"nodes":[{"mesh":0},{"mesh":0},{}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0}},{"mode":0,"attributes":{"POSITION":0.0}}]},
                      {"primitives":[{"mode":1,"indices":1},{"mode":2,"indices":1},{"mode":3,"indices":1},{"mode":0,"indices":9}]}],
            "accessors":[{"count":7},{"count":10.0,"min":[1]}],"animations":[{}],"skins":[{"joints":[0]}],"cameras":[{},{},{},{}],
            "extensionsUsed":["A","B"],"extensionsRequired":["A"]}"#;
        let found = metadata(json);
        assert_eq!(found.generator.as_deref(), Some("by\u{FFFD}hand"));
        let counts =
            [found.scenes, found.nodes, found.meshes, found.primitives, found.animations, found.skins, found.cameras];
        assert_eq!(counts.map(Option::unwrap), [2, 3, 2, 6, 1, 1, 4]);
        assert_eq!((found.extensions_used.len(), found.extensions_required), (2, vec!["A".to_owned()]));
    }

    #[test]
    fn odd_documents_have_no_metadata() {
        assert_eq!(metadata(b"[1]"), FileMetadata::default());
        assert_eq!(metadata(br#"{"nodes":3}"#), FileMetadata::default());
    }
}
