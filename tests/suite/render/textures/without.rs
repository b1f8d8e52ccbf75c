//! Pictures that have to go without a texture: they are drawn, with a warning.

use image::{ImageFormat, RgbImage};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::material::ImageContent;
use meshsnap_render::plan::{self, Prepared, ShadedMaterial, TEXTURE_NONE};
use meshsnap_render::scene::Scene;
use meshsnap_render::warning::Warning;
use serde_json::{Value, json};

use crate::render::textures::bad::{header, png, zlib};
use crate::render::textures::levels::{encode, model, model_of};
use crate::support::files::mesh::Noise;
use crate::support::scenes;

const CORNERS: [[[f32; 3]; 3]; 1] = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
const UVS: [[[f32; 2]; 3]; 1] = [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]];

/// `#c8ccd2`.
const GREY: [f32; 3] = [0.577_580_5, 0.603_827_36, 0.644_479_7];

fn planned(mesh: &Mesh, prepared: &Prepared) -> (ShadedMaterial, Vec<Warning>) {
    let spec = scenes::spec(&[("style", "smooth"), ("size", "64")]);
    let mut budget = Budget::new(&Limits::default());
    let scene = Scene::new(mesh, &spec, &mut budget).unwrap();
    let plan = plan::build_from(&scene, prepared, &mut budget, &Deadline::default()).unwrap();
    (plan.surface.unwrap().materials[0], plan.warnings)
}

/// Images whose header is broken, whose pixels are, of an unknown format, and none at all.
fn unreadable() -> [(Option<Vec<u8>>, &'static [&'static str]); 4] {
    let good = encode(&RgbImage::new(8, 8).into(), ImageFormat::Png);
    [
        (Some(good[..20].to_vec()), &["textures_broken"]),
        (Some(png(&[(b"IHDR", &header(8, 8, 8, 2)), (b"IDAT", &zlib(&[0; 4]))])), &["textures_broken"]),
        (Some(b"GIF89a".to_vec()), &["textures_unsupported"]),
        // The import has warned.
        (None, &[]),
    ]
}

#[test]
fn a_material_goes_on_as_if_its_file_did_not_mention_the_texture() {
    let emissive = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 },
                           "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1, 1] } });
    let base = |factor: Value| json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "baseColorFactor": factor } });
    let rough = json!({ "pbrMetallicRoughness":
        { "metallicRoughnessTexture": { "index": 0 }, "roughnessFactor": 0.25, "baseColorFactor": [0.5, 0.25, 1, 1] } });
    let own = [0.5, 0.25, 1.0];
    let cases =
        [(emissive, own), (base(json!([1, 1, 1, 1])), GREY), (base(json!([0.5, 0.25, 1, 1])), own), (rough, own)];
    let mut checked = 0;
    for (material, [r, g, b]) in cases {
        for (image, codes) in unreadable() {
            let mut mesh = model(&CORNERS, &UVS, image.as_deref().unwrap_or_default(), material.clone());
            if image.is_none() {
                mesh.images[0].content = ImageContent::Absent;
            }
            // What earlier pictures found out changes nothing.
            let prepared = Prepared::default();
            for _ in 0..2 {
                let (found, warnings) = planned(&mesh, &prepared);
                assert!(found.textures.iter().all(|texture| texture.texture == TEXTURE_NONE));
                assert_eq!(found.emissive, [0.0; 3]);
                let off = [r, g, b].iter().zip(found.base_color).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(off < 1e-6, "{:?}", found.base_color);
                assert_eq!(warnings.iter().map(|warning| warning.code).collect::<Vec<_>>(), codes);
                assert!(warnings.iter().all(|w| w.detail.contains("image 0") && w.detail.contains("drawn without")));
            }
            checked += 1;
        }
    }
    assert_eq!(checked, 16);
}

#[test]
fn other_textures_stay_and_images_are_counted_once() {
    let good = encode(&RgbImage::from_pixel(8, 8, image::Rgb([9, 99, 200])).into(), ImageFormat::Png);
    let material = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } } });
    let mut mesh = model(&CORNERS, &UVS, &good, material);
    let mut broken = mesh.images[0].clone();
    broken.content = ImageContent::Encoded(png(&[(b"IHDR", &header(8, 8, 8, 2)), (b"IDAT", &zlib(&[0; 4]))]).into());
    mesh.images.push(broken);
    // Read as numbers and as colours.
    mesh.materials[0].metallic_roughness_texture.as_mut().unwrap().image = 1;
    mesh.materials[0].emissive_texture.as_mut().unwrap().image = 1;
    let prepared = Prepared::default();
    for _ in 0..2 {
        let (found, warnings) = planned(&mesh, &prepared);
        let has = found.textures.map(|texture| texture.texture != TEXTURE_NONE);
        assert_eq!((has, found.emissive), ([true, false, false, false, false], [0.0; 3]));
        let [warning] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(!warning.detail.contains("more"), "{}", warning.detail);
    }
}

/// A block of DXT1 by its definition: two colours of 5, 6 and 5 bits, and an index of 2 bits per texel.
#[test]
fn dds_is_decoded() {
    let mut dds = b"DDS ".to_vec();
    let words: [u32; 18] = [124, 0x1007, 4, 4, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    dds.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    dds.extend([32_u32, 4].iter().flat_map(|word| word.to_le_bytes()));
    dds.extend(b"DXT1");
    dds.extend([0_u32; 5].iter().flat_map(|word| word.to_le_bytes()));
    dds.extend([0x1000_u32, 0, 0, 0, 0].iter().flat_map(|word| word.to_le_bytes()));
    assert_eq!(dds.len(), 128);
    // Red and blue; the first two texels are red, the others blue.
    dds.extend([0xf800_u16.to_le_bytes(), 0x001f_u16.to_le_bytes()].concat());
    dds.extend([0b0101_0000, 0x55, 0x55, 0x55]);
    let textures = crate::render::textures::levels::textures(&model_of(&dds));
    let (one, red_and_blue) = (0x3c00, |texel: [u16; 4]| [texel[0], texel[2]]);
    let first: Vec<[u16; 2]> = textures.images[0].texels[..16].iter().map(|&texel| red_and_blue(texel)).collect();
    assert_eq!(first[..4], [[one, 0], [one, 0], [0, one], [0, one]]);
    assert!(first[4..].iter().all(|texel| *texel == [0, one]));
    // Of another kind.
    dds[84..88].copy_from_slice(b"ATI2");
    let (_, warnings) = planned(&model_of(&dds), &Prepared::default());
    assert_eq!(warnings[0].code, "textures_unsupported");
}

/// No bytes may panic, in formats whose decoders are seldom used.
#[test]
fn damaged_files_of_every_format_are_drawn_without() {
    let picture = RgbImage::from_fn(9, 7, |x, y| image::Rgb([(x * y) as u8, x as u8, y as u8]));
    let mut mapped = vec![0, 1, 9, 0, 0, 4, 0, 24, 0, 0, 0, 0, 9, 0, 7, 0, 8, 0];
    mapped.extend([7; 12]);
    mapped.extend([0x88, 1, 0x82, 3, 0x03, 0, 1, 2, 3].repeat(6));
    let mut palette = b"BM".to_vec();
    for word in [118_u32, 0, 70, 40, 4, 4, 1 << 16 | 8, 1, 30, 0, 0, 4, 0, 1, 2, 3, 4] {
        palette.extend(word.to_le_bytes());
    }
    palette.extend([4, 1, 0, 0, 4, 2, 0, 0, 0, 4, 1, 2, 3, 0, 0, 1].repeat(3));
    let files = [
        encode(&picture.clone().into(), ImageFormat::Tga),
        encode(&picture.clone().into(), ImageFormat::Bmp),
        encode(&image::DynamicImage::from(picture).to_rgba8().into(), ImageFormat::Bmp),
        mapped,
        palette,
    ];
    let mut noise = Noise(7);
    let mut outcomes = [0; 2];
    for file in &files {
        for round in 0..400 {
            let mut bytes = file.clone();
            for _ in 0..round % 4 {
                let at = noise.next() as usize % bytes.len();
                bytes[at] = noise.next() as u8;
            }
            if round % 5 == 4 {
                bytes.truncate(noise.next() as usize % bytes.len());
            }
            let spec = scenes::spec(&[("style", "smooth"), ("size", "16")]);
            // Sizes beyond the limits are refused.
            let limits = Limits::default().with(|limits| limits.texture_px = 256);
            let mesh = model_of(&bytes);
            if let Ok(plan) = scenes::try_plan(&mesh, &spec, &limits, &Deadline::default(), &[]) {
                outcomes[usize::from(plan.warnings.is_empty())] += 1;
            }
        }
    }
    assert!(outcomes.iter().all(|&count| count > 300), "{outcomes:?}");
}
