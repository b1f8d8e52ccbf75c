//! The target `meshopt`: the fuzzer's bytes reach meshoptimizer's decoders without JSON around them.
//!
//! An input is five bytes of head, and packed data: mode (0 to 2 in the lowest bits, then 1 for indices of 16 bits), words
//! of an element, filter, and the count of elements in two bytes. All of it becomes the one buffer view of a glTF file, so
//! that the importer checks it as it checks any other.

use serde_json::{Value, json};

const HEAD_BYTES: usize = 5;
const MODES: [&str; 3] = ["ATTRIBUTES", "TRIANGLES", "INDICES"];
const FILTERS: [&str; 5] = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"];
const BYTE: u32 = 5120;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const TRIANGLES: u32 = 4;
const POINTS: u32 = 0;
const CORNERS: u32 = 8;
const CORNERS_BYTES: usize = 96;

/// The GLB file of an input.
pub fn glb(input: &[u8]) -> Vec<u8> {
    let mut head = [0; HEAD_BYTES];
    let (given, packed) = input.split_at(input.len().min(HEAD_BYTES));
    head[..given.len()].copy_from_slice(given);
    let [mode, words, filter, low, high] = head;
    let (mode, is_short) = (MODES[usize::from(mode & 3) % MODES.len()], mode & 4 != 0);
    let count = u32::from(u16::from_le_bytes([low, high]));
    let (stride, count) = match mode {
        "ATTRIBUTES" => (4 * (1 + u32::from(words) % 64), count),
        "TRIANGLES" => (if is_short { 2 } else { 4 }, count / 3 * 3),
        _ => (if is_short { 2 } else { 4 }, count),
    };
    let filter = if mode == "ATTRIBUTES" { FILTERS[usize::from(filter) % FILTERS.len()] } else { "NONE" };
    let view = json!({
        "buffer": 1, "byteLength": count * stride,
        "extensions": { "KHR_meshopt_compression": {
            "buffer": 0, "byteOffset": CORNERS_BYTES, "byteLength": packed.len(),
            "byteStride": stride, "count": count, "mode": mode, "filter": filter,
        } },
    });
    let corners = json!({ "buffer": 0, "byteLength": CORNERS_BYTES });
    let binary = [corner_bytes().as_slice(), packed].concat();
    let mut document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_meshopt_compression", "KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_meshopt_compression", "KHR_mesh_quantization"],
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "bufferViews": [view, corners],
        "buffers": [
            { "byteLength": binary.len() },
            { "byteLength": count * stride, "extensions": { "KHR_meshopt_compression": { "fallback": true } } },
        ],
    });
    let (primitive, accessors) = match mode {
        "ATTRIBUTES" => attributes(stride, count),
        mode => indices(mode, is_short, count),
    };
    if mode == "ATTRIBUTES" {
        document["bufferViews"][0]["byteStride"] = json!(stride);
    }
    document["meshes"] = json!([{ "primitives": [primitive] }]);
    document["accessors"] = accessors;
    pack(&document, &binary)
}

/// A primitive whose positions are the first components of the elements, and its accessor.
fn attributes(stride: u32, count: u32) -> (Value, Value) {
    let component = match stride {
        4 => BYTE,
        8 => SHORT,
        _ => FLOAT,
    };
    let accessor = json!({ "bufferView": 0, "type": "VEC3", "componentType": component, "count": count });
    (json!({ "attributes": { "POSITION": 0 } }), json!([accessor]))
}

/// A primitive whose indices are the elements, over the corners of a cube, and its accessors.
fn indices(mode: &str, is_short: bool, count: u32) -> (Value, Value) {
    let component = if is_short { UNSIGNED_SHORT } else { UNSIGNED_INT };
    let draws = if mode == "TRIANGLES" { TRIANGLES } else { POINTS };
    let primitive = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": draws });
    let positions = json!({ "bufferView": 1, "type": "VEC3", "componentType": FLOAT, "count": CORNERS });
    let indices = json!({ "bufferView": 0, "type": "SCALAR", "componentType": component, "count": count });
    (primitive, json!([positions, indices]))
}

fn corner_bytes() -> Vec<u8> {
    let corner = |n: u32| [n & 1, n >> 1 & 1, n >> 2].map(|c| (c as f32).to_le_bytes()).concat();
    (0..CORNERS).flat_map(corner).collect()
}

fn pack(document: &Value, binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let chunks = [(b"JSON", padded(document.to_string().as_bytes(), b' ')), (b"BIN\0", padded(binary, 0))];
    let length = 12 + chunks.iter().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
    let mut file = [b"glTF".as_slice(), &2_u32.to_le_bytes(), &(length as u32).to_le_bytes()].concat();
    for (kind, bytes) in chunks {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(bytes);
    }
    file
}
