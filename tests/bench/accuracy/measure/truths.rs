//! The truth of a scene, and a picture's distance from it.

use meshsnap_render::image::Image;
use meshsnap_render::plan::DrawPlan;

use super::techniques::{Family, Technique};
use super::textured;
use crate::oracle::flip::Seen;
use crate::oracle::lines::coverage::ink;
use crate::oracle::screen::{Screen, is_front};
use crate::oracle::surface::light::{face_normal, lit};
use crate::oracle::vector::{V3, sub};
use crate::oracle::{lines::silhouette, surface::srgb};
use crate::support::seen::{lights, material, only_triangle, scene, segments, whole_picture};

/// A picture as it should be.
pub struct Truth {
    width: usize,
    /// A pixel's values, 0 to 1: the coverage by lines, or encoded red, green and blue.
    pixels: Vec<Vec<f64>>,
    /// For each pixel, true if it is compared.
    counts: Vec<bool>,
    kind: Kind,
    seen: Seen,
}

/// A drawn picture's coverage or colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Alpha is coverage.
    Alpha,
    /// White on black: linear light is coverage.
    WhiteOnBlack,
    Color,
}

/// The distance of a picture from the truth.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// Root of the mean square over the pixels that either touches, /255.
    pub rmse: f64,
    /// The largest, /255.
    pub max: f64,
    /// Mean LDR-FLIP of the whole picture; lines black on white.
    pub flip: f64,
    /// Coverage that is drawn as a share of what should be; of lines alone.
    pub ink: Option<f64>,
    /// Pixels that count.
    pub pixels: usize,
}

/// The distance of two back-ends' pictures from each other.
#[derive(Clone, Copy, Debug)]
pub struct Apart {
    /// Share of pixels that differ at all.
    pub share: f64,
    /// The largest difference, /255, of colours times their alpha: of what is hardly there the
    /// colour says nothing.
    pub max: u8,
    pub flip: f64,
}

impl Truth {
    /// Of a technique's scene. `lines` is a plan whose line pass has the wanted width: of exact
    /// wires, or of a contour; for faces and textures, the technique's own plan.
    pub fn new(family: Family, technique: Technique, lines: &DrawPlan<'_>, width_px: f64, points: u32) -> Self {
        let size = [lines.width_px, lines.height_px];
        let (kind, pixels, counts) = match (family, technique) {
            (Family::Faces, _) => {
                let (pixels, counts) = whole_pixels(lines);
                (Kind::Color, pixels, counts)
            }
            (Family::Textures, _) => {
                let (pixels, counts) = textured::pixels(lines, points);
                (Kind::Color, pixels, Some(counts))
            }
            (Family::Pictures | Family::Whole, _) => {
                let linear = whole_picture(lines, technique == Technique::SmoothFaces, points);
                (Kind::Color, encoded(linear), None)
            }
            (Family::WholeTextures, _) => (Kind::Color, encoded(textured::whole(lines, points)), None),
            (_, Technique::Hull) => {
                let scene = scene(lines);
                let screen = Screen::new(&scene);
                let ink = silhouette::ink(&screen, &silhouette::rims(&scene, width_px), width_px, points);
                (Kind::WhiteOnBlack, gray(ink), None)
            }
            _ => (Kind::Alpha, gray(ink(size, &segments(lines), width_px, points)), None),
        };
        let counts = counts.unwrap_or_else(|| vec![true; pixels.len()]);
        let seen = seen(size[0] as usize, kind, &pixels);
        Self { width: size[0] as usize, pixels, counts, kind, seen }
    }

    /// The errors of a picture.
    pub fn errors(&self, image: &Image) -> Errors {
        let drawn = self.drawn(image);
        let (mut pixels, mut squares, mut max) = (0, 0.0, 0.0_f64);
        let background = if self.kind == Kind::Color { 1.0 } else { 0.0 };
        for ((drawn, truth), counts) in drawn.iter().zip(&self.pixels).zip(&self.counts) {
            if !counts || drawn.iter().chain(truth).all(|&v| v == background) {
                continue;
            }
            for (d, t) in drawn.iter().zip(truth) {
                let error = 255.0 * (d - t).abs();
                squares += error * error / truth.len() as f64;
                max = max.max(error);
            }
            pixels += 1;
        }
        let sum = |of: &[Vec<f64>]| of.iter().flatten().sum::<f64>();
        let ink = (self.kind != Kind::Color).then(|| sum(&drawn) / sum(&self.pixels));
        let flip = self.seen.difference(&seen(self.width, self.kind, &drawn));
        Errors { rmse: (squares / f64::from(pixels.max(1))).sqrt(), max, flip, ink, pixels: pixels as usize }
    }

    /// A picture's pixels in the truth's terms; those that are not compared are as they should be.
    fn drawn(&self, image: &Image) -> Vec<Vec<f64>> {
        assert_eq!(image.rgba.len(), 4 * self.pixels.len());
        let pixel = |(i, p): (usize, &[u8])| match self.kind {
            _ if !self.counts[i] => self.pixels[i].clone(),
            Kind::Alpha => vec![f64::from(p[3]) / 255.0],
            Kind::WhiteOnBlack => vec![srgb::to_linear(f64::from(p[0]) / 255.0)],
            Kind::Color => p[..3].iter().map(|&v| f64::from(v) / 255.0).collect(),
        };
        image.rgba.chunks(4).enumerate().map(pixel).collect()
    }
}

impl Apart {
    /// Of two pictures of one plan; FLIP over black.
    pub fn of(a: &Image, b: &Image) -> Self {
        let pairs = || a.rgba.chunks(4).zip(b.rgba.chunks(4));
        let differ = pairs().filter(|(p, q)| p != q).count();
        let shown =
            |p: &[u8], k: usize| if k == 3 { u32::from(p[3]) } else { (u32::from(p[k]) * u32::from(p[3]) + 127) / 255 };
        let largest = pairs().flat_map(|(p, q)| (0..4).map(move |k| shown(p, k).abs_diff(shown(q, k)))).max();
        let max = largest.unwrap_or(0) as u8;
        let linear = |image: &Image| -> Vec<V3> {
            let channel = |p: &[u8], k: usize| srgb::to_linear(f64::from(p[k]) / 255.0) * f64::from(p[3]) / 255.0;
            image.rgba.chunks(4).map(|p| [0, 1, 2].map(|k| channel(p, k))).collect()
        };
        let width = a.width_px as usize;
        let flip = if max == 0 { 0.0 } else { Seen::new(width, &linear(a)).difference(&Seen::new(width, &linear(b))) };
        Self { share: differ as f64 / (a.rgba.len() / 4) as f64, max, flip }
    }
}

fn gray(values: Vec<f64>) -> Vec<Vec<f64>> {
    values.into_iter().map(|v| vec![v]).collect()
}

fn seen(width: usize, kind: Kind, pixels: &[Vec<f64>]) -> Seen {
    let linear = |p: &Vec<f64>| match (kind, &p[..]) {
        (Kind::Color, &[r, g, b]) => [r, g, b].map(srgb::to_linear),
        (_, v) => [1.0 - v[0]; 3],
    };
    Seen::new(width, &pixels.iter().map(linear).collect::<Vec<V3>>())
}

/// Encoded colours of the pixels that lie wholly in one face, which is the only one that is seen
/// there; others are white and do not count.
fn whole_pixels(plan: &DrawPlan<'_>) -> (Vec<Vec<f64>>, Option<Vec<bool>>) {
    let scene = scene(plan);
    let screen = Screen::new(&scene);
    let colors = face_colors(plan);
    let places = (0..plan.height_px).flat_map(|y| (0..plan.width_px).map(move |x| [x, y]));
    let faces: Vec<Option<u32>> = places.map(|pixel| only_triangle(&screen, pixel)).collect();
    let color = |face: &Option<u32>| face.map_or([1.0; 3], |t| colors[t as usize]).map(srgb::from_linear).to_vec();
    (faces.iter().map(color).collect(), Some(faces.iter().map(Option::is_some).collect()))
}

fn encoded(linear: Vec<V3>) -> Vec<Vec<f64>> {
    linear.into_iter().map(|color| color.map(srgb::from_linear).to_vec()).collect()
}

/// The exact linear colour of each flat face, on the viewer's side.
fn face_colors(plan: &DrawPlan<'_>) -> Vec<V3> {
    let scene = scene(plan);
    let (material, lights) = (material(plan.surface.as_ref().expect("a surface")), lights(plan));
    let color = |t: &[u32; 3]| {
        let corners = t.map(|v| scene.positions[v as usize]);
        let normal = face_normal(corners).unwrap_or([0.0, 0.0, 1.0]);
        let is_front = is_front(&scene.camera, corners) == Some(true);
        lit(&material, &lights, if is_front { normal } else { sub([0.0; 3], normal) })
    };
    scene.triangles.iter().map(color).collect()
}
