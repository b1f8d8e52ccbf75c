//! Wires on a single triangle against their formulas, written down once more in f64; and derivative
//! normals against those of the faces.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, ShadedMaterial, flags};

use crate::support::gpus::gpus;
use crate::support::{scenes, shapes};

const SIZE: [u32; 2] = [90, 70];
const SCALE: f32 = 64.0;

/// Pixels from the picture's centre at distance 1, and how much farther than that.
const TRIANGLES: [[[f32; 3]; 3]; 3] = [
    [[-40.0, -30.0, 0.0], [41.5, -12.25, 0.0], [-8.5, 33.0, 0.0]],
    [[-40.0, -30.0, 0.1], [30.0, 50.0, 0.9], [55.0, -44.0, 2.0]],
    [[-38.0, 3.0, 0.0], [40.0, -4.0, 0.5], [37.0, 9.0, 0.2]],
];

const PARAMETERS: [[f64; 2]; 4] = [[0.0, 1.5], [1.0, 1.0], [2.5, 0.5], [10.0, 10.0]];

/// 1 at the wire, by thickness t and smoothing s at pixel p; NaN where rounding decides.
type Formula = fn(&Triangle, [f64; 2], f64, f64) -> f64;

#[test]
fn fwidth_is_its_formula() {
    check(flags::WIRE_FWIDTH, |triangle, p, t, s| {
        let b = triangle.barycentrics(p);
        let d = triangle.fwidth(p);
        let away = (0..3).map(|i| smoothstep(t * d[i], (t + s) * d[i], b[i])).fold(1.0, f64::min);
        1.0 - away
    });
}

#[test]
fn fwidth_min_is_its_formula_with_a_gpus_differences() {
    check(flags::WIRE_FWIDTH_MIN, |triangle, [x, y], t, s| {
        let m = |x: f64, y: f64| triangle.barycentrics([x, y]).into_iter().fold(f64::MAX, f64::min);
        // Pixel centres in a block of 2 x 2 whose first column and row are even.
        let (i, j) = (x.floor(), y.floor());
        let pair = |v: f64| [v - v.rem_euclid(2.0) + 0.5, v - v.rem_euclid(2.0) + 1.5];
        let dx = m(pair(i)[1], y) - m(pair(i)[0], y);
        let dy = m(x, pair(j)[1]) - m(x, pair(j)[0]);
        let d = dx.abs() + dy.abs();
        1.0 - smoothstep(t * d, (t + s) * d, m(x, y))
    });
}

#[test]
fn barycentric_is_its_formula() {
    check(flags::WIRE_BARYCENTRIC, |triangle, p, t, _| {
        let m = triangle.barycentrics(p).into_iter().fold(f64::MAX, f64::min);
        1.0 - smoothstep(0.0, 0.1 * t, m)
    });
}

#[test]
fn threshold_is_its_formula() {
    check(flags::WIRE_THRESHOLD, |triangle, p, t, _| {
        let m = triangle.barycentrics(p).into_iter().fold(f64::MAX, f64::min);
        let limit = 0.02 * t;
        if (m - limit).abs() < 1e-6 { f64::NAN } else { f64::from(u8::from(m < limit)) }
    });
}

#[test]
fn derivative_normals_are_those_of_the_faces() {
    let mesh = scenes::mesh(&shapes::torus(36));
    let spec = scenes::spec(&[("style", "flat"), ("size", "200x160"), ("samples", "1")]);
    let mut plan = scenes::plan(&mesh, &spec);
    let mut draw = |bits: u32| {
        plan.surface.as_mut().unwrap().materials[0].flags = flags::FILL | bits | 4 << flags::DEBUG_SHIFT;
        CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap()
    };
    let (face, derivative) = (draw(flags::FACE_NORMALS), draw(flags::DERIVATIVE_NORMALS));
    let mut seen = 0;
    for (a, b) in face.rgba.chunks(4).zip(derivative.rgba.chunks(4)) {
        // A step of a byte is 0.45 degrees: within about a degree.
        assert!(a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 2), "{a:?} {b:?}");
        seen += usize::from(a != [255; 4]);
    }
    assert!(seen > 8000, "{seen}");
    assert_ne!(face.rgba, derivative.rgba, "derivatives have errors of their own");
}

fn check(method: u32, formula: Formula) {
    let mut compared = 0;
    for corners in TRIANGLES {
        let positions = corners.map(|[x, y, far]| [x / SCALE, y / SCALE, far]);
        let triangle = Triangle::new(positions);
        for [t, s] in PARAMETERS {
            let look = ShadedMaterial {
                wire_color: [0.0, 0.0, 0.0, 1.0],
                wire_thickness: t as f32,
                wire_smoothing: s as f32,
                flags: flags::FILL | method,
                ..ShadedMaterial::unlit([1.0; 4])
            };
            let mut plan = scenes::screen_plan(SIZE, 1, SCALE, &positions, &[[0, 1, 2]]);
            plan.projection.w = [0.0, 0.0, 1.0, 1.0];
            plan.projection.z = [0.0, 0.0, 0.0, 0.25];
            plan.background = [0.0, 0.0, 1.0, 1.0];
            plan.surface.as_mut().unwrap().materials = vec![look];
            for picture in pictures(&plan) {
                compared += triangle.compare(&picture, |p| formula(&triangle, p, t, s));
            }
        }
    }
    let back_ends = if gpus().is_some() { 2 } else { 1 };
    assert!(compared > 10_000 * back_ends, "only {compared} pixels compared");
}

fn pictures(plan: &DrawPlan<'_>) -> Vec<Image> {
    let mut pictures = vec![CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap()];
    if let Some(gpus) = gpus() {
        pictures.push(GpuRenderer::new(gpus[0].clone()).draw(plan, &Deadline::default()).unwrap());
    }
    pictures
}

/// A triangle on screen, snapped to 1/256 px as every triangle is.
struct Triangle {
    corners: [[f64; 2]; 3],
    inverse_w: [f64; 3],
}

impl Triangle {
    fn new(positions: [[f32; 3]; 3]) -> Self {
        let inverse_w = positions.map(|p| 1.0 / (1.0 + f64::from(p[2])));
        let snap = |v: f64, half: u32| (v * 256.0).round_ties_even() / 256.0 + f64::from(half) * 0.5;
        let corners = std::array::from_fn(|i| {
            std::array::from_fn(|k| snap(f64::from(positions[i][k]) * f64::from(SCALE) * inverse_w[i], SIZE[k]))
        });
        Self { corners, inverse_w }
    }

    /// Screen-space barycentrics.
    fn affine(&self, p: [f64; 2]) -> [f64; 3] {
        let area =
            |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        let [a, b, c] = self.corners;
        [area(p, b, c), area(a, p, c), area(a, b, p)].map(|part| part / area(a, b, c))
    }

    /// Perspective-correct ones.
    fn barycentrics(&self, p: [f64; 2]) -> [f64; 3] {
        let affine = self.affine(p);
        let weighted: [f64; 3] = std::array::from_fn(|i| affine[i] * self.inverse_w[i]);
        weighted.map(|v| v / weighted.iter().sum::<f64>())
    }

    /// |db/dx| + |db/dy|.
    fn fwidth(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        const H: f64 = 1e-4;
        let [left, right] = [-H, H].map(|h| self.barycentrics([x + h, y]));
        let [above, below] = [-H, H].map(|h| self.barycentrics([x, y + h]));
        std::array::from_fn(|i| ((right[i] - left[i]).abs() + (below[i] - above[i]).abs()) / (2.0 * H))
    }

    /// Number of pixels compared: all but those that an edge or a threshold goes through exactly.
    fn compare(&self, picture: &Image, cover: impl Fn([f64; 2]) -> f64) -> usize {
        let (mut compared, mut inside) = (0, 0);
        for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
            let p = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let least = self.affine(p).into_iter().fold(f64::MAX, f64::min);
            let cover = cover(p);
            if least.abs() < 1e-9 || cover.is_nan() {
                continue;
            }
            compared += 1;
            let seen = picture.pixel(x, y);
            if least < 0.0 {
                assert_eq!(seen, [0, 0, 255, 255], "outside at {x}, {y}");
                continue;
            }
            inside += 1;
            let want = srgb8(1.0 - cover);
            assert!(seen[..3].iter().all(|v| v.abs_diff(want) <= 1), "{x}, {y}: {seen:?}, want {want}");
        }
        assert!(inside > 300, "{inside}");
        assert!(compared + 3 > (SIZE[0] * SIZE[1]) as usize, "{compared}");
        compared
    }
}

fn smoothstep(from: f64, to: f64, v: f64) -> f64 {
    if to <= from {
        return f64::from(u8::from(v >= from));
    }
    let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn srgb8(linear: f64) -> u8 {
    let v = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (v * 255.0).round() as u8
}
