//! Bombs: files that are small as they are sent, and large, deep or endless for a reader that
//! believes them.

use crate::support::files::archive::{Raw, archive, crc32};
use crate::support::files::fbx::{self as fbx_files, file, geometry, model};
use crate::support::files::mesh::{Gltf, Solid, glb};
use crate::support::server::CUBE_OBJ;
use serde_json::{Value, json};

/// An upload, and what the server says of it.
pub struct Bomb {
    pub name: &'static str,
    pub body: Vec<u8>,
    pub code: &'static str,
}

/// The code of an upload that is drawn, without the part that costs.
pub const DRAWN: &str = "";

/// A count that no memory has room for.
const HUGE: u64 = 4_000_000_000_000;

pub fn all() -> Vec<Bomb> {
    let groups = [archives(), images(), json_texts(), graphs(), counts(), packed()];
    groups.into_iter().flatten().map(|(name, body, code)| Bomb { name, body, code }).collect()
}

type Case = (&'static str, Vec<u8>, &'static str);

fn archives() -> Vec<Case> {
    let zeros = vec![0; 64 << 20];
    let bomb = Raw::deflated("zeros.obj", &zeros);
    // Just below the size from which on a ratio counts.
    let below = Raw::deflated("zeros.obj", &zeros[..15 << 20]);
    let named = |raw: &Raw, i: usize| Raw { name: format!("{i}.obj").into(), ..raw.clone() };
    let many_of = |raw: &Raw, n: usize| archive(&(0..n).map(|i| named(raw, i)).collect::<Vec<_>>(), n as u16);
    let cube = || Raw::deflated("cube.obj", CUBE_OBJ);
    let zip = archive(&[cube()], 1);
    let nested = (0..5).fold(zip.clone(), |inner, _| archive(&[Raw::deflated("inner.zip", &inner)], 1));
    let empty: Vec<Raw> = (0..65_535).map(|i| Raw::stored(&format!("{i}"), b"")).collect();
    let shared: Vec<Raw> = (0..500).map(|i| Raw { start: (i > 0).then_some(0), ..named(&bomb, i) }).collect();
    let (broken, limit) = ("bundle_broken", "limit_exceeded");
    vec![
        ("zip, 1000:1, 64 MiB", archive(std::slice::from_ref(&bomb), 1), broken),
        ("zip, 1000:1, 8 x 64 MiB", many_of(&bomb, 8), broken),
        ("zip, 1000:1, 9 x 64 MiB", many_of(&bomb, 9), limit),
        ("zip, 1000:1, 34 x 15 MiB", many_of(&below, 34), broken),
        ("zip, says 1 kB and is 64 MiB", archive(&[Raw { size: 1000, ..bomb.clone() }], 1), broken),
        ("zip, 500 entries share their bytes", archive(&shared, 500), broken),
        ("zip, an archive in an archive", archive(&[Raw::stored("inner.zip", &zip)], 1), broken),
        ("zip, archives in archives, six deep", nested, broken),
        ("zip, 65,535 entries", archive(&empty, 65_535), limit),
        ("zip, a symbolic link", archive(&[Raw { mode: 0o120_777, ..cube() }], 1), broken),
        ("zip, `../`", archive(&[Raw { name: b"../../etc/cube.obj".into(), ..cube() }], 1), broken),
        ("zip, an absolute name", archive(&[Raw { name: b"/etc/passwd".into(), ..cube() }], 1), broken),
    ]
}

fn images() -> Vec<Case> {
    vec![
        ("PNG, 30000 x 30000", textured("a.png", &png(30_000, 30_000)), "limit_exceeded"),
        ("PNG, 2^31 x 2^31", textured("a.png", &png(1 << 31, 1 << 31)), "limit_exceeded"),
        ("PNG, 8192 x 8192 without its pixels", textured("a.png", &png(8192, 8192)), DRAWN),
        ("JPEG, 65500 x 65500", textured("a.jpg", &jpeg(65_500)), "limit_exceeded"),
        ("WebP, 16383 x 16383", textured("a.webp", &webp(16_383)), "limit_exceeded"),
        ("KTX2, 30000 x 30000", textured("a.ktx2", &ktx2(30_000)), "limit_exceeded"),
    ]
}

/// A triangle with that texture, in an archive.
fn textured(name: &str, picture: &[u8]) -> Vec<u8> {
    let obj = b"mtllib m.mtl\nusemtl A\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    let mtl = format!("newmtl A\nmap_Kd {name}\n");
    archive(&[Raw::stored("m.obj", obj), Raw::stored("m.mtl", mtl.as_bytes()), Raw::stored(name, picture)], 3)
}

/// A PNG of this size, whose pixels are not there.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        let body = [kind, data].concat();
        out.extend((data.len() as u32).to_be_bytes());
        out.extend(&body);
        out.extend(crc32(&body).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 6, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    // A deflate stream that goes on beyond its end.
    chunk(b"IDAT", &[&[0x78, 0x9c][..], &[0xed; 900]].concat());
    chunk(b"IEND", b"");
    out
}

/// A JPEG of one pixel whose header says that it has another size.
fn jpeg(side: u16) -> Vec<u8> {
    let mut out = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut out);
    image::ImageEncoder::write_image(encoder, &[0; 3], 1, 1, image::ExtendedColorType::Rgb8).unwrap();
    let frame = out.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
    for at in [frame + 5, frame + 7] {
        out[at..at + 2].copy_from_slice(&side.to_be_bytes());
    }
    out
}

/// RFC 9649, 2.6: a lossless picture's header, and nothing of it.
fn webp(side: u32) -> Vec<u8> {
    let size = (side - 1) | (side - 1) << 14;
    let data = [&[0x2f][..], &size.to_le_bytes(), &[0; 900]].concat();
    let chunk = [b"WEBPVP8L", &(data.len() as u32).to_le_bytes()[..], &data, &[0; 1][..data.len() % 2]].concat();
    [b"RIFF", &(chunk.len() as u32).to_le_bytes()[..], &chunk].concat()
}

/// KTX File Format 2.0, 3: Basis Universal, one level of a few bytes.
fn ktx2(side: u32) -> Vec<u8> {
    let mut out = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    for word in [0, 1, side, side, 0, 0, 1, 1, 1] {
        out.extend(u32::to_le_bytes(word));
    }
    for word in [104, 92, 0, 0, 0, 0, 0, 0] {
        out.extend(u32::to_le_bytes(word));
    }
    for word in [200, 16, u64::from(side).pow(2) * 4] {
        out.extend(u64::to_le_bytes(word));
    }
    out.resize(1000, 0);
    out
}

fn triangle() -> Gltf {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    gltf.mesh(json!({ "attributes": { "POSITION": p } }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    gltf
}

fn json_texts() -> Vec<Case> {
    let deep = |open: &str, close: &str| {
        let mut json = triangle().json.to_string();
        json.pop();
        json + &format!(",\"extras\":{}1{}}}", open.repeat(100_000), close.repeat(100_000))
    };
    let unclosed = format!("{{\"asset\":{}", "{\"a\":".repeat(100_000));
    let objects = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{}{{}}]}}", "{},".repeat(200_000));
    let limit = "limit_exceeded";
    vec![
        ("glTF, lists 100,000 deep", deep("[", "]").into_bytes(), limit),
        ("glTF, objects 100,000 deep", deep("{\"a\":", "}").into_bytes(), limit),
        ("glTF, objects 100,000 deep, never closed", unclosed.into_bytes(), limit),
        ("GLB, lists 100,000 deep", glb(&deep("[", "]"), &[]), limit),
        ("glTF, 200,000 empty nodes", objects.into_bytes(), limit),
    ]
}

fn graphs() -> Vec<Case> {
    let with_nodes = |nodes: Value, root: usize| {
        let mut gltf = triangle();
        gltf.json["nodes"] = nodes;
        gltf.json["scenes"] = json!([{ "nodes": [root] }]);
        gltf.glb()
    };
    let mut doubling = vec![json!({ "mesh": 0 })];
    doubling.extend((0..40).map(|i| json!({ "children": [i, i] })));
    let ring: Vec<Value> = (0..1000).map(|i| json!({ "mesh": 0, "children": [(i + 1) % 1000] })).collect();
    let wide = json!([{ "mesh": 0 }, { "children": vec![0; 1_000_000] }]);
    vec![
        ("glTF, a node that is its own child", with_nodes(json!([{ "mesh": 0, "children": [0] }]), 0), "mesh_broken"),
        ("glTF, a ring of 1,000 nodes", with_nodes(ring.into(), 0), "mesh_broken"),
        ("glTF, nodes that double 40 times", with_nodes(doubling.into(), 40), "limit_exceeded"),
        ("glTF, a node with 1,000,000 children", with_nodes(wide, 1), "limit_exceeded"),
        ("3MF, components that double 40 times", doubling_3mf(), "limit_exceeded"),
    ]
}

/// A package whose objects hold each other twice, forty deep.
fn doubling_3mf() -> Vec<u8> {
    let mut model = "<model><resources><object id=\"1\"><mesh><vertices>".to_owned();
    model += "<vertex x=\"0\" y=\"0\" z=\"1\"/><vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/>";
    model += "</vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/></triangles></mesh></object>";
    for level in 2..42 {
        let inner = format!("<component objectid=\"{}\"/>", level - 1).repeat(2);
        model += &format!("<object id=\"{level}\"><components>{inner}</components></object>");
    }
    model += "</resources><build><item objectid=\"41\"/></build></model>";
    let parts = [("[Content_Types].xml", "<Types/>"), ("3D/3dmodel.model", model.as_str())];
    archive(&parts.map(|(name, text)| Raw::stored(name, text.as_bytes())), 2)
}

fn counts() -> Vec<Case> {
    let mut accessor = triangle();
    accessor.json["accessors"][0] = json!({ "type": "VEC3", "componentType": 5126, "count": HUGE });
    let sparse = |replaced: u64| {
        let mut gltf = accessor.clone();
        gltf.json["accessors"][0]["sparse"] = json!({
            "count": replaced, "indices": { "bufferView": 0, "componentType": 5125 }, "values": { "bufferView": 0 }
        });
        gltf.glb()
    };
    let mut view = triangle();
    view.json["bufferViews"][0]["byteLength"] = HUGE.into();
    let ply = |format: &str| {
        let head = format!("ply\nformat {format} 1.0\nelement vertex {HUGE}\nproperty float x\nproperty float y\n");
        format!("{head}property float z\nelement face {HUGE}\nproperty list uchar int vertex_indices\nend_header\n")
    };
    let (broken, limit) = ("mesh_broken", "limit_exceeded");
    vec![
        ("glTF, an accessor of 4e12", accessor.glb(), limit),
        ("glTF, 4e12, one of them sparse", sparse(1), limit),
        ("glTF, 4e12, all of them sparse", sparse(HUGE), limit),
        ("glTF, a view of 4e12 bytes", view.glb(), broken),
        ("PLY text, 4e12 vertices and faces", ply("ascii").into_bytes(), broken),
        ("PLY binary, 4e12 vertices and faces", ply("binary_little_endian").into_bytes(), broken),
        ("OFF, 4e12 vertices and faces", format!("OFF\n{HUGE} {HUGE} 0\n0 0 0\n").into_bytes(), broken),
    ]
}

/// Small arrays that unpack to large ones, and data that is not there.
fn packed() -> Vec<Case> {
    let zeros = |count: usize| {
        let mut gltf = triangle();
        gltf.json["accessors"][0] = json!({ "type": "VEC3", "componentType": 5126, "count": count });
        gltf.glb()
    };
    let mut mesh = geometry(1, &Solid::cuboid(), vec![]);
    mesh.children[0].values = vec![fbx_files::Value::Packed(b'd', vec![0; 96_000_000])];
    let fbx = fbx_files::binary(&file(1, vec![mesh, model(2, "Mesh", vec![])], &[(2, 0, ""), (1, 2, "")]));
    vec![
        ("FBX, 12,000,000 coordinates, 1000:1", fbx, "mesh_broken"),
        ("glTF, 20,000,000 vertices without data", zeros(20_000_000), "mesh_broken"),
    ]
}
