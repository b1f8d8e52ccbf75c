//! Textured meshes that the benchmark makes itself, as GLB, and what their pixels show in truth.

use std::f64::consts::TAU;
use std::io::Cursor;

use image::{DynamicImage, GrayImage, ImageFormat};
use meshsnap_render::plan::DrawPlan;
use serde_json::json;

use crate::oracle::screen::Screen;
use crate::oracle::surface::rays::{Pen, picture};
use crate::oracle::surface::srgb;
use crate::oracle::surface::texture::Grey;
use crate::oracle::vector::{V2, V3};
use crate::support::seen::{only_triangle, scene};
use crate::support::shapes::Random;

/// Texels on a side of the texture.
const SIDE: usize = 256;

/// Corners of triangles: a position and texture coordinates.
type Corner = ([f64; 3], V2);

/// A square in the plane y = 0, as a camera above it looks along it.
pub fn floor() -> Vec<u8> {
    let corner = |x: f64, z: f64| ([12.0 * x, 0.0, 12.0 * z], [6.0 * (x + 1.0), 6.0 * (z + 1.0)]);
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    glb(&[[a, b, c], [a, c, d]])
}

/// A torus of few faces, so that most pixels show one alone.
pub fn torus() -> Vec<u8> {
    let (around, across) = (48, 24);
    let corner = |i: usize, j: usize| -> Corner {
        let (u, v) = (i as f64 / f64::from(around), j as f64 / f64::from(across));
        let ring = 1.0 + 0.45 * (TAU * v).cos();
        ([ring * (TAU * u).cos(), 0.45 * (TAU * v).sin(), -ring * (TAU * u).sin()], [8.0 * u, 3.0 * v])
    };
    let quads = (0..around as usize).flat_map(|i| (0..across as usize).map(move |j| [i, j]));
    let faces = quads.flat_map(|[i, j]| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    glb(&faces.collect::<Vec<_>>())
}

/// Encoded colours of the pixels that show one face alone, each the mean over `points` squared places; others are
/// white and do not count.
pub fn pixels(plan: &DrawPlan<'_>, points: u32) -> (Vec<Vec<f64>>, Vec<bool>) {
    let scene = scene(plan);
    let screen = Screen::new(&scene);
    let texture = Grey::new(SIDE, &tiles());
    let uvs = plan.surface.as_ref().and_then(|surface| surface.uvs.as_ref()).expect("texture coordinates");
    let places = (0..plan.height_px).flat_map(|y| (0..plan.width_px).map(move |x| [x, y]));
    let color = |pixel: [u32; 2]| {
        let triangle = only_triangle(&screen, pixel)? as usize;
        let corners = scene.triangles[triangle].map(|v| {
            let [x, y, _, w] = scene.camera.homogeneous(scene.positions[v as usize]);
            [x, y, w]
        });
        let uvs = uvs.triangles[triangle].map(|v| uvs.values[v as usize].map(f64::from));
        texture.over_pixel(pixel, points, |point| Some(place(&corners, &uvs, point)))
    };
    let colors: Vec<Option<f64>> = places.map(color).collect();
    let encoded = |color: &Option<f64>| vec![color.map_or(1.0, srgb::from_linear); 3];
    (colors.iter().map(encoded).collect(), colors.iter().map(Option::is_some).collect())
}

/// Linear colours of all pixels over white, each the mean over `points` squared places.
pub fn whole(plan: &DrawPlan<'_>, points: u32) -> Vec<V3> {
    let scene = scene(plan);
    let texture = Grey::new(SIDE, &tiles());
    let uvs = plan.surface.as_ref().and_then(|surface| surface.uvs.as_ref()).expect("texture coordinates");
    let value = |triangle: u32, point: V2| {
        let corners = scene.triangles[triangle as usize].map(|v| {
            let [x, y, _, w] = scene.camera.homogeneous(scene.positions[v as usize]);
            [x, y, w]
        });
        let uvs = uvs.triangles[triangle as usize].map(|v| uvs.values[v as usize].map(f64::from));
        [texture.at(place(&corners, &uvs, point)); 3]
    };
    let pen = Pen { segments: &[], width: 0.0, color: [0.0; 3] };
    picture(&Screen::new(&scene), &pen, [1.0; 3], points, value)
}

/// Texture coordinates at a point of the picture: the shares of the corners, whose homogeneous places are known, make
/// the point (Cramer's rule).
fn place(corners: &[V3; 3], uvs: &[V2; 3], [x, y]: V2) -> V2 {
    let determinant = |a: V3, b: V3, c: V3| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    let [a, b, c] = *corners;
    let p = [x, y, 1.0];
    let shares = [determinant(p, b, c), determinant(a, p, c), determinant(a, b, p)];
    let sum: f64 = shares.iter().sum();
    std::array::from_fn(|k| (0..3).map(|i| shares[i] / sum * uvs[i][k]).sum())
}

/// The texture, row by row: tiles of noise between dark joints.
fn tiles() -> Vec<u8> {
    let mut random = Random(13);
    let noise: Vec<u8> = (0..(SIDE / 4) * (SIDE / 4)).map(|_| random.range(0.0, 127.0) as u8).collect();
    let tile = |x: usize, y: usize| {
        if x % 64 < 6 || y % 64 < 6 { 60 } else { 120 + noise[y / 4 * (SIDE / 4) + x / 4] }
    };
    (0..SIDE * SIDE).map(|i| tile(i % SIDE, i / SIDE)).collect()
}

/// A file of triangles with the texture.
fn glb(faces: &[[Corner; 3]]) -> Vec<u8> {
    let corners = faces.as_flattened();
    let mut binary: Vec<u8> = corners.iter().flat_map(|(p, _)| p.map(|v| (v as f32).to_le_bytes())).flatten().collect();
    binary.extend(corners.iter().flat_map(|(_, uv)| uv.map(|v| (v as f32).to_le_bytes())).flatten());
    let (positions, uvs) = (12 * corners.len(), 8 * corners.len());
    let picture = DynamicImage::from(GrayImage::from_raw(SIDE as u32, SIDE as u32, tiles()).expect("a picture"));
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).expect("a PNG file");
    let png = png.into_inner();
    binary.extend(&png);
    let bound = |of: fn(f64, f64) -> f64| -> [f32; 3] {
        let all = corners.iter().map(|(p, _)| *p);
        all.reduce(|a, b| std::array::from_fn(|k| of(a[k], b[k]))).expect("a corner").map(|v| v as f32)
    };
    let document = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": binary.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": positions },
            { "buffer": 0, "byteOffset": positions, "byteLength": uvs },
            { "buffer": 0, "byteOffset": positions + uvs, "byteLength": png.len() },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": corners.len(), "type": "VEC3",
              "min": bound(f64::min), "max": bound(f64::max) },
            { "bufferView": 1, "componentType": 5126, "count": corners.len(), "type": "VEC2" },
        ],
        "images": [{ "bufferView": 2, "mimeType": "image/png" }],
        "textures": [{ "source": 0 }],
        "materials": [{ "doubleSided": true, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 }] }],
        "nodes": [{ "mesh": 0 }],
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let words = |words: [usize; 3]| words.map(|word| (word as u32).to_le_bytes()).concat();
    let all = 12 + 8 + text.len() + 8 + binary.len();
    let [of_text, of_binary] = [(text.len(), *b"JSON"), (binary.len(), *b"BIN\0")]
        .map(|(length, kind)| [(length as u32).to_le_bytes(), kind].concat());
    [words([0x4654_6c67, 2, all]), of_text, text, of_binary, binary].concat()
}
