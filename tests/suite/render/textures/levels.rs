//! From images to textures: every pixel format and every level, against definitions in f64. Also
//! the helpers with which the other tests of textures make their models.

use std::io::Cursor;

use crate::render::textures::bad::{header, png, zlib};
use crate::support::files::mesh::{Gltf, Noise, read};
use crate::support::scenes;
use image::{DynamicImage, ImageFormat};
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{DrawPlan, PlanError, SkipKind, TEXTURE_NONE, Texture, Textures, slots};
use serde_json::{Value, json};

/// Triangles with texture coordinates, and one material with one image that repeats.
pub fn model(corners: &[[[f32; 3]; 3]], uvs: &[[[f32; 2]; 3]], image: &[u8], material: Value) -> Mesh {
    sampled_model(corners, uvs, image, [material, json!({})])
}

/// The same with this material and this sampler.
pub fn sampled_model(
    corners: &[[[f32; 3]; 3]],
    uvs: &[[[f32; 2]; 3]],
    image: &[u8],
    [material, sampler]: [Value; 2],
) -> Mesh {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", corners.as_flattened().as_flattened());
    let t = gltf.floats("VEC2", uvs.as_flattened().as_flattened());
    gltf.mesh(json!({ "attributes": { "POSITION": p, "TEXCOORD_0": t }, "material": 0 }));
    let view = gltf.view(image);
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    // A word for it that is a lie.
    gltf.json["images"] = json!([{ "bufferView": view, "mimeType": "image/vnd.radiance" }]);
    gltf.json["samplers"] = json!([sampler]);
    gltf.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    gltf.json["materials"] = json!([material]);
    read(&gltf.glb()).unwrap().mesh
}

pub fn base() -> Value {
    json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } })
}

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const UVS: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

pub fn model_of(image: &[u8]) -> Mesh {
    model(&[TRIANGLE], &[UVS], image, base())
}

pub fn encode(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    image.write_to(&mut out, format).unwrap();
    out.into_inner()
}

pub fn plan_of<'a>(mesh: &'a Mesh, keep: &[SkipKind], limits: &Limits) -> Result<DrawPlan<'a>, PlanError> {
    scenes::try_plan(mesh, &scenes::spec(&[("style", "smooth"), ("size", "64")]), limits, &Deadline::default(), keep)
}

/// All levels of the textures.
pub fn textures(mesh: &Mesh) -> Textures {
    plan_of(mesh, &[SkipKind::FineTextureLevels], &Limits::default())
        .unwrap()
        .surface
        .unwrap()
        .textures
        .as_ref()
        .clone()
}

pub fn error(mesh: &Mesh) -> PlanError {
    plan_of(mesh, &[], &Limits::default()).unwrap_err()
}

/// The warning of a picture that goes without the mesh's texture.
pub fn warning(mesh: &Mesh) -> String {
    let plan = plan_of(mesh, &[], &Limits::default()).unwrap();
    let surface = plan.surface.unwrap();
    assert!(surface.materials.iter().all(|material| material.textures.iter().all(|t| t.texture == TEXTURE_NONE)));
    let [warning] = &plan.warnings[..] else { panic!("{:?}", plan.warnings) };
    assert!(["textures_broken", "textures_unsupported"].contains(&warning.code), "{}", warning.code);
    warning.detail.clone()
}

pub fn value(half: u16) -> f64 {
    let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 1023));
    assert!(half < 0x7c00, "neither negative nor infinite");
    if exponent == 0 { fraction * 2.0_f64.powi(-24) } else { (1.0 + fraction / 1024.0) * 2.0_f64.powi(exponent - 15) }
}

fn linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

pub fn noise(width: u32, height: u32, channels: usize, seed: u64) -> Vec<u8> {
    let mut bytes = Noise(seed).bytes((width * height) as usize * channels);
    // Some texels without any alpha, and whole blocks of them.
    if channels == 4 {
        for (i, pixel) in bytes.chunks_exact_mut(4).enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            if pixel[3] < 64 || (x < width / 2 && y < height / 2) {
                pixel[3] = 0;
            }
        }
    }
    bytes
}

/// The levels by their definition, in f64: overlaps of squares, colours weighted by alpha.
fn levels(width: u32, height: u32, first: Vec<[f64; 4]>, weigh: bool) -> Vec<Vec<[f64; 4]>> {
    let mut all = vec![first];
    let (mut w, mut h) = (width, height);
    while w > 1 || h > 1 {
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let last = &all[all.len() - 1];
        let overlap = |a: u32, n: u32, b: u32, m: u32| {
            let (scale, a, b) = (f64::from(m) / f64::from(n), f64::from(a), f64::from(b));
            ((a + 1.0) * scale).min(b + 1.0) - (a * scale).max(b)
        };
        let mut next = Vec::new();
        for y in 0..nh {
            for x in 0..nw {
                let (mut plain, mut weighted, mut area) = ([0.0; 3], [0.0; 4], 0.0);
                for sy in 0..h {
                    for sx in 0..w {
                        let part = overlap(x, nw, sx, w).max(0.0) * overlap(y, nh, sy, h).max(0.0);
                        let texel = last[(sy * w + sx) as usize];
                        area += part;
                        weighted[3] += part * texel[3];
                        for k in 0..3 {
                            plain[k] += part * texel[k];
                            weighted[k] += part * texel[3] * texel[k];
                        }
                    }
                }
                let [r, g, b] = plain.map(|v| v / area);
                next.push(if weigh && weighted[3] > 0.0 {
                    let [r, g, b, a] = weighted;
                    [r / a, g / a, b / a, a / area]
                } else {
                    [r, g, b, weighted[3] / area]
                });
            }
        }
        all.push(next);
        (w, h) = (nw, nh);
    }
    all
}

fn assert_levels(image: &Texture, expected: &[Vec<[f64; 4]>], name: &str) {
    assert_eq!((image.first_level, image.levels as usize), (0, expected.len()), "{name}");
    assert_eq!(image.texels.len(), expected.iter().map(Vec::len).sum::<usize>(), "{name}");
    for (got, want) in image.texels.iter().zip(expected.iter().flatten()) {
        for (got, want) in got.iter().zip(want) {
            let off = (value(*got) - want).abs();
            assert!(
                off <= want * 2.0_f64.powi(-11) * 1.01 + 2.0_f64.powi(-25) * 1.01,
                "{name}: {} is not {want}",
                value(*got)
            );
        }
    }
}

#[test]
fn every_level_is_the_mean_of_what_it_covers() {
    let sizes = [(1, 1), (2, 2), (16, 1), (1, 7), (13, 7), (5, 5), (32, 24), (31, 33)];
    let mut cases = 0;
    for (width, height) in sizes {
        for channels in [3, 4] {
            let bytes = noise(width, height, channels, 7 + u64::from(width));
            let pixels = bytes.chunks_exact(channels).map(|p| [p[0], p[1], p[2], *p.get(3).unwrap_or(&255)]);
            let pixels: Vec<[f64; 4]> = pixels.map(|p| p.map(|v| f64::from(v) / 255.0)).collect();
            let picture: DynamicImage = if channels == 3 {
                image::RgbImage::from_raw(width, height, bytes).unwrap().into()
            } else {
                image::RgbaImage::from_raw(width, height, bytes).unwrap().into()
            };
            // Read as colour and as data.
            let material = json!({ "pbrMetallicRoughness":
                { "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } } });
            let mesh = model(&[TRIANGLE], &[UVS], &encode(&picture, ImageFormat::Png), material);
            let textures = textures(&mesh);
            let [color, data] = &textures.images[..] else { panic!("{} textures", textures.images.len()) };
            assert_eq!((color.width, color.height), (width, height));
            let lit = pixels.iter().map(|&[r, g, b, a]| [linear(r), linear(g), linear(b), a]).collect();
            let name = format!("{width}x{height}x{channels}");
            assert_levels(color, &levels(width, height, lit, channels == 4), &name);
            assert_levels(data, &levels(width, height, pixels, false), &name);
            cases += 1;
        }
    }
    assert_eq!(cases, 16);
}

#[test]
fn every_kind_of_pixel_and_file() {
    let rgba = image::RgbaImage::from_raw(9, 6, noise(9, 6, 4, 3)).unwrap();
    let picture = DynamicImage::from(rgba);
    let kinds = [
        (DynamicImage::from(picture.to_luma8()), ImageFormat::Png),
        (picture.to_luma_alpha8().into(), ImageFormat::Png),
        (picture.to_rgb8().into(), ImageFormat::Png),
        (picture.to_luma16().into(), ImageFormat::Png),
        (picture.to_luma_alpha16().into(), ImageFormat::Png),
        (picture.to_rgb16().into(), ImageFormat::Png),
        (picture.to_rgba16().into(), ImageFormat::Png),
        (picture.to_rgb8().into(), ImageFormat::WebP),
        (picture.clone(), ImageFormat::WebP),
        (picture.to_luma8().into(), ImageFormat::Tga),
        (picture.to_luma_alpha8().into(), ImageFormat::Tga),
        (picture.to_rgb8().into(), ImageFormat::Tga),
        (picture.clone(), ImageFormat::Tga),
        (picture.to_luma8().into(), ImageFormat::Bmp),
        (picture.to_rgb8().into(), ImageFormat::Bmp),
        (picture.clone(), ImageFormat::Bmp),
    ];
    for (picture, format) in &kinds {
        let textures = textures(&model_of(&encode(picture, *format)));
        let wide = picture.to_rgba32f();
        let expected: Vec<[f64; 4]> = wide.pixels().map(|p| p.0.map(f64::from)).collect();
        let texels = &textures.images[0].texels[..54];
        for (texel, [r, g, b, a]) in texels.iter().zip(expected) {
            for (got, want) in texel.iter().zip([linear(r), linear(g), linear(b), a]) {
                assert!(
                    (value(*got) - want).abs() < 1e-3,
                    "{:?} {format:?}: {} is not {want}",
                    picture.color(),
                    value(*got)
                );
            }
        }
    }
    assert_eq!(kinds.len(), 16);
    // A palette, by hand: two colours.
    let palette =
        png(&[(b"IHDR", &header(2, 1, 1, 3)), (b"PLTE", &[255, 0, 0, 0, 255, 0]), (b"IDAT", &zlib(&[0, 0b0100_0000]))]);
    let texels = textures(&model_of(&palette)).images.remove(0).texels;
    assert_eq!(texels[..2], [[0x3c00, 0, 0, 0x3c00], [0, 0x3c00, 0, 0x3c00]]);
    // JPEG loses something, and grey stays grey.
    let grey = image::GrayImage::from_pixel(16, 16, image::Luma([188]));
    for picture in [DynamicImage::from(grey.clone()), DynamicImage::from(DynamicImage::from(grey).to_rgb8())] {
        let texels = textures(&model_of(&encode(&picture, ImageFormat::Jpeg))).images.remove(0).texels;
        assert!(texels.iter().all(|t| (value(t[0]) - 0.503).abs() < 0.01 && t[3] == 0x3c00), "{:?}", texels[0]);
    }
}

/// An image of a material that no triangle has is not looked at, and the others keep their places.
#[test]
fn materials_without_triangles_load_nothing() {
    let picture = encode(&image::RgbImage::new(4, 4).into(), ImageFormat::Png);
    let mut mesh = model_of(&picture);
    let slot = mesh.materials[0].clone();
    mesh.materials.insert(0, slot);
    mesh.triangle_materials.fill(1);
    let mut broken = mesh.materials[0].base_texture.unwrap();
    broken.image = mesh.images.len() as u32;
    mesh.materials[0].base_texture = Some(broken);
    let mut image = mesh.images[0].clone();
    image.content = meshsnap_render::mesh::material::ImageContent::Encoded(b"lost"[..].into());
    mesh.images.push(image);
    let surface = plan_of(&mesh, &[], &Limits::default()).unwrap().surface.unwrap();
    assert_eq!(surface.materials.len(), 2);
    let places = [0, 1].map(|m| surface.materials[m].textures[slots::BASE].texture);
    assert_eq!((places, surface.textures.images.len()), ([TEXTURE_NONE, 0], 1));
    mesh.triangle_materials.fill(0);
    assert!(warning(&mesh).contains("image 0"), "{}", warning(&mesh));
}

#[test]
fn a_stopped_job_decodes_nothing_more() {
    let picture = encode(&image::RgbImage::new(4, 4).into(), ImageFormat::Png);
    let (mesh, deadline) = (model_of(&picture), Deadline::default());
    deadline.stop();
    let spec = scenes::spec(&[("style", "smooth"), ("size", "64")]);
    let plan = scenes::try_plan(&mesh, &spec, &Limits::default(), &deadline, &[]);
    assert!(matches!(plan, Err(PlanError::Stopped(_))));
}

/// Images are decoded together where the budget has room for it, and else one after the other, in
/// the same memory and with the same texels.
#[test]
fn a_small_budget_decodes_one_after_the_other() {
    let side = 256;
    let picture = image::RgbImage::from_raw(side, side, noise(side, side, 3, 8)).unwrap();
    let picture = encode(&picture.into(), ImageFormat::Png);
    let alone = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 } });
    let mut both = alone.clone();
    both["normalTexture"] = json!({ "index": 0 });
    let least = |material: &Value| {
        let mesh = model(&[TRIANGLE], &[UVS], &picture, material.clone());
        let keep = [SkipKind::FineTextureLevels];
        let plan =
            |memory_bytes| plan_of(&mesh, &keep, &Limits::default().with(|limits| limits.memory_bytes = memory_bytes));
        let (mut low, mut high) = (0, 1 << 30);
        while low + 1 < high {
            let middle = (low + high) / 2;
            if plan(middle).is_ok() { high = middle } else { low = middle }
        }
        let texels = |memory_bytes| {
            let textures = plan(memory_bytes).unwrap().surface.unwrap().textures;
            textures.images.iter().flat_map(|image| image.texels.to_vec()).collect::<Vec<_>>()
        };
        assert_eq!(texels(high), texels(1 << 30));
        (high, texels(high).len())
    };
    let ((one_bytes, one_texels), (two_bytes, two_texels)) = (least(&alone), least(&both));
    assert_eq!(two_texels, 2 * one_texels);
    // Decoding takes more than this beside the texels.
    let decoding_bytes = u64::from(side * side) * 3;
    assert!(two_bytes - one_bytes < 8 * one_texels as u64 + decoding_bytes / 2, "{one_bytes} {two_bytes}");
}

#[test]
fn uses_are_written_as_the_shaders_read_them() {
    let picture = encode(&image::RgbImage::new(4, 4).into(), ImageFormat::Png);
    let material = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 },
        "normalTexture": { "index": 0 }, "occlusionTexture": { "index": 0, "strength": 0.25 }, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0,
        "extensions": { "KHR_texture_transform": { "offset": [0.25, 0.5], "scale": [2, 3] } } } } });
    let mesh = model(&[TRIANGLE], &[UVS], &picture, material);
    let plan = plan_of(&mesh, &[], &Limits::default()).unwrap();
    let surface = plan.surface.unwrap();
    let uses = surface.materials[0].textures;
    assert_eq!(uses.map(|u| u.texture), [0, TEXTURE_NONE, 1, 0, 1], "once as colour and once as data");
    assert_eq!(surface.materials[0].occlusion_texture_strength, 0.25);
    assert_eq!(uses[slots::BASE].transform, [[2.0, 0.0, 0.25], [0.0, 3.0, 0.5]]);
    assert_eq!((uses[slots::BASE].sampler, surface.textures.images.len()), (0, 2));
    // Without texture coordinates there is nothing to sample with.
    let mut bare = mesh.clone();
    bare.uvs.clear();
    let surface = plan_of(&bare, &[], &Limits::default()).unwrap().surface.unwrap();
    assert!(surface.materials[0].textures.iter().all(|u| u.texture == TEXTURE_NONE));
    assert!(surface.textures.images.is_empty());
}
