//! glTF: one shape in several encodings, compressed and not.

use crate::support::data;
use crate::support::files::bundle::read_bundle;
use crate::support::files::mesh::{Gltf, Read, Solid, assert_close, corners, read};
use crate::support::scenes;
use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::import::{Bundle, BundleFile};
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use serde_json::json;
use std::path::Path;

/// A wavy sheet with normals, and its triangles.
pub struct Sheet {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    pub indices: Vec<u32>,
}

impl Sheet {
    pub fn new() -> Self {
        let solid = Solid::grid(20);
        let unit = |p: &[f64; 3]| [(p[0] - 10.0) / 16.0, 0.5, (p[2] + p[1]) / 32.0];
        let normal = |p: &[f64; 3]| {
            let v = unit(p);
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            v.map(|c| (c / length) as f32)
        };
        let quads = solid.polygons.iter().flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]);
        Self {
            positions: solid.positions.iter().map(|p| p.map(|c| c as f32)).collect(),
            normals: solid.positions.iter().map(normal).collect(),
            indices: quads.collect(),
        }
    }

    /// Nothing compressed: what all others are compared with.
    fn plain(&self) -> Gltf {
        let mut gltf = Gltf::default();
        let p = gltf.floats("VEC3", &self.positions.concat());
        let n = gltf.floats("VEC3", &self.normals.concat());
        let indices: Vec<u16> = self.indices.iter().map(|&i| i as u16).collect();
        let i = gltf.shorts("SCALAR", &indices);
        gltf.mesh(json!({ "attributes": { "POSITION": p, "NORMAL": n }, "indices": i }));
        gltf.json["nodes"] = json!([{ "mesh": 0 }]);
        gltf
    }

    /// Positions as shorts of 1/1000, normals as normalised bytes, both padded to four bytes, or
    /// padded to four components.
    fn small(&self) -> (Vec<[i16; 4]>, Vec<[i8; 4]>) {
        let position = |p: &[f32; 3]| [0, 1, 2, 3].map(|k| p.get(k).map_or(0, |c| (c * 1000.0).round() as i16));
        let normal = |n: &[f32; 3]| [0, 1, 2, 3].map(|k| n.get(k).map_or(0, |c| (c * 127.0).round() as i8));
        (self.positions.iter().map(position).collect(), self.normals.iter().map(normal).collect())
    }

    fn quantised(&self) -> Gltf {
        let (positions, normals) = self.small();
        let bytes: Vec<u8> = positions.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let mut gltf = self.plain();
        put(&mut gltf, 0, 5122, &bytes, 8);
        let bytes: Vec<u8> = normals.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        put(&mut gltf, 1, 5120, &bytes, 4);
        gltf.json["accessors"][1]["normalized"] = true.into();
        gltf.json["nodes"][0]["scale"] = json!([0.001, 0.001, 0.001]);
        gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        gltf.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        gltf
    }

    /// `name` is either extension's.
    pub fn meshopt(&self, name: &str) -> Gltf {
        let mut gltf = self.quantised();
        let (positions, _) = self.small();
        let packed = meshopt::encode_vertex_buffer_level(&positions, 2, Some(0)).unwrap();
        let view = gltf.json["accessors"][0]["bufferView"].as_u64().unwrap() as usize;
        pack(&mut gltf, name, view, &packed, [positions.len(), 8], ["ATTRIBUTES", "NONE"]);
        let with_w: Vec<[f32; 4]> = self.normals.iter().map(|n| [n[0], n[1], n[2], 0.0]).collect();
        let normals: Vec<[i8; 4]> = meshopt::encode_filter_oct(&with_w, 8);
        let packed = meshopt::encode_vertex_buffer_level(&normals, 2, Some(0)).unwrap();
        let view = gltf.json["accessors"][1]["bufferView"].as_u64().unwrap() as usize;
        pack(&mut gltf, name, view, &packed, [normals.len(), 4], ["ATTRIBUTES", "OCTAHEDRAL"]);
        let packed = meshopt::encode_index_buffer(&self.indices, self.positions.len()).unwrap();
        let view = gltf.json["accessors"][2]["bufferView"].as_u64().unwrap() as usize;
        pack(&mut gltf, name, view, &packed, [self.indices.len(), 2], ["TRIANGLES", "NONE"]);
        gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization", name]);
        gltf
    }

    pub fn draco(&self) -> Gltf {
        use draco_core::{DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, MeshEncoder, PointAttribute};
        let mut mesh = draco_core::Mesh::new();
        mesh.set_num_points(self.positions.len());
        for (kind, values) in
            [(GeometryAttributeType::Position, &self.positions), (GeometryAttributeType::Normal, &self.normals)]
        {
            let mut attribute = PointAttribute::new();
            attribute.init(kind, 3, DataType::Float32, false, values.len());
            let bytes: Vec<u8> = values.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
            attribute.buffer_mut().update(&bytes, Some(0));
            mesh.add_attribute(attribute);
        }
        mesh.set_num_faces(self.indices.len() / 3);
        mesh.set_faces_from_flat_indices(&self.indices);
        let mut encoder = MeshEncoder::new();
        encoder.set_mesh(mesh);
        let mut out = EncoderBuffer::new();
        let mut options = EncoderOptions::new();
        options.set_attribute_int(0, "quantization_bits", 14);
        options.set_attribute_int(1, "quantization_bits", 10);
        encoder.encode(&options, &mut out).unwrap();
        let mut gltf = self.plain();
        let view = gltf.view(out.data());
        for accessor in gltf.json["accessors"].as_array_mut().unwrap() {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        gltf.json["meshes"][0]["primitives"][0]["extensions"] = json!({
            "KHR_draco_mesh_compression": { "bufferView": view, "attributes": { "POSITION": 0, "NORMAL": 1 } }
        });
        gltf.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        gltf
    }
}

/// Gives an accessor new data with a stride.
fn put(gltf: &mut Gltf, accessor: usize, component: u32, bytes: &[u8], stride: usize) {
    let view = gltf.view(bytes);
    gltf.json["bufferViews"][view]["byteStride"] = stride.into();
    gltf.json["accessors"][accessor]["bufferView"] = view.into();
    gltf.json["accessors"][accessor]["componentType"] = component.into();
}

/// Replaces the data of a view by packed bytes; its own buffer becomes one that has none.
fn pack(
    gltf: &mut Gltf,
    name: &str,
    view: usize,
    packed: &[u8],
    [count, stride]: [usize; 2],
    [mode, filter]: [&str; 2],
) {
    let from = gltf.view(packed);
    let source = gltf.json["bufferViews"][from].clone();
    let view = &mut gltf.json["bufferViews"][view];
    (view["buffer"], view["byteOffset"], view["byteLength"]) = (1.into(), 0.into(), (count * stride).into());
    view["extensions"][name] = json!({
        "buffer": 0, "byteOffset": source["byteOffset"], "byteLength": packed.len(),
        "byteStride": stride, "count": count, "mode": mode, "filter": filter,
    });
    let own = gltf.json["buffers"][0].clone();
    gltf.json["buffers"] = json!([own, { "byteLength": 1_000_000, "extensions": { name: { "fallback": true } } }]);
}

fn normals_close(a: &Mesh, b: &Mesh, tolerance: f32) {
    // Sorted: encodings may number vertices anew.
    let corners_of = |mesh: &Mesh| -> Vec<[f32; 3]> {
        mesh.attribute_triangles.iter().flatten().map(|&v| mesh.normals[v as usize]).collect()
    };
    let (a, b) = (corners_of(a), corners_of(b));
    assert_eq!(a.len(), b.len());
    let far = a.iter().zip(&b).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > tolerance)).count();
    assert_eq!(far, 0, "{far} normals of {}", a.len());
}

/// Triangles in the order of their corners, each from its smallest on, since encoders turn and
/// reorder them. The sheet's corners lie on multiples of 1/8.
fn in_order(mut mesh: Read) -> Read {
    let all = corners(&mesh);
    let key = |t: &[[f64; 3]; 3]| {
        let mut key: Vec<[i64; 3]> = t.iter().map(|p| p.map(|c| (c * 8.0).round() as i64)).collect();
        key.sort_unstable();
        key
    };
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&i| key(&all[i]));
    let turn = |i: usize| {
        let smallest = (0..3).min_by_key(|&k| all[i][k].map(|c| (c * 8.0).round() as i64)).unwrap();
        [0, 1, 2].map(|k| (k + smallest) % 3)
    };
    let sorted = |triangles: &[[u32; 3]]| order.iter().map(|&i| turn(i).map(|k| triangles[i][k])).collect::<Vec<_>>();
    (mesh.triangles, mesh.attribute_triangles) = (sorted(&mesh.triangles), sorted(&mesh.attribute_triangles));
    mesh
}

#[test]
fn every_encoding_holds_the_same_shape() {
    let sheet = Sheet::new();
    let plain = read(&sheet.plain().glb()).unwrap();
    let mut cases = 0;
    // Positions within half a step; normals within what eight bits a side of an octahedron tell,
    // about a degree.
    for gltf in [sheet.quantised(), sheet.meshopt("EXT_meshopt_compression"), sheet.meshopt("KHR_meshopt_compression")]
    {
        let mesh = read(&gltf.glb()).unwrap();
        assert_close(&in_order(plain.clone()), &in_order(mesh.clone()), 0.5e-3 + 1e-6);
        normals_close(&in_order(plain.clone()), &in_order(mesh), 2.5 / 127.0);
        cases += 1;
    }
    // 14 bits over a range of 20.
    let mesh = read(&sheet.draco().glb()).unwrap();
    assert_close(&in_order(plain.clone()), &in_order(mesh.clone()), 20.0 / 16383.0);
    normals_close(&in_order(plain), &in_order(mesh), 6.0 / 1023.0);
    assert_eq!(cases, 3);
}

#[test]
fn known_compressed_models_are_read() {
    let folder = data::folder("models");
    let draco = read_files(&folder.join("BoxDraco"), &["BoxDraco.gltf", "0.bin"]);
    let boxes = [draco, read(&data::bytes("models/BoxMeshopt.glb")).unwrap()];
    for mesh in boxes {
        assert_eq!(mesh.triangles.len(), 12);
        let [low, high] = mesh.bounds;
        assert!((0..3).all(|k| (high[k] - low[k] - (high[0] - low[0])).abs() < 1e-3), "{:?}", mesh.bounds);
    }
}

fn read_files(folder: &Path, names: &[&str]) -> Read {
    let file = |name: &&str| BundleFile::new(name, std::fs::read(folder.join(name)).unwrap()).unwrap();
    read_bundle(&Bundle::of_files(names.iter().map(file).collect())).unwrap()
}

#[test]
fn large_compressed_models_are_read() {
    let Some(folder) = data::large_folder("models") else { return };
    let of = |name: &str| {
        read_files(&folder.join(name), &[format!("{name}.gltf"), format!("{name}.bin")].each_ref().map(String::as_str))
    };
    // The fallback's file is left out: the compressed data holds everything.
    let (with, without) = (of("meshopt-fallback"), of("meshopt-no-fallback"));
    assert!(with.triangles.len() > 10);
    assert_close(&with, &without, 1e-6);
    // Quantised: a sphere stays round.
    let sphere = read(&std::fs::read(folder.join("DenseSphere.glb")).unwrap()).unwrap();
    let radius = |p: &[f32; 3]| p.iter().map(|c| c * c).sum::<f32>().sqrt();
    let (small, large) = sphere.positions.iter().map(radius).fold((9.0_f32, 0.0_f32), |(a, b), r| (a.min(r), b.max(r)));
    assert!(large / small < 1.02, "{small} to {large}");
}

/// The mean difference of two pictures' channels, /255.
fn mean_difference(a: &Image, b: &Image) -> f64 {
    let sum: u64 = a.rgba.iter().zip(&b.rgba).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.rgba.len() as f64
}

#[test]
fn every_encoding_gives_the_same_picture() {
    let draw = |bytes: &[u8], style: &str| {
        let spec = scenes::spec(&[("style", style), ("size", "128")]);
        CpuRenderer::new(1).draw(&scenes::plan(&read(bytes).unwrap(), &spec), &Deadline::default()).unwrap()
    };
    let sheet = Sheet::new();
    let packed = [
        sheet.quantised(),
        sheet.meshopt("EXT_meshopt_compression"),
        sheet.meshopt("KHR_meshopt_compression"),
        sheet.draco(),
    ];
    let mut cases = 0;
    for style in ["smooth", "wire"] {
        let plain = draw(&sheet.plain().glb(), style);
        let blank = Image { rgba: vec![255; plain.rgba.len()].into(), ..plain.clone() };
        assert!(mean_difference(&plain, &blank) > 5.0, "there is something to see");
        for (i, gltf) in packed.iter().enumerate() {
            let difference = mean_difference(&plain, &draw(&gltf.glb(), style));
            println!("{style} {i}: {difference}");
            assert!(difference < 0.15, "{style} {i}: {difference}");
            cases += 1;
        }
    }
    assert_eq!(cases, 8);
}
