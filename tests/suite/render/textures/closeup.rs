//! The fine levels of textures that the plan leaves out: no pixel could sample them, and as many
//! are left out as that allows.

use crate::render::textures::levels::{base, encode, model, model_of};
use crate::support::files::mesh::Noise;
use crate::support::scenes;
use image::ImageFormat;
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::plan::{Projection, SkipKind, Texture};

/// Triangles of all shapes, from anywhere: no pixel samples a level that was left out.
#[test]
fn no_pixel_reaches_below_the_first_level() {
    let picture = encode(&image::RgbImage::new(128, 128).into(), ImageFormat::Png);
    let mut noise = Noise(2024);
    let mut unit = move || (noise.next() >> 40) as f32 / (1 << 24) as f32 * 2.0 - 1.0;
    let (mut pixels, mut spared, mut closest) = (0_u64, 0, f64::INFINITY);
    for case in 0..600 {
        // Large triangles, small ones, and slivers; textures stretched or repeated.
        let (count, size) = [(1, 1.0), (4, 0.5), (60, 0.06), (40, 0.02)][case % 4];
        let repeat = [1.0, 6.0, 30.0][case / 4 % 3];
        let mut corners = Vec::new();
        let mut uvs = Vec::new();
        for _ in 0..count {
            let centre = [unit(), unit(), unit()].map(|c| c * (1.0 - size));
            let thin = if unit() > 0.5 { 0.03 } else { 1.0 };
            let edge = [unit(), unit(), unit()].map(|c| c * size);
            corners.push([
                centre,
                std::array::from_fn(|k| centre[k] + edge[k]),
                std::array::from_fn(|k| centre[k] + edge[k] * 0.4 + thin * size * unit()),
            ]);
            uvs.push([(); 3].map(|()| [unit() * repeat, unit() * repeat]));
        }
        let mesh = model(&corners, &uvs, &picture, base());
        let eye = [3.0 * unit(), 3.0 * unit(), 3.0 * unit()].map(|c| c.to_string()).join(",");
        let target = [0.3 * unit(), 0.3 * unit(), 0.3 * unit()].map(|c| c.to_string()).join(",");
        let projection = if case % 5 == 4 { "orthographic" } else { "perspective" };
        let mut keys = vec![("style", "smooth"), ("size", "48"), ("camera.projection", projection)];
        if case % 3 != 0 {
            keys.extend([("camera.eye", eye.as_str()), ("camera.target", target.as_str()), ("camera.fov_deg", "70")]);
        }
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        let first = plan.surface.as_ref().unwrap().textures.images[0].first_level;
        spared += u32::from(first > 0);
        for t in 0..mesh.triangles.len() {
            let uvs = mesh.attribute_triangles[t].map(|v| mesh.uvs[v as usize]);
            for lod in lods(mesh.triangles[t].map(|v| mesh.positions[v as usize]), uvs, &plan.projection, 128.0) {
                assert!(
                    lod >= f64::from(first),
                    "case {case}: level {lod} is needed, and {first} the first that is there"
                );
                pixels += 1;
                if first > 0 && first < 7 {
                    closest = closest.min(lod - f64::from(first));
                }
            }
        }
    }
    println!("{pixels} pixels, {spared} cases without the finest level, closest call {closest}");
    assert!(pixels > 20_000 && spared > 40 && closest < 0.5, "{pixels} {spared} {closest}");
}

/// The levels of the pixels whose centres the triangle covers, from snapped corners, in f64.
fn lods(corners: [[f32; 3]; 3], uvs: [[f32; 2]; 3], projection: &Projection, texels: f64) -> Vec<f64> {
    let row = |row: &[f32; 4], p: [f32; 3]| {
        (0..3).map(|k| f64::from(row[k]) * f64::from(p[k])).sum::<f64>() + f64::from(row[3])
    };
    let mut points = Vec::new();
    for p in corners {
        let w = row(&projection.w, p);
        if w < f64::from(projection.near_w) {
            return Vec::new();
        }
        points.push([
            (row(&projection.x, p) / w).round() / 256.0,
            (row(&projection.y, p) / w).round() / 256.0,
            1.0 / w,
        ]);
    }
    let [a, b, c] = [points[0], points[1], points[2]];
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 {
        return Vec::new();
    }
    // A function that is linear on screen: its value at the picture's centre and its slopes.
    let plane = |f: [f64; 3]| {
        let x = ((f[1] - f[0]) * (c[1] - a[1]) - (f[2] - f[0]) * (b[1] - a[1])) / area;
        let y = ((f[2] - f[0]) * (b[0] - a[0]) - (f[1] - f[0]) * (c[0] - a[0])) / area;
        [f[0] - x * a[0] - y * a[1], x, y]
    };
    let barycentric = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(plane);
    let over = [a[2], b[2], c[2]];
    let q = plane(over);
    let [u, v] = [0, 1].map(|k| plane(std::array::from_fn(|i| f64::from(uvs[i][k]) * over[i])));
    let mut out = Vec::new();
    for y in -24..24 {
        for x in -24..24 {
            let (px, py) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let at = |f: &[f64; 3]| f[0] + f[1] * px + f[2] * py;
            if barycentric.iter().any(|f| at(f) < 0.0) {
                continue;
            }
            let slope = |f: &[f64; 3], k: usize| (f[k] * at(&q) - at(f) * q[k]) / (at(&q) * at(&q)) * texels;
            out.push(level([slope(&u, 1), slope(&v, 1)], [slope(&u, 2), slope(&v, 2)]));
        }
    }
    out
}

/// The level of a pixel whose steps to the right and down are so many texels.
fn level(right: [f64; 2], down: [f64; 2]) -> f64 {
    let square = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
    let mean = 0.5 * (square(right) + square(down));
    let determinant = (right[0] * down[1] - right[1] * down[0]).abs();
    let long = (mean + (mean * mean - determinant * determinant).max(0.0).sqrt()).sqrt();
    let short = (determinant / long).max(1.0);
    // As the sampler rounds it, or a tap more.
    let taps = (long / short + 0.501).floor().min(8.0);
    if taps < 2.0 { square(right).max(square(down)).sqrt().log2() } else { (long / taps).max(short).log2() }
}

#[test]
fn fine_levels_are_kept_where_they_may_be_seen() {
    let picture = encode(&image::RgbImage::new(256, 256).into(), ImageFormat::Png);
    let mesh = model_of(&picture);
    let image = |keys: &[(&str, &str)], keep: &[SkipKind]| {
        let spec = scenes::spec(&[&[("style", "smooth"), ("camera.view", "front")], keys].concat());
        let plan = scenes::try_plan(&mesh, &spec, &Limits::default(), &Deadline::default(), keep).unwrap();
        let skipped = plan.skips.iter().any(|s| s.kind == SkipKind::FineTextureLevels);
        let textures = plan.surface.unwrap().textures;
        assert_eq!(textures.texel_count(), texels(&textures.images[0]));
        (textures.images[0].first_level, skipped)
    };
    // The side of the triangle is about nine tenths of the picture's.
    for (size, first) in [("512", 0), ("256", 0), ("128", 1), ("64", 2), ("16", 4)] {
        assert_eq!(image(&[("size", size)], &[]), (first, first > 0), "{size}");
        assert_eq!(image(&[("size", size)], &[SkipKind::FineTextureLevels]), (0, false));
    }
    // A quarter of a pixel is half as wide: of metals that mirror sharply, levels are one finer.
    for (metallic, samples, first) in [("1", "adaptive", 1), ("0", "adaptive", 2), ("1", "16", 2)] {
        let keys = [("size", "64"), ("surface.metallic", metallic), ("surface.roughness", "0.1"), ("samples", samples)];
        assert_eq!(image(&keys, &[]).0, first, "{metallic} {samples}");
    }
    // From within its plane, next to it, behind it.
    for eye in ["0.3,0.3,0", "0.3,0.3,0.0001", "0.3,-0.1,0.01"] {
        assert_eq!(image(&[("size", "64"), ("camera.eye", eye), ("camera.target", "0.3,0.4,0")], &[]).0, 0, "{eye}");
    }
}

fn texels(image: &Texture) -> u64 {
    let side = |px: u32, k: u32| u64::from((px >> k).max(1));
    (image.first_level..image.levels).map(|k| side(image.width, k) * side(image.height, k)).sum()
}
