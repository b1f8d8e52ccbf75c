//! The JSON document: measured before it is parsed, parsed into the `gltf` crate's types, never given to its validator,
//! which panics on some documents and refuses many valid ones.

use crate::limits;
use crate::mesh::import::Context;
use crate::mesh::{MeshError, MeshFault};
use gltf::json::Root;
use serde_json::Value;

/// Memory that an object of the document may take once parsed: the largest of the crate's types, in a list that doubles.
const BYTES_PER_OBJECT: u64 = 1024;
/// The same for a number in a list: a `serde_json::Value`.
const BYTES_PER_VALUE: u64 = 64;

/// Parses the document and checks what the file demands of its reader.
pub fn parse(json: &[u8], cx: &mut Context<'_>) -> Result<Root, MeshError> {
    let json = crate::mesh::sniff::trim_start(json);
    let size = measure(json);
    limits::check("the nesting depth of the JSON", size.depth, cx.limits.json_depth, "--limit-json-depth")?;
    cx.budget.spend("the glTF JSON", json.len() as u64, 1)?;
    cx.budget.spend("the glTF JSON", size.objects, BYTES_PER_OBJECT)?;
    cx.budget.spend("the glTF JSON", size.commas, BYTES_PER_VALUE)?;
    cx.deadline.check()?;
    let root = match serde_json::from_slice(json) {
        Ok(root) => root,
        // The crate is stricter than the specification about parts that we do not even read.
        Err(error) => pruned(json)
            .and_then(|value| serde_json::from_value(value).ok())
            .ok_or_else(|| MeshError::broken(format!("the glTF JSON cannot be read: {error}")))?,
    };
    check_demands(&root)?;
    Ok(root)
}

#[derive(Debug, Default, PartialEq, Eq)]
struct Size {
    depth: u64,
    objects: u64,
    commas: u64,
}

/// What parsing will cost, from the bytes alone. A document that is not JSON gives numbers that mean nothing, and fails later.
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

/// The document without what is not read from it or read by [`super::model`], and with what the crate wants though the specification does not.
fn pruned(json: &[u8]) -> Option<Value> {
    let mut value: Value = serde_json::from_slice(json).ok()?;
    let root = value.as_object_mut()?;
    for key in ["animations", "cameras", "extensions", "extras", "images", "materials", "samplers", "skins", "textures"]
    {
        root.remove(key);
    }
    root.values_mut().for_each(make_integral);
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        scene.as_object_mut()?.entry("nodes").or_insert(Value::Array(Vec::new()));
    }
    Some(value)
}

/// `1.0` is a good integer in JSON. The document's depth is limited, and so is this recursion.
fn make_integral(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(make_integral),
        Value::Object(map) => map.values_mut().for_each(make_integral),
        Value::Number(number) => {
            let whole = number.as_f64().filter(|v| number.is_f64() && v.fract() == 0.0 && v.abs() < 9e15);
            if let Some(whole) = whole {
                *value = if whole < 0.0 { Value::from(whole as i64) } else { Value::from(whole as u64) };
            }
        }
        _ => {}
    }
}

/// The compression that the file says it uses, if any: data may be missing because it is in there.
pub fn compression(root: &Root) -> Option<MeshError> {
    let name = root.extensions_used.iter().find(|e| e.ends_with("_compression"))?;
    let detail =
        format!("the glTF file keeps its geometry in {name:.40}, which is not read: export it without compression");
    Some(MeshError::new(MeshFault::Unsupported, detail))
}

fn check_demands(root: &Root) -> Result<(), MeshError> {
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

/// Whether a required extension can be read or leaves the geometry alone.
fn is_fine(extension: &str) -> bool {
    let topic = extension.split_once('_').map_or("", |(_vendor, topic)| topic);
    let about = |topics: &[&str]| topics.iter().any(|t| topic.starts_with(t));
    extension == "KHR_mesh_quantization"
        || about(&["materials_", "texture_", "lights_", "animation_", "xmp", "mesh_features", "structural_metadata"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_depth_outside_strings_only() {
        let size = measure(br#"{"a":[[1,2],{"b":"[[[{{,,\"[["}]}"#);
        assert_eq!(size, Size { depth: 3, objects: 2, commas: 2 });
    }

    #[test]
    fn the_price_of_an_object_covers_every_type() {
        use gltf::json;
        let sizes = [
            size_of::<json::Node>(),
            size_of::<json::Material>(),
            size_of::<json::Accessor>(),
            size_of::<json::mesh::Primitive>(),
            size_of::<json::Mesh>(),
            size_of::<json::Animation>(),
            size_of::<json::Image>(),
            size_of::<json::Camera>(),
            size_of::<json::Skin>(),
        ];
        for size in sizes {
            assert!(size as u64 * 2 <= BYTES_PER_OBJECT, "{size}");
        }
    }

    #[test]
    fn knows_which_extensions_it_may_ignore() {
        for fine in ["KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp"] {
            assert!(is_fine(fine), "{fine}");
        }
        for unread in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing", "FOO", ""] {
            assert!(!is_fine(unread), "{unread}");
        }
    }
}
