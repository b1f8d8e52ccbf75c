//! The JSON document of a glTF file. Before it is parsed, its depth is measured and the memory that
//! parsing will take is estimated, and both are checked against the limits. A file that requires an
//! extension is refused, unless the extension is read, is harmless, or is reported in a warning.

pub(crate) mod check;
pub(crate) mod lists;
pub(crate) mod metadata;
pub(crate) mod schema;
use self::schema::Document;
use crate::import::context::Context;
use crate::import::{MeshError, MeshFault, text};
use crate::limits;

/// Memory per parsed object: the largest type, in a list that doubles as it grows.
const BYTES_PER_OBJECT: u64 = 1024;
/// Memory per entry of a list or a map.
const BYTES_PER_VALUE: u64 = 64;

/// Parses the document and refuses required extensions that are not read.
pub fn parse(json: &[u8], cx: &mut Context<'_>) -> Result<Document, MeshError> {
    let all_bytes = json.len();
    let json = text::trim_start(json);
    let size = measure(json);
    limits::check("the nesting depth of the JSON", size.depth, cx.limits.json_depth, "--limit-json-depth")?;
    cx.budget.spend("the glTF JSON", json.len() as u64, 1)?;
    cx.budget.spend("the glTF JSON", size.objects, BYTES_PER_OBJECT)?;
    cx.budget.spend("the glTF JSON", size.commas, BYTES_PER_VALUE)?;
    cx.deadline.check()?;
    // Checked here once, because only some of the readers look at the characters of fields that
    // they skip.
    if let Err(error) = std::str::from_utf8(json) {
        let at = all_bytes - json.len() + error.valid_up_to();
        return Err(MeshError::broken(format!("byte {at} of the glTF JSON is not UTF-8")));
    }
    // Only documents with very many objects are counted exactly. Unused nodes take memory too.
    if size.objects > cx.limits.nodes {
        limits::check("the number of nodes in the glTF file", nodes(json), cx.limits.nodes, "--limit-nodes")?;
    }
    let doc = serde_json::from_slice(json).map_err(unread)?;
    check_demands(&doc)?;
    Ok(doc)
}

/// The error for a document that is not JSON, or whose types are not those of glTF.
pub fn unread(error: serde_json::Error) -> MeshError {
    MeshError::broken(format!("the glTF JSON cannot be read: {}", text::foreign(error)))
}

#[derive(Debug, Default, PartialEq, Eq)]
struct Size {
    depth: u64,
    objects: u64,
    commas: u64,
}

/// The memory that parsing takes, estimated from the bytes alone. For a document that is not JSON
/// the number is meaningless, and parsing fails later.
fn measure(json: &[u8]) -> Size {
    let mut size = Size::default();
    let mut depth = 0_u64;
    let mut bytes = json.iter();
    while let Some(byte) = bytes.next() {
        match byte {
            b'"' => {
                while let Some(byte) = bytes.next() {
                    match byte {
                        b'"' => break,
                        b'\\' => _ = bytes.next(),
                        _ => {}
                    }
                }
            }
            b'{' | b'[' => {
                depth += 1;
                size.depth = size.depth.max(depth);
                size.objects += u64::from(*byte == b'{');
            }
            b'}' | b']' => depth = depth.saturating_sub(1),
            b',' => size.commas += 1,
            _ => {}
        }
    }
    size
}

/// The length of a list; 0 where the value is no list, which fails later.
fn nodes(json: &[u8]) -> u64 {
    #[derive(Default, serde::Deserialize)]
    #[serde(default)]
    struct Nodes {
        // Costs no memory.
        nodes: Vec<serde::de::IgnoredAny>,
    }
    serde_json::from_slice::<Nodes>(json).map_or(0, |counted| counted.nodes.len() as u64)
}

fn check_demands(root: &Document) -> Result<(), MeshError> {
    let unsupported = |detail: String| Err(MeshError::new(MeshFault::Unsupported, detail));
    let version = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
    if root.asset.min_version.as_ref().is_some_and(|v| v != "2.0") || !root.asset.version.starts_with("2.") {
        return unsupported(format!("the glTF file is of version {version:.20}, and version 2.0 is read"));
    }
    let unknown: Vec<&str> = root.extensions_required.iter().map(String::as_str).filter(|e| !is_fine(e)).collect();
    if !unknown.is_empty() {
        let names: String = unknown.join(", ").chars().take(200).collect();
        return unsupported(format!("the glTF file requires extensions that are not read: {names}"));
    }
    Ok(())
}

/// True if a required extension is read, or if ignoring it changes at most what a warning reports.
fn is_fine(extension: &str) -> bool {
    READ.contains(&extension) || UNSEEN.contains(&extension) || crate::import::gltf::material::is_known(extension)
}

/// Extensions that are read; those of materials are in [`crate::import::gltf::material`].
const READ: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "FB_ngon_encoding",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Extensions that are not read and do not change the shapes or surfaces of the file's first state: lights (the
/// request sets those), metadata, and ways to animate or exchange materials.
const UNSEEN: &[&str] = &[
    "EXT_instance_features",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_variants",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_depth_outside_strings_only() {
        let size = measure(br#"{"a":[[1,2],{"b":"[[[{{,,\"[["}]}"#);
        assert_eq!(size, Size { depth: 3, objects: 2, commas: 2 });
    }

    #[test]
    fn counts_nodes_without_reading_them() {
        assert_eq!(nodes(br#"{"nodes":[{"a":[{}]},{},{}],"scenes":[{"nodes":[0]}]}"#), 3);
        assert_eq!(nodes(b"{}"), 0);
        assert_eq!(nodes(b"{\"nodes\":[{}"), 0);
    }

    #[test]
    fn the_price_of_an_object_covers_every_type() {
        use crate::import::gltf::document::schema;
        let sizes = [
            size_of::<schema::Node>(),
            size_of::<schema::Accessor>(),
            size_of::<schema::Primitive>(),
            size_of::<schema::MeshJson>(),
            size_of::<schema::BufferView>(),
            size_of::<schema::Skin>(),
        ];
        for size in sizes {
            assert!(size as u64 * 2 <= BYTES_PER_OBJECT, "{size}");
        }
    }

    #[test]
    fn knows_which_extensions_it_may_ignore() {
        for fine in ["KHR_mesh_quantization", "KHR_materials_unlit", "KHR_materials_clearcoat", "EXT_texture_webp"] {
            assert!(is_fine(fine), "{fine}");
        }
        for unread in ["EXT_texture_avif", "MSFT_texture_dds", "KHR_materials_new", "KHR_implicit_shapes", "FOO", ""] {
            assert!(!is_fine(unread), "{unread}");
        }
    }
}
