//! Textures that are seen from near, wrapped in different ways; cut-out masks; normal maps: each against the mean over
//! each pixel of what its points show.

use image::{DynamicImage, GrayImage, ImageFormat, RgbImage, RgbaImage};
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use serde_json::{Value, json};

use super::{HEIGHT, View, WIDTH, draw, rmse};
use crate::oracle::surface::light::lit;
use crate::oracle::surface::srgb;
use crate::oracle::surface::texture::{Grey, Wrap, over_pixel};
use crate::oracle::vector::unit;
use crate::render::textures::levels::{base, encode, sampled_model};
use crate::support::files::mesh::Noise;
use crate::support::scenes;
use crate::support::seen::{lights, material};
use crate::support::truth::{cases, renderers};

/// Texels on a side of the textures.
const SIDE: usize = 32;

/// A square in the plane y = 0, from -1 to 1.
#[derive(Clone, Copy)]
struct Floor {
    /// Texture coordinate at -1.
    first: f64,
    /// Repetitions of the texture from -1 to 1.
    repeats: f64,
}

impl Floor {
    /// The texture coordinates of a point of the picture; None beside the floor.
    fn place(self, view: &View, point: [f64; 2]) -> Option<[f64; 2]> {
        let at = view.floor_at(point).filter(|at| at.iter().all(|v| v.abs() < 1.0))?;
        Some(at.map(|v| self.first + (v + 1.0) / 2.0 * self.repeats))
    }

    fn mesh(self, picture: &[u8], material: Value, wrap: Wrap) -> Mesh {
        let [low, high] = [self.first as f32, (self.first + self.repeats) as f32];
        let corners = [[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]];
        let uvs = [[low, low], [low, high], [high, high], [high, low]];
        let faces = [[0, 1, 2], [0, 2, 3]];
        let mode = match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        };
        let (corners, uvs) = (faces.map(|face| face.map(|v| corners[v])), faces.map(|face| face.map(|v| uvs[v])));
        sampled_model(&corners, &uvs, picture, [material, json!({ "wrapS": mode, "wrapT": mode })])
    }

    /// The pixels that show nothing but the floor, with what `value` says of them; `side` is the longer side of their
    /// footprint, texels.
    fn pixels(self, view: &View, value: impl Fn([u32; 2]) -> Option<f64>) -> Vec<Pixel> {
        let all = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| [x, y]));
        all.filter_map(|at| {
            let place = |dx: f64, dy: f64| self.place(view, [f64::from(at[0]) + dx, f64::from(at[1]) + dy]);
            let ends = [[place(0.0, 0.5)?, place(1.0, 0.5)?], [place(0.5, 0.0)?, place(0.5, 1.0)?]];
            let side = ends.map(|[a, b]| (b[0] - a[0]).hypot(b[1] - a[1]) * SIDE as f64);
            Some(Pixel { at, side: side[0].max(side[1]), truth: 255.0 * srgb::from_linear(value(at)?) })
        })
        .collect()
    }
}

struct Pixel {
    at: [u32; 2],
    side: f64,
    /// Encoded.
    truth: f64,
}

/// The texture coordinates in the middle of a pixel of the near floor.
fn mid(floor: Floor, pixel: &Pixel) -> [f64; 2] {
    floor.place(&NEAR, pixel.at.map(|v| f64::from(v) + 0.5)).unwrap()
}

/// The error of those pixels for which `counts` is true, and their number.
fn error(pixels: &[Pixel], image: &meshsnap_render::image::Image, counts: impl Fn(&Pixel) -> bool) -> (f64, usize) {
    let chosen: Vec<&Pixel> = pixels.iter().filter(|pixel| counts(pixel)).collect();
    let of = |pixel: &&Pixel| f64::from(image.pixel(pixel.at[0], pixel.at[1])[0]) - pixel.truth;
    (rmse(chosen.iter().map(of)), chosen.len())
}

fn checker(dark: u8, bright: u8) -> Vec<u8> {
    (0..SIDE * SIDE).map(|i| if (i % SIDE / 4 + i / SIDE / 4).is_multiple_of(2) { bright } else { dark }).collect()
}

/// From so near that most pixels show less than a texel.
const NEAR: View = View { eye: [0.1, 0.6, 0.5], target: [0.0, 0.0, -0.05] };

/// From so far, and so low, that pixels show several texels.
const FAR: View = View { eye: [0.3, 0.5, 1.4], target: [0.0, 0.0, 0.0] };

/// Error of magnified textures now, as a share of bilinear filtering's.
const MAGNIFIED_NOW: f64 = 1.02;

#[test]
fn magnified_textures_err_no_more_than_bilinear_however_they_wrap() {
    let floor = Floor { first: -0.95, repeats: 3.0 };
    let (mut drawn, mut missed) = (0, Vec::new());
    let mut renderers = renderers();
    for (name, bytes) in [("checker", checker(40, 230)), ("noise", Noise(7).bytes(SIDE * SIDE))] {
        let picture = GrayImage::from_raw(SIDE as u32, SIDE as u32, bytes.clone()).unwrap();
        let picture = encode(&DynamicImage::from(picture), ImageFormat::Png);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let texture = Grey::new(SIDE, &bytes).wrapped(wrap);
            let mean = |at, points| texture.over_pixel(at, points, |point| floor.place(&NEAR, point));
            let pixels = floor.pixels(&NEAR, |at| mean(at, cases(16, 48)));
            // Bilinear filtering takes one point.
            let beyond = |axis: usize, is_upper: bool| {
                let places = pixels.iter().filter(|pixel| pixel.side < 1.0).map(|pixel| mid(floor, pixel)[axis]);
                places.filter(|at| if is_upper { *at > 1.0 } else { *at < 0.0 }).count()
            };
            let counts = [beyond(0, false), beyond(0, true), beyond(1, false), beyond(1, true)];
            assert!(counts.iter().all(|count| *count > 500), "pixels beyond each border: {counts:?}");
            let of_one = |pixel: &Pixel| 255.0 * srgb::from_linear(mean(pixel.at, 1).unwrap()) - pixel.truth;
            let before = rmse(pixels.iter().filter(|pixel| pixel.side < 1.0).map(of_one));
            let mesh = floor.mesh(&picture, base(), wrap);
            for renderer in &mut renderers {
                let image = draw(&mesh, &NEAR, &[("style", "unlit"), ("samples", "1")], renderer.as_mut());
                let (now, count) = error(&pixels, &image, |pixel| pixel.side < 1.0);
                let what = format!("{name} {wrap:?}, {}", renderer.kind().name());
                println!("- {what:<20} RMSE {now:.2}, bilinear {before:.2}, of {count} pixels");
                assert!(count > 10_000, "{count}");
                if now > MAGNIFIED_NOW * before {
                    missed.push(format!("{what}: {now}, bilinear {before}"));
                }
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, 6 * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Error of pictures of cut-out masks now, near and far. Each pixel has one share of a face that is drawn, so that more
/// samples do not help.
const MASKS_NOW: [f64; 2] = [3.6, 5.1];

#[test]
fn cut_out_masks_err_no_more_than_now() {
    let floor = Floor { first: 0.0, repeats: 2.0 };
    let opacity: Vec<u8> = (0..SIDE * SIDE).map(|i| disc(i % SIDE, i / SIDE)).collect();
    let texels = opacity.iter().flat_map(|&alpha| [0, 0, 0, alpha]).collect();
    let picture = DynamicImage::from(RgbaImage::from_raw(SIDE as u32, SIDE as u32, texels).unwrap());
    let mut material = base();
    material["alphaMode"] = json!("MASK");
    let mesh = floor.mesh(&encode(&picture, ImageFormat::Png), material, Wrap::Repeat);
    let texture = Grey::linear(SIDE, &opacity);
    let mut renderers = renderers();
    let (mut drawn, mut missed) = (0, Vec::new());
    for (view_name, view, gate) in [("near", NEAR, MASKS_NOW[0]), ("far", FAR, MASKS_NOW[1])] {
        // Black where it shows, white behind it.
        let shown = |point| floor.place(&view, point).map(|at| if texture.at(at) >= 0.5 { 0.0 } else { 1.0 });
        let pixels = floor.pixels(&view, |at| over_pixel(at, cases(16, 48), shown));
        for samples in ["1", "4", "16"] {
            for renderer in &mut renderers {
                let look = [("style", "unlit"), ("samples", samples), ("background", "fff")];
                let image = draw(&mesh, &view, &look, renderer.as_mut());
                let (now, count) = error(&pixels, &image, |_| true);
                println!("- {view_name}, {samples} samples, {}: RMSE {now:.2} of {count}", renderer.kind().name());
                assert!(count > 5_000, "{count}");
                if now > gate {
                    missed.push(format!("{view_name}, {samples} samples: {now}"));
                }
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, 2 * 3 * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Opacity that falls from the middle of the texture to its borders.
fn disc(x: usize, y: usize) -> u8 {
    let [dx, dy] = [x, y].map(|v| v as f64 + 0.5 - SIDE as f64 / 2.0);
    (255.0 * (1.5 - dx.hypot(dy) / 10.0).clamp(0.0, 1.0)) as u8
}

/// Roughness, and the error of pictures of normal maps now, near and far. Bytes alone err by 0.29.
const NORMAL_MAPS_NOW: [(f64, [f64; 2]); 2] = [(0.8, [0.45, 1.4]), (0.3, [1.2, 1.4])];

#[test]
fn normal_maps_err_no_more_than_now() {
    let floor = Floor { first: 0.0, repeats: 3.0 };
    let bytes: Vec<[u8; 3]> = (0..SIDE * SIDE).map(|i| bump(i % SIDE, i / SIDE)).collect();
    let picture = DynamicImage::from(RgbImage::from_raw(SIDE as u32, SIDE as u32, bytes.concat()).unwrap());
    let axes = [0, 1, 2].map(|k| Grey::linear(SIDE, &bytes.iter().map(|texel| texel[k]).collect::<Vec<_>>()));
    let mut renderers = renderers();
    let (mut drawn, mut missed) = (0, Vec::new());
    for (roughness, gates) in NORMAL_MAPS_NOW {
        let bumpy = json!({
            "normalTexture": { "index": 0 },
            "pbrMetallicRoughness":
                { "baseColorFactor": [0.4, 0.4, 0.4, 1], "metallicFactor": 0, "roughnessFactor": roughness },
        });
        let mesh = floor.mesh(&encode(&picture, ImageFormat::Png), bumpy, Wrap::Repeat);
        for (view_name, view, gate) in [("near", NEAR, gates[0]), ("far", FAR, gates[1])] {
            let look = [("style", "smooth"), ("samples", "1"), ("light.ambient_occlusion", "0")];
            let spec = view.spec(&look);
            let plan = scenes::plan(&mesh, &spec);
            let (material, lights) = (material(plan.surface.as_ref().unwrap()), lights(&plan));
            let color = |point| {
                let at = floor.place(&view, point)?;
                let [x, y, z] = [0, 1, 2].map(|k| 2.0 * axes[k].at(at) - 1.0);
                // The texture's right is x, its up is -z, and it lies on y = 0.
                Some(lit(&material, &lights, unit([x, z, -y]))[0])
            };
            let pixels = floor.pixels(&view, |at| over_pixel(at, cases(12, 32), color));
            for renderer in &mut renderers {
                let image = renderer.draw(&plan, &Deadline::default()).unwrap();
                let (now, count) = error(&pixels, &image, |_| true);
                println!("- roughness {roughness}, {view_name}, {}: RMSE {now:.2} of {count}", renderer.kind().name());
                assert!(count > 5_000, "{count}");
                if now > gate {
                    missed.push(format!("roughness {roughness}, {view_name}: {now}"));
                }
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, 4 * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// The normal of a ball in the middle of the texture, and straight up beside it.
fn bump(x: usize, y: usize) -> [u8; 3] {
    let [dx, dy] = [x, y].map(|v| (v as f64 + 0.5 - SIDE as f64 / 2.0) / 16.0);
    let n = if dx.hypot(dy) < 0.8 { unit([dx, -dy, 0.9]) } else { [0.0, 0.0, 1.0] };
    n.map(|v| ((v + 1.0) / 2.0 * 255.0).round() as u8)
}
