//! glTF: compressed data that lies or is damaged.

use crate::formats::gltf::packed::Sheet;
use crate::support::files::mesh::{Noise, read, set};
use crate::support::work::within_bytes;
use meshsnap_render::import::MeshFault;
use serde_json::{Value, json};

#[test]
fn compressed_views_that_lie_are_refused() {
    let good = Sheet::new().meshopt("EXT_meshopt_compression");
    let view = good.json["accessors"][0]["bufferView"].as_u64().unwrap();
    let normal = good.json["accessors"][1]["bufferView"].as_u64().unwrap();
    let index = good.json["accessors"][2]["bufferView"].as_u64().unwrap();
    let mut cases = 0;
    let mut refuse = |view: u64, key: &str, value: Value, word: &str| {
        let mut gltf = good.clone();
        let place = format!("/bufferViews/{view}/extensions/EXT_meshopt_compression/{key}");
        set(&mut gltf.json, &place, value);
        let error = read(&gltf.glb()).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{place}: {error}");
        assert!(error.detail.contains(word), "{place}: {error}");
        cases += 1;
    };
    refuse(view, "count", json!(442), "the view has");
    refuse(view, "count", json!(4_000_000_000_000_u64), "the view has");
    refuse(view, "count", json!(9_007_199_254_740_991_u64), "the view has");
    refuse(view, "byteStride", json!(7), "the view has");
    refuse(view, "mode", json!("TRIANGLES"), "stride");
    refuse(view, "mode", json!("SOMETHING"), "stride");
    refuse(index, "mode", json!("SOMETHING"), "unknown mode");
    refuse(index, "mode", json!("INDICES"), "decompressed");
    refuse(view, "filter", json!("OCTAGONAL"), "filter");
    refuse(normal, "filter", json!("QUATERNION"), "filter");
    refuse(normal, "filter", json!("COLOR"), "filter");
    refuse(index, "filter", json!("EXPONENTIAL"), "filter");
    refuse(view, "buffer", json!(7), "buffer 7");
    refuse(view, "buffer", json!(1), "neither a URI");
    refuse(view, "byteLength", json!(20), "decompressed");
    refuse(view, "byteOffset", json!(1_000_000_000), "spans");
    assert_eq!(cases, 16);

    // A view that says so much, and a buffer that would have it: paid for before it is unpacked.
    let mut bomb = good.clone();
    let huge = 500_000_000_u64;
    bomb.json["buffers"][1]["byteLength"] = (huge * 8).into();
    bomb.json["bufferViews"][view as usize]["byteLength"] = (huge * 8).into();
    bomb.json["bufferViews"][view as usize]["extensions"]["EXT_meshopt_compression"]["count"] = huge.into();
    assert!(matches!(read(&bomb.glb()).unwrap_err().fault, MeshFault::Limit(_)));
}

#[test]
fn compressed_indices_are_checked_like_others() {
    let mut sheet = Sheet::new();
    sheet.indices[7] = 441;
    let error = read(&sheet.meshopt("KHR_meshopt_compression").glb()).unwrap_err();
    assert!(error.detail.contains("vertex index 441, and 441 vertices"), "{error}");
}

#[test]
fn draco_data_must_be_what_accessors_say() {
    let good = Sheet::new().draco();
    let mut cases = 0;
    let mut refuse = |place: &str, value: Value, word: &str| {
        let mut gltf = good.clone();
        set(&mut gltf.json, place, value);
        let error = read(&gltf.glb()).unwrap_err();
        assert!(error.detail.contains(word), "{place}: {error}");
        cases += 1;
    };
    refuse("/accessors/2/count", json!(2397), "cannot be decompressed");
    refuse("/accessors/2/count", json!(2403), "has 800 triangles");
    refuse("/accessors/0/count", json!(442), "441 vertices");
    refuse("/accessors/2/count", json!(3_000_000_000_u64), "limit");
    refuse("/accessors/0/count", json!(3_000_000_000_u64), "limit");
    let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    refuse(&format!("{draco}/bufferView"), json!(77), "buffer view 77");
    refuse(&format!("{draco}/bufferView"), json!(0), "cannot be decompressed");
    refuse(&format!("{draco}/attributes/NORMAL"), json!(7), "no attribute 7");
    refuse("/accessors/1/type", json!("VEC2"), "Vec2");
    refuse("/meshes/0/primitives/0/mode", json!(6), "neither a list nor a strip");
    assert_eq!(cases, 10);
}

/// Bytes that damaged data may allocate.
const COST_MAX: u64 = 256 << 20;

/// No changed byte of the compressed data may bring the decoder down, or make it take much memory.
#[test]
fn damaged_compressed_data_is_refused_or_read() {
    let (mut noise, mut cases) = (Noise(7), 0);
    let sheet = Sheet::new();
    for gltf in [sheet.draco(), sheet.meshopt("EXT_meshopt_compression")] {
        let whole = gltf.glb();
        let from = whole.len() - gltf.bin.len();
        for _ in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..1 + noise.next() % 3 {
                let at = from + (noise.next() as usize) % gltf.bin.len();
                bytes[at] ^= 1 << (noise.next() % 8);
            }
            _ = within_bytes(COST_MAX, "damaged data", || read(&bytes));
            cases += 1;
        }
        // Cut off: the header says less.
        let view = gltf.json["bufferViews"].as_array().unwrap().len() - 1;
        for cut in 1..60 {
            let mut gltf = gltf.clone();
            let length = gltf.json["bufferViews"][view]["byteLength"].as_u64().unwrap();
            gltf.json["bufferViews"][view]["byteLength"] = (length * cut / 60).into();
            let glb = gltf.glb();
            _ = within_bytes(COST_MAX, "data cut off", || read(&glb));
            cases += 1;
        }
    }
    assert_eq!(cases, 2 * (400 + 59));
}
