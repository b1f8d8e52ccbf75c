//! glTF: materials, their textures and texture coordinates, and what of them is broken or not
//! drawn.

use crate::support::data;
use crate::support::files::bundle::read_bundle;
use crate::support::files::mesh::{Gltf, codes, read};
use meshsnap_render::import::{Bundle, BundleFile, MeshError, MeshFault};
use meshsnap_render::mesh::material::{AlphaMode, ImageContent, TextureRef, Wrap};
use meshsnap_render::mesh::{MaterialSlot, Mesh};
use serde_json::{Value, json};
use std::path::Path;

/// A triangle with two sets of texture coordinates and a material that uses what is in the lists.
pub fn surface(material: Value) -> Gltf {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let t0 = gltf.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let t1 = gltf.floats("VEC2", &[0.5, 0.5, 1.0, 0.5, 0.5, 1.0]);
    gltf.mesh(json!({ "attributes": { "POSITION": p, "TEXCOORD_0": t0, "TEXCOORD_1": t1 }, "material": 0 }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    let view = gltf.view(b"not looked at here");
    gltf.json["images"] = json!([
        { "bufferView": view, "mimeType": "image/png", "name": "wood" },
        { "uri": "data:image/png;base64,AAEC" },
        { "uri": "stone floor.png" },
        { "bufferView": view },
    ]);
    gltf.json["samplers"] = json!([{}, { "magFilter": 9728, "minFilter": 9984, "wrapS": 33071, "wrapT": 33648 }]);
    gltf.json["textures"] = json!([{ "source": 0 }, { "source": 1, "sampler": 1 }, { "source": 2 }]);
    gltf.json["materials"] = json!([material]);
    gltf
}

fn slot(material: Value) -> MaterialSlot {
    read(&surface(material).glb()).unwrap().materials.remove(0)
}

#[test]
fn factors_and_their_defaults() {
    let plain = slot(json!({}));
    assert_eq!((plain.base_color, plain.metallic, plain.roughness), (Some([1.0; 4]), Some(1.0), Some(1.0)));
    assert_eq!((plain.emissive, plain.alpha, plain.unlit), (None, AlphaMode::Opaque, false));
    let all = slot(json!({
        "name": "Glass", "alphaMode": "MASK", "emissiveFactor": [0.5, 1, 0],
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.75 },
        "extensions": { "KHR_materials_unlit": {}, "KHR_materials_emissive_strength": { "emissiveStrength": 5 } },
    }));
    assert_eq!(all.name, "Glass");
    assert_eq!((all.base_color, all.metallic, all.roughness), (Some([0.1, 0.2, 0.3, 0.4]), Some(0.25), Some(0.75)));
    assert_eq!((all.emissive, all.alpha, all.unlit), (Some([2.5, 5.0, 0.0]), AlphaMode::Mask(0.5), true));
    let modes = [
        (json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 }), AlphaMode::Mask(0.25)),
        (json!({ "alphaMode": "BLEND" }), AlphaMode::Blend),
        (json!({ "alphaMode": "OPAQUE", "alphaCutoff": 0.25 }), AlphaMode::Opaque),
        (json!({ "alphaMode": "GLOW" }), AlphaMode::Opaque),
    ];
    for (material, expected) in modes {
        assert_eq!(slot(material).alpha, expected);
    }
    let out_of_range = slot(json!({ "pbrMetallicRoughness": { "metallicFactor": -3, "roughnessFactor": 1e300,
        "baseColorFactor": [2, -1, 1e99, 0.5] }, "emissiveFactor": [1e300, 0, 0] }));
    assert_eq!((out_of_range.metallic, out_of_range.roughness), (Some(0.0), Some(1.0)));
    assert_eq!(out_of_range.base_color, Some([1.0, 0.0, 1.0, 0.5]));
    assert_eq!(out_of_range.emissive, Some([65504.0, 0.0, 0.0]));
}

#[test]
fn textures_samplers_and_transforms() {
    let gltf = surface(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 }, "metallicRoughnessTexture": { "index": 0 } },
        "normalTexture": { "index": 0, "scale": 0.5 },
        "occlusionTexture": { "index": 0, "strength": 7 },
        "emissiveTexture": { "index": 2, "extensions": { "KHR_texture_transform":
            { "offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5] } } },
    }));
    let mesh = read(&gltf.glb()).unwrap();
    let slot = &mesh.materials[0];
    let base = slot.base_texture.unwrap();
    assert_eq!((base.image, base.wrap, base.nearest), (0, [Wrap::Clamp, Wrap::Mirror], true));
    assert_eq!(slot.metallic_roughness_texture, Some(TextureRef::new(1)), "repeated and smooth by default");
    assert_eq!((slot.normal_texture, slot.normal_scale), (Some(TextureRef::new(1)), Some(0.5)));
    assert_eq!((slot.occlusion_texture, slot.occlusion_texture_strength), (Some(TextureRef::new(1)), Some(1.0)));
    let apart = surface(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } },
        "occlusionTexture": { "index": 0, "texCoord": 1 },
    }));
    let apart = read(&apart.glb()).unwrap();
    let occlusion = TextureRef { is_second_uvs: true, ..TextureRef::new(1) };
    assert_eq!((apart.materials[0].occlusion_texture, codes(&apart)), (Some(occlusion), vec![]));
    // The extension's own example: the lower left quadrant.
    let emissive = slot.emissive_texture.unwrap();
    let moved = |u: f32, v: f32| emissive.transform.map(|[a, b, c]| (a * u + b * v + c).abs());
    for (uv, expected) in [((0.0, 0.0), [0.0, 1.0]), ((1.0, 0.0), [0.0, 0.5]), ((1.0, 1.0), [0.5, 0.5])] {
        let [u, v] = moved(uv.0, uv.1);
        assert!((u - expected[0]).abs() < 1e-6 && (v - expected[1]).abs() < 1e-6, "{uv:?}: {u}, {v}");
    }
    // Images in the order of their use, each once; the fourth is not used.
    let names: Vec<&str> = mesh.images.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["image 1", "image 0 (\"wood\")", "image 2 (\"stone floor.png\")"]);
    assert_eq!(mesh.images[0].content, ImageContent::Encoded([0, 1, 2].into()));
    assert_eq!(mesh.images[1].content, ImageContent::Encoded(b"not looked at here"[..].into()));
    assert_eq!((&mesh.images[2].content, codes(&mesh)), (&ImageContent::Absent, vec!["textures_missing"]));
}

#[test]
fn texture_coordinates_are_those_that_the_material_wants() {
    let cases = [
        (json!({ "index": 0 }), 0.0),
        (json!({ "index": 0, "texCoord": 1 }), 0.5),
        (json!({ "index": 0, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } }), 0.5),
        (json!({ "index": 0, "texCoord": 1, "extensions": { "KHR_texture_transform": { "texCoord": 0 } } }), 0.0),
    ];
    for (texture, first) in cases {
        let mesh = read(&surface(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } })).glb()).unwrap();
        assert_eq!(mesh.uvs[mesh.attribute_triangles[0][0] as usize], [first; 2]);
        assert!(codes(&mesh).is_empty());
    }
    let mixed = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } },
                        "normalTexture": { "index": 0 } });
    let mesh = read(&surface(mixed).glb()).unwrap();
    let first = mesh.attribute_triangles[0][0] as usize;
    assert_eq!((mesh.uvs[first], mesh.second_uvs[first]), ([0.5; 2], [0.0; 2]), "the base colour's are the first");
    let of = &mesh.materials[0];
    assert_eq!([of.base_texture, of.normal_texture].map(|texture| texture.unwrap().is_second_uvs), [false, true]);
    assert!(codes(&mesh).is_empty());
    let absent = json!({ "normalTexture": { "index": 0, "texCoord": 7 } });
    assert_eq!(codes(&read(&surface(absent).glb()).unwrap()), ["uvs_missing"]);
}

#[test]
fn other_formats_of_images() {
    let base = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } });
    let image = |texture: Value| {
        let mut gltf = surface(base.clone());
        gltf.json["textures"] = json!([texture]);
        let mesh = read(&gltf.glb()).unwrap();
        let slot = &mesh.materials[0];
        (slot.base_texture.map(|t| mesh.images[t.image as usize].clone()), codes(&mesh).join(" "))
    };
    let name = |texture: Value| image(texture).0.unwrap().name;
    assert_eq!(name(json!({ "source": 0, "extensions": { "EXT_texture_webp": { "source": 1 } } })), "image 1");
    assert_eq!(name(json!({ "source": 1, "extensions": { "KHR_texture_basisu": { "source": 3 } } })), "image 1");
    assert_eq!(name(json!({ "extensions": { "KHR_texture_basisu": { "source": 3 } } })), "image 3");
    assert_eq!(image(json!({})), (None, "texture_without_image".to_owned()));
    assert_eq!(image(json!({ "extensions": { "MSFT_texture_dds": { "source": 0 } } })).0, None);
}

#[test]
fn what_is_not_drawn_is_said_once() {
    let mut gltf = surface(json!({
        "occlusionTexture": { "index": 99 },
        "extensions": { "KHR_materials_clearcoat": {}, "KHR_materials_ior": {}, "KHR_materials_sheen": 5, "EXT_x": {} },
    }));
    let second = gltf.json["materials"][0].clone();
    gltf.json["materials"].as_array_mut().unwrap().push(second);
    let mut primitive = gltf.json["meshes"][0]["primitives"][0].clone();
    primitive["material"] = 1.into();
    gltf.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    gltf.json["extensionsRequired"] = json!(["KHR_materials_clearcoat"]);
    let mesh = read(&gltf.glb()).unwrap();
    assert_eq!(codes(&mesh), ["clearcoat_ignored", "ior_ignored", "sheen_ignored", "occlusion_ignored"]);

    let gloss =
        json!({ "diffuseFactor": [0.5, 0.25, 0, 1], "diffuseTexture": { "index": 0 }, "glossinessFactor": 0.75 });
    let alone = slot(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": gloss } }));
    assert_eq!(
        (alone.base_color, alone.metallic, alone.roughness),
        (Some([0.5, 0.25, 0.0, 1.0]), Some(0.0), Some(0.25))
    );
    assert_eq!(alone.base_texture, Some(TextureRef::new(0)));
    let both =
        slot(json!({ "pbrMetallicRoughness": {}, "extensions": { "KHR_materials_pbrSpecularGlossiness": gloss } }));
    assert_eq!((both.base_color, both.base_texture), (Some([1.0; 4]), None));
}

#[test]
fn broken_materials_matter_only_where_they_are_used() {
    let texture = |index: Value| json!({ "emissiveTexture": { "index": index } });
    let with = |key: &str, value: Value| {
        let mut gltf = surface(texture(json!(0)));
        gltf.json[key] = value;
        gltf
    };
    let cases = [
        (surface(texture(json!(3))), "material 0 of the glTF file uses texture 3, and there are 3"),
        (surface(texture(json!(-1))), "material 0 of the glTF file cannot be read"),
        (surface(texture(json!(0.5))), "material 0 of the glTF file cannot be read"),
        (surface(texture(json!("0"))), "material 0 of the glTF file cannot be read"),
        (surface(json!({ "emissiveTexture": {} })), "material 0 of the glTF file cannot be read"),
        (surface(json!(7)), "material 0 of the glTF file cannot be read"),
        (with("textures", json!([{ "source": 4 }])), "texture 0 of the glTF file uses image 4, and there are 4"),
        (with("textures", json!([{ "source": 0, "sampler": 2 }])), "there is no sampler 2 in the glTF file"),
        (with("textures", json!("none")), "uses texture 0, and there are 0"),
    ];
    let images = [
        (with("images", json!([{}])), "image 0 of the glTF file has neither a URI nor a buffer view"),
        (with("images", json!([{ "bufferView": 99 }])), "there is no buffer view 99"),
        (with("images", json!([{ "uri": "data:image/png,%00" }])), "the data URI of image 0"),
        (with("images", json!([{ "uri": "data:image/png;base64,?" }])), "the data URI of image 0"),
    ];
    for (mut gltf, part) in cases.clone() {
        let MeshError { fault, detail } = read(&gltf.glb()).unwrap_err();
        assert!(fault == MeshFault::Broken && detail.contains(part), "{detail}");
        // The same file draws where the material is there and not used.
        gltf.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
        let mesh = read(&gltf.glb()).unwrap_or_else(|error| panic!("{part}: {error}"));
        assert!(mesh.images.is_empty() && mesh.materials.len() == 2);
    }
    assert_eq!(cases.len(), 9);
    // An image that is not there costs its texture, and not the picture.
    for (gltf, part) in images.clone() {
        let mesh = read(&gltf.glb()).unwrap();
        let [warning] = &mesh.report.warnings[..] else { panic!("{:?}", mesh.report.warnings) };
        assert!(warning.code == "textures_broken" && warning.detail.contains(part), "{warning:?}");
        assert_eq!(mesh.images[0].content, ImageContent::Absent);
    }
    assert_eq!(images.len(), 4);
    // Integers may be written with a fraction of zero.
    assert!(slot(texture(json!(1.0))).emissive_texture.is_some());
    // Neither does a mesh that no node shows.
    let mut hidden = surface(texture(json!(99)));
    let mut other = hidden.json["meshes"][0].clone();
    other["primitives"][0].as_object_mut().unwrap().remove("material");
    hidden.json["meshes"].as_array_mut().unwrap().push(other);
    hidden.json["nodes"] = json!([{ "mesh": 1 }]);
    assert!(read(&hidden.glb()).is_ok());
}

#[test]
fn known_models_have_their_known_materials() {
    let folder = data::folder("models");
    have_materials(&folder, &[("BoxTextured.glb", "Texture", 1.0), ("Fox.glb", "fox_material", 0.58)]);
}

/// Each file's one material, by its name and roughness, and its picture.
fn have_materials(folder: &Path, cases: &[(&str, &str, f32)]) {
    for &(file, name, roughness) in cases {
        let mesh = read(&std::fs::read(folder.join(file)).unwrap()).unwrap();
        let slot = &mesh.materials[0];
        assert_eq!((slot.name.as_str(), slot.metallic, slot.roughness), (name, Some(0.0), Some(roughness)), "{file}");
        assert_eq!(slot.base_texture, Some(TextureRef::new(0)), "{file}");
        assert_eq!(mesh.images.len(), 1);
        let ImageContent::Encoded(bytes) = &mesh.images[0].content else { panic!("{file}: no image") };
        assert!(bytes.starts_with(b"\x89PNG"), "{file}");
        assert_eq!(mesh.cameras.len(), usize::from(file == "Duck.glb"));
    }
}

#[test]
fn large_models_have_their_known_materials() {
    let Some(folder) = data::large_folder("models") else { return };
    have_materials(&folder, &[("Duck.glb", "blinn3-fx", 1.0)]);
    // In several files; with the geometry embedded, the picture is still outside.
    let palm = folder.join("PalmTree");
    let mut json: Value = serde_json::from_slice(&std::fs::read(palm.join("PalmTree.gltf")).unwrap()).unwrap();
    let embed = |file: &str| {
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(std::fs::read(palm.join(file)).unwrap());
        json!(format!("data:application/octet-stream;base64,{data}"))
    };
    json["buffers"][0]["uri"] = embed("PalmTree.bin");
    let mesh = read(json.to_string().as_bytes()).unwrap();
    assert_eq!(
        mesh.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(),
        ["Trunk", "Leaves", "Material.001", "Water"]
    );
    let water = &mesh.materials[3];
    assert_eq!((water.emissive, water.base_texture), (Some([1.0; 3]), water.emissive_texture));
    assert_eq!(mesh.images[0].name, "image 0 (\"StylizedWater\")");
    assert_eq!((&mesh.images[0].content, codes(&mesh)), (&ImageContent::Absent, vec!["textures_missing"]));
    json["images"][0]["uri"] = embed("StylizedWater.png");
    let mesh = read(json.to_string().as_bytes()).unwrap();
    let is_there =
        |mesh: &Mesh| matches!(&mesh.images[0].content, ImageContent::Encoded(bytes) if bytes.len() == 553_110);
    assert!(is_there(&mesh));
    let file = |name: &str| BundleFile::new(name, std::fs::read(palm.join(name)).unwrap()).unwrap();
    let files = ["PalmTree.gltf", "PalmTree.bin", "StylizedWater.png"].map(file);
    assert!(is_there(&read_bundle(&Bundle::of_files(files.to_vec())).unwrap()), "from the bundle");
}
