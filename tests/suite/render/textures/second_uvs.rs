//! Textures of one material that follow different sets of texture coordinates.

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use serde_json::{Value, json};

use crate::render::textures::levels::encode;
use crate::support::files::mesh::{Gltf, Read, codes, read};
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;

/// A square that faces the viewer. Its first texture is white; the second changes from left to right and
/// from top to bottom. The first set of texture coordinates is one point of the image, the second all of it.
fn square(material: &Value, other_sets: usize) -> Read {
    let pattern = RgbImage::from_fn(64, 64, |x, y| Rgb([(4 * x) as u8, (4 * y) as u8, (2 * (x + y)) as u8]));
    let white = RgbImage::from_pixel(8, 8, Rgb([255; 3]));
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let point = gltf.floats("VEC2", &[0.5; 8]);
    let all = gltf.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let indices = gltf.shorts("SCALAR", &[0, 1, 2, 0, 2, 3]);
    let mut attributes = json!({ "POSITION": p, "TEXCOORD_0": point, "TEXCOORD_1": all });
    for set in 0..other_sets {
        attributes[format!("TEXCOORD_{}", 2 + set)] = json!(all);
    }
    gltf.mesh(json!({ "attributes": attributes, "indices": indices, "material": 0 }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    let views = [white, pattern].map(|image| gltf.view(&encode(&DynamicImage::ImageRgb8(image), ImageFormat::Png)));
    gltf.json["images"] = views.iter().map(|view| json!({ "bufferView": view, "mimeType": "image/png" })).collect();
    gltf.json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    gltf.json["materials"] = json!([material]);
    read(&gltf.glb()).unwrap()
}

fn draw(mesh: &Read) -> Image {
    let spec = scenes::spec(&[("view", "front"), ("size", "96"), ("style", "smooth")]);
    let plan = scenes::plan(mesh, &spec);
    let picture = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
    if let Some(gpus) = gpus() {
        let other = GpuRenderer::new(gpus[0].clone()).draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&picture, &other).assert(Tolerance::TWINS, "second coordinates");
    }
    picture
}

/// A material whose texture in `place` is the pattern, by the second set, alone or beside a white base colour
/// by the first one.
fn material(place: &str, with_base: bool) -> Value {
    let mut material = json!({ "pbrMetallicRoughness": {} });
    let pattern = json!({ "index": 1, "texCoord": 1 });
    match place {
        "metallicRoughnessTexture" => {
            // So dark that highlights show on it.
            material["pbrMetallicRoughness"] = json!({ place: pattern, "baseColorFactor": [0.4, 0.4, 0.4, 1] });
        }
        "emissiveTexture" => {
            material[place] = pattern;
            material["emissiveFactor"] = json!([0.5, 0.5, 0.5]);
        }
        // It is not for metals.
        "occlusionTexture" => {
            material[place] = pattern;
            material["pbrMetallicRoughness"] = json!({ "metallicFactor": 0, "baseColorFactor": [0.4, 0.4, 0.4, 1] });
        }
        _ => material[place] = pattern,
    }
    if with_base {
        material["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    }
    material
}

#[test]
fn each_texture_follows_its_own_coordinates() {
    let places = ["metallicRoughnessTexture", "normalTexture", "emissiveTexture", "occlusionTexture"];
    for place in places {
        let alone = draw(&square(&material(place, false), 0));
        let both = square(&material(place, true), 0);
        assert!(codes(&both).is_empty() && both.mesh.second_uvs.len() == both.mesh.uvs.len(), "{place}");
        let both = draw(&both);
        assert!(alone == both, "{place}: the white base colour by other coordinates changes the picture");
        let colors = both.rgba.chunks(4).collect::<std::collections::HashSet<_>>();
        assert!(colors.len() > 20, "{place}: {} colours, as if it lay at one point", colors.len());
    }
}

#[test]
fn a_third_set_is_drawn_with_the_first_and_said() {
    let mut third = material("emissiveTexture", true);
    third["normalTexture"] = json!({ "index": 0, "texCoord": 2 });
    let mesh = square(&third, 1);
    assert_eq!(codes(&mesh), ["uv_sets_differ"]);
    let of = &mesh.materials[0];
    let follows_second = [of.base_texture, of.normal_texture, of.emissive_texture].map(|t| t.unwrap().is_second_uvs);
    // The normal texture comes before the emission.
    assert_eq!(follows_second, [false, true, false]);
}

#[test]
fn missing_second_coordinates_leave_the_texture_out() {
    let mut absent = material("emissiveTexture", true);
    absent["emissiveTexture"]["texCoord"] = json!(7);
    let mesh = square(&absent, 0);
    assert_eq!(codes(&mesh), ["uvs_missing"]);
    assert!(mesh.second_uvs.is_empty());
    let mut without = material("emissiveTexture", true);
    without.as_object_mut().unwrap().remove("emissiveTexture");
    // An emission whose texture has no place is none, as where an image is missing.
    without["emissiveFactor"] = json!([0, 0, 0]);
    assert!(draw(&mesh) == draw(&square(&without, 0)));
}
