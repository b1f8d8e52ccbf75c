//! Broken meshes: the right fault, a useful sentence, no panic, and a bound on memory.

use crate::support::files::mesh::{Noise, Solid, glb, read, read_as};
use crate::support::files::ply::Encoding;
use crate::support::work::within_bytes;
use meshsnap_render::import::{Format, MeshFault};
use serde_json::json;

const FORMATS: [Format; 6] = [Format::Obj, Format::Gltf, Format::Glb, Format::StlBinary, Format::StlAscii, Format::Ply];

fn small_files() -> [(Format, Vec<u8>); 8] {
    let solid = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7], [0, 1, 5]]);
    let gltf = solid.gltf();
    [
        (Format::Obj, solid.obj().into_bytes()),
        (Format::Gltf, gltf.gltf().into_bytes()),
        (Format::Glb, gltf.glb()),
        (Format::StlBinary, solid.stl_binary()),
        (Format::StlAscii, solid.stl_ascii().into_bytes()),
        (Format::Ply, solid.ply(Encoding::Ascii)),
        (Format::Ply, solid.ply(Encoding::Little)),
        (Format::Ply, solid.ply(Encoding::Big)),
    ]
}

#[test]
fn what_is_not_a_mesh_is_unrecognised() {
    let inputs: [&[u8]; 14] = [
        b"",
        b" ",
        b"\n\n\n",
        b"# only\n# comments\n",
        b"hello",
        b"v is a letter\nf too\n",
        b"{}",
        b"{\"a\": 1}",
        b"[1, 2]",
        b"\x89PNG\r\n\x1a\n",
        b"OFF the record\n",
        b"solid as a rock",
        b"<html></html>",
        b"gl",
    ];
    for input in inputs {
        let error = read(input).unwrap_err();
        assert_eq!(error.fault, MeshFault::Unrecognised, "{:?}: {error}", String::from_utf8_lossy(input));
    }
    assert!(read(b"").unwrap_err().detail.contains("empty"));
    let blend = read(b"BLENDER-v300").unwrap_err().detail;
    assert!(blend.contains("a Blender file, which is not read: convert it to OBJ, STL, PLY"), "{blend}");
    for format in FORMATS {
        assert_eq!(read_as(b"", Some(format)).unwrap_err().fault, MeshFault::Unrecognised);
        assert!(read_as(b"# only comments\n", Some(format)).is_err());
    }
}

#[test]
fn random_bytes_are_refused_whatever_they_are_called() {
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let mut cases = 0;
    for round in 0..2000 {
        let count = 1 + (noise.next() % 600) as usize;
        let mut bytes = noise.bytes(count);
        assert_eq!(read(&bytes).unwrap_err().fault, MeshFault::Unrecognised);
        if round % 4 == 0 && count > 4 {
            bytes[..4].copy_from_slice(b"glTF");
            assert!(read(&bytes).is_err());
        }
        for format in FORMATS {
            assert!(read_as(&bytes, Some(format)).is_err());
            cases += 1;
        }
    }
    assert_eq!(cases, 12_000);
}

#[test]
fn a_file_cut_off_anywhere_is_refused_or_shorter() {
    let mut cases = 0;
    for (format, bytes) in small_files() {
        let whole = read(&bytes).unwrap();
        for length in 0..bytes.len() {
            for given in [None, Some(format)] {
                cases += 1;
                match read_as(&bytes[..length], given) {
                    // A text that ends between two faces, or within a number, is a whole file of
                    // its own.
                    Ok(mesh) => {
                        assert!(format == Format::Obj || length >= bytes.trim_ascii_end().len() - "a test".len() - 1);
                        assert!(mesh.triangles.len() <= whole.triangles.len());
                    }
                    Err(error) => assert!(
                        matches!(error.fault, MeshFault::Unrecognised | MeshFault::Broken | MeshFault::Empty),
                        "{format:?} {length}: {error}"
                    ),
                }
            }
        }
    }
    assert!(cases > 4000, "{cases}");
}

#[test]
fn mutated_files_never_panic_and_never_cost_much() {
    let mut noise = Noise(12345);
    let mut cases = 0;
    for (format, bytes) in small_files() {
        for _ in 0..2000 {
            let mut bytes = bytes.clone();
            for _ in 0..=noise.next() % 4 {
                let at = (noise.next() % bytes.len() as u64) as usize;
                match noise.next() % 4 {
                    0 => bytes[at] = noise.next() as u8,
                    1 => bytes[at] ^= 1 << (noise.next() % 8),
                    2 => _ = bytes.remove(at),
                    _ => bytes.insert(at, b"0123456789-/.e\n {}[],\""[(noise.next() % 22) as usize]),
                }
            }
            within_bytes(64 << 20, "a changed file", || {
                _ = read(&bytes);
                _ = read_as(&bytes, Some(format));
            });
            cases += 1;
        }
    }
    assert_eq!(cases, 16_000);
}

#[test]
fn obj_errors_name_the_line() {
    let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
    let cases = [
        ("f 1 2 4\n", "line 6 of the OBJ file: the vertex index 4 is out of range: there are 3"),
        ("f 1 2 3\nf 1 2 -4\n", "line 7 of the OBJ file: the vertex index -4 is out of range"),
        ("f 1 2 0\n", "line 6 of the OBJ file: the vertex index is 0, and OBJ counts from 1"),
        ("f 1/1 2/1 3/2\n", "line 6 of the OBJ file: the texture coordinate index 2 is out of range: there are 1"),
        ("f 1/-2 2/1 3/1\n", "the texture coordinate index -2 is out of range"),
        ("f 1//1 2//1 3//9\n", "line 6 of the OBJ file: the normal index 9 is out of range: there are 1"),
        ("f 1//-9 2//1 3//1\n", "the normal index -9 is out of range"),
        ("f 1 2 x\n", "line 6 of the OBJ file: the vertex index \"x\" is not a whole number"),
        ("f 1/1/1/1 2 3\n", "has more than three indices"),
        ("f /1 2 3\n", "a corner has no vertex index"),
        ("f 1 2 99999999999999999999\n", "is not a whole number"),
        ("f 1 2 9223372036854775807\n", "is out of range"),
        ("f 1/9223372036854775807 2/1 3/1\n", "the texture coordinate index 9223372036854775807 is out of range"),
        ("f 1/9223372036854775809 2/1 3/1\n", "is not a whole number"),
        ("f 1//6148914691236517206 2//1 3//1\n", "the normal index 6148914691236517206 is out of range"),
        ("f 1/4294967295 2/1 3/1\n", "the texture coordinate index 4294967295 is out of range: there are 1"),
        ("f -9223372036854775808 2 3\n", "is out of range"),
        ("\nv 1 2\n", "line 7 of the OBJ file: \"v\" needs 3 numbers, and it has 2"),
        ("v 1 2 z\n", "line 6 of the OBJ file: a vertex needs three numbers"),
        ("v 1 2 \u{e9}\n", "\"v\" needs 3 numbers, and \"\u{e9}\" is none"),
        ("vn 1 2\n", "line 6 of the OBJ file: \"vn\" needs 3 numbers"),
        ("vt\n", "line 6 of the OBJ file: \"vt\" needs 2 numbers"),
        ("vn a b c\n", "line 6 of the OBJ file: a normal needs three numbers"),
        ("vt a b\n", "line 6 of the OBJ file: a texture coordinate needs two numbers"),
    ];
    for (tail, expected) in cases {
        let error = read(format!("{head}{tail}").as_bytes()).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{tail}: {error}");
        assert!(error.detail.contains(expected), "{tail}: {error}");
    }
}

#[test]
fn nothing_to_draw_says_what_there_was() {
    let solid = Solid::cuboid();
    let no_faces: String = solid.obj().lines().filter(|l| !l.starts_with('f')).map(|l| format!("{l}\n")).collect();
    let cases: [(&[u8], &str); 8] = [
        (no_faces.as_bytes(), "8 vertices and 0 faces"),
        (b"v 0 0 0\nv 1 0 0\nl 1 1\nl 2\n", "2 vertices and 0 faces"),
        (b"v nan 0 0\np 1\n", "1 vertex and 0 faces"),
        (
            b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "3 vertices and 1 face, of whose triangles 1 has a NaN or infinite corner and 0 have no area",
        ),
        (b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n", "1 has no area"),
        (b"v 5 5 5\nv 5 5 5\nv 5 5 5\nf 1 2 3\n", "1 has no area"),
        (b"solid x\nendsolid x\n", "0 faces"),
        (&[0; 84], "STL file has nothing to draw"),
    ];
    for (bytes, expected) in cases {
        let error = read(bytes).unwrap_err();
        assert_eq!(error.fault, MeshFault::Empty, "{error}");
        assert!(error.detail.contains(expected), "{error}");
    }
}

#[test]
fn lying_headers_are_told() {
    let (_, glb_bytes) = &small_files()[2];
    let with = |at: usize, value: u32| {
        let mut bytes = glb_bytes.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        read(&bytes)
    };
    let length = glb_bytes.len() as u32;
    for lie in [0, 1, 11, 12, 19, 20, length - 1, length + 1, u32::MAX] {
        let error = with(8, lie).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{lie}: {error}");
        assert!(error.detail.contains("GLB"), "{error}");
    }
    for lie in [0, 4, length, u32::MAX] {
        assert_eq!(with(12, lie).unwrap_err().fault, MeshFault::Broken, "{lie}");
    }
    assert_eq!(with(4, 1).unwrap_err().fault, MeshFault::Unsupported);
    assert_eq!(with(16, 0x004E4942).unwrap_err().fault, MeshFault::Broken, "a BIN chunk first");

    let (_, stl) = &small_files()[3];
    let count = |n: u32| {
        let mut bytes = stl.clone();
        bytes[80..84].copy_from_slice(&n.to_le_bytes());
        bytes
    };
    let error = read(&count(4)).unwrap_err();
    assert_eq!(error.fault, MeshFault::Broken);
    assert!(error.detail.contains("4 triangles, which needs 284 bytes, and the file has 234"), "{error}");
    assert_eq!(read_as(&count(u32::MAX - 1), Some(Format::StlBinary)).unwrap_err().fault, MeshFault::Broken);
    let shorter = read(&count(2)).unwrap();
    assert!(shorter.report.warnings.iter().any(|w| w.code == "trailing_bytes"));
}

/// Changes one place in a good glTF file, and expects it to be called broken, in a sentence with a
/// certain word.
#[test]
fn gltf_references_are_checked() {
    let mut good = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7]]).gltf();
    let normal = good.floats("VEC3", &[1.0; 24]);
    good.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normal.into();
    read(&good.glb()).unwrap();
    let huge = json!(u64::MAX);
    let cases = [
        ("/scene", json!(1), "scene 1"),
        ("/scenes/0/nodes/0", json!(7), "node 7"),
        ("/nodes/0/mesh", json!(1), "mesh 1"),
        ("/nodes/0", json!({ "mesh": 0, "children": [0] }), "own ancestor"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(9), "accessor 9"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(-1), "JSON"),
        ("/meshes/0/primitives/0/attributes/NORMAL", json!(1), "Scalar, which a NORMAL cannot be"),
        ("/meshes/0/primitives/0/indices", json!(0), "Vec3, which a list of vertex indices"),
        ("/meshes/0/primitives/0/indices", json!(4294967295_u32), "accessor 4294967295"),
        ("/meshes/0/primitives/0/mode", json!(8), "mode"),
        ("/accessors/0/bufferView", json!(50), "buffer view 50"),
        ("/accessors/0/byteOffset", json!(4), "elements"),
        ("/accessors/0/byteOffset", huge, "JSON"),
        ("/accessors/0/byteOffset", json!(9007199254740991_u64), "elements"),
        ("/accessors/0/count", json!(9), "elements"),
        ("/accessors/0/count", json!(7), "7 positions and 8"),
        ("/accessors/0/count", json!(2), "2 positions and 8"),
        ("/bufferViews/1/byteOffset", json!(0), "vertex index"),
        ("/accessors/0/componentType", json!(5130), "component type"),
        ("/accessors/0/type", json!("VEC9"), "type"),
        ("/accessors/0/type", json!("MAT4"), "Mat4, which a POSITION"),
        ("/accessors/1/componentType", json!(5126), "F32, which a list of vertex indices"),
        ("/accessors/1/componentType", json!(5122), "I16, which a list of vertex indices"),
        ("/bufferViews/0/buffer", json!(1), "buffer 1"),
        ("/bufferViews/0/byteOffset", json!(9007199254740991_u64), "spans"),
        ("/bufferViews/0/byteLength", json!(9007199254740991_u64), "spans"),
        ("/bufferViews/0/byteLength", json!(95), "95 bytes"),
        ("/buffers", json!([]), "buffer 0"),
        ("/asset", json!({}), "version"),
        ("/accessors", json!({ "POSITION": 9 }), "JSON"),
        ("/meshes/0/primitives/0/attributes", json!({ "POSITION": 9 }), "accessor 9"),
    ];
    let mut ran = 0;
    for (place, value, word) in cases {
        let mut json = good.json.clone();
        json["buffers"][0]["byteLength"] = good.bin.len().into();
        let (parent, key) = place.rsplit_once('/').unwrap();
        let slot = json.pointer_mut(parent).unwrap();
        if slot.is_array() {
            slot[key.parse::<usize>().unwrap()] = value
        } else {
            slot[key] = value
        }
        let error = read(&glb(&json.to_string(), &good.bin)).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{place}: {error}");
        assert!(error.detail.contains(word), "{place}: {error}");
        ran += 1;
    }
    assert_eq!(ran, 31);
}
