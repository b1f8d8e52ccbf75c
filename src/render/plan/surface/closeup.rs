//! The finest mip level of each texture that a pixel of the picture can sample, or a finer one where that
//! is not certain. Levels finer than this need not be kept.
//!
//! A pixel's footprint in a texture is an ellipse, and A the product of its axes: the texels that the pixel covers.
//! The sampler looks at one place if, for example, the axes' ratio r is below 1.5. Then it takes the level of the longer
//! step to a neighbouring pixel, which is at least log2(sqrt(A)). Otherwise it looks at up to [`TAPS_MAX`] places
//! along the longer axis, in no finer level than that of the shorter one, log2(sqrt(A / r)), and that of an eighth of
//! the longer one, log2(sqrt(A r) / 8). So no pixel reaches below log2(sqrt(A / min(r, 8))).
//!
//! Over a triangle with screen corners s_i, texel corners t_i and distances W_i, perspective interpolation gives
//!
//! ```text
//! A(p) = area(t) / area(s) * W(p)^3 / (W_0 W_1 W_2)
//! J(p) = f J_0 (I - d g^T)
//! ```
//!
//! (u and v are ratios of functions that are linear on screen, with the denominator q = 1 / W. J is the matrix of the
//! derivatives, J_0 that at the first corner, f a factor, d = p - s_0, and g = grad q / q(p).) A pixel is shaded at
//! the mean of its samples, which lie inside the triangle, where W is at least the smallest W_i. And r is at most
//! r_0 (1 + |d| |g|)^2 q_max / q_min, since the determinant of I - d g^T is q_0 / q(p). So the least of A / min(r, 8)
//! over all triangles bounds the level from below.
//!
//! Rounding: corners are snapped to whole units of 1/256 px, so area(s) may be larger than the true one, by at most e
//! perimeter + 3 e^2 for corners that move by e; and f32 coordinates make area(t) uncertain in the same way. Both are
//! taken at their worst. A corner that is snapped nowhere, behind the near plane or far outside, keeps every level.

use crate::limits::{Deadline, Stopped};
use crate::mesh::Mesh;
use crate::plan::geometry::Geometry;
use crate::plan::projection::Projector;
use crate::plan::surface::samplers::TAPS_MAX;

/// A material's use of a texture.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// The material.
    pub material: u32,
    /// The texture's place in the result.
    pub texture: usize,
    /// The transform of the texture coordinates.
    pub transform: [[f32; 3]; 2],
    /// True for the mesh's second set of texture coordinates.
    pub is_second_uvs: bool,
    /// Columns and rows of level 0.
    pub size: [f64; 2],
}

/// For each of `count` textures, a level that is reached or exceeded by every pixel that samples
/// the texture.
pub fn finest_levels(
    mesh: &Mesh,
    geometry: &Geometry<'_>,
    projector: &Projector,
    uses: &[Use],
    count: usize,
    deadline: &Deadline,
) -> Result<Vec<u32>, Stopped> {
    let mut of_material = vec![Vec::new(); mesh.materials.len()];
    for (index, one) in uses.iter().enumerate() {
        if let Some(list) = of_material.get_mut(one.material as usize) {
            list.push(index);
        }
    }
    let mut least = vec![f64::INFINITY; uses.len()];
    // Uses that may still be spared a level.
    let mut open: usize = of_material.iter().map(Vec::len).sum();
    for (t, &material) in geometry.triangle_materials.iter().enumerate() {
        if t.is_multiple_of(4096) {
            deadline.check()?;
        }
        let Some(list) = of_material.get_mut(material as usize).filter(|list| !list.is_empty()) else { continue };
        let screen = on_screen(geometry.triangles[t].map(|v| geometry.positions[v as usize]), projector);
        let corners = geometry.attribute_triangles[t];
        let before = list.len();
        list.retain(|&index| {
            let one = &uses[index];
            let uvs = if one.is_second_uvs { &mesh.second_uvs } else { &mesh.uvs };
            let uvs = corners.map(|v| uvs[v as usize]);
            least[index] = match &screen {
                Some(screen) => least[index].min(least_density(screen, &uvs, one, least[index])),
                None => 0.0,
            };
            level(least[index]) > 0
        });
        open -= before - list.len();
        if open == 0 {
            break;
        }
    }
    let mut levels = vec![u32::MAX; count];
    for (one, &least) in uses.iter().zip(&least) {
        levels[one.texture] = levels[one.texture].min(level(least));
    }
    Ok(levels)
}

/// The level at which a pixel covers `density` texels of level 0, rounded down, with a margin for
/// the sampler's own rounding.
fn level(density: f64) -> u32 {
    let (mut level, mut texels) = (0, 4.0 * 1.08);
    while level < 31 && texels <= density {
        level += 1;
        texels *= 4.0;
    }
    level
}

/// A triangle on screen.
struct OnScreen {
    /// Its corners, in 1/256 px.
    points: [[f64; 2]; 3],
    /// 1 / W at the corners.
    inverse_w: [f64; 3],
    /// Twice its area, and its perimeter.
    area: f64,
    perimeter: f64,
}

/// Movement of a corner by snapping, in 1/256 px: half a unit across and down, and twice what f32 is off at the guard
/// band.
const MOVED: f64 = 1.5;

/// Corners that are nearer to the near plane, by this share of its distance, may be behind it for a back-end.
const NEAR_MARGIN: f64 = 1e-6;

/// None where a corner is outside.
fn on_screen(corners: [[f32; 3]; 3], projector: &Projector) -> Option<OnScreen> {
    /// 4096 px, in 1/256 px.
    const GUARD: f64 = 1_048_576.0;
    let mut points = [[0.0; 2]; 3];
    let mut inverse_w = [1.0; 3];
    for k in 0..3 {
        let [x, y, inverse] = projector.on_screen(corners[k], projector.near_w(NEAR_MARGIN))?;
        (points[k], inverse_w[k]) = ([x, y], inverse);
        if !points[k].iter().all(|c| c.abs() < GUARD * 0.999) {
            return None;
        }
    }
    let (area, perimeter) = area_and_perimeter(points);
    Some(OnScreen { points, inverse_w, area, perimeter })
}

/// The least of A / min(r, 8) over a triangle, or more than `enough` if it is that at least. 0 where it is not certain.
fn least_density(screen: &OnScreen, uvs: &[[f32; 2]; 3], one: &Use, enough: f64) -> f64 {
    let mut largest = 0.0_f64;
    let texels = uvs.map(|uv| {
        let [u, v] = uv.map(f64::from);
        [0, 1].map(|k| {
            let [a, b, c] = one.transform[k].map(|v| f64::from(v) * one.size[k]);
            largest = largest.max((a * u).abs() + (b * v).abs() + c.abs());
            a * u + b * v + c
        })
    });
    // What f32 may be off.
    let unsure = largest / 1_048_576.0;
    let (area, perimeter) = area_and_perimeter(texels);
    let area = (area - unsure * perimeter - 3.0 * unsure * unsure).max(0.0);
    let area_px = (screen.area + MOVED * screen.perimeter + 3.0 * MOVED * MOVED) / 65536.0;
    let q = screen.inverse_w;
    let most = q[0].max(q[1]).max(q[2]);
    let density = (q[0] / most) * (q[1] / most) * (q[2] / most) * area / area_px;
    // NaN is not.
    let is_certain = density > 0.0;
    if !is_certain {
        return 0.0;
    }
    let tapped = density / f64::from(TAPS_MAX);
    if tapped >= enough {
        return density;
    }
    let ratio = ratio_max(screen, &texels, unsure);
    match ratio < f64::from(TAPS_MAX) {
        true if ratio < 1.49 => density,
        true => density / ratio,
        false => tapped,
    }
}

/// A bound of the ratio of the footprints' axes over a triangle; infinite where none is certain.
fn ratio_max(screen: &OnScreen, texels: &[[f64; 2]; 3], unsure: f64) -> f64 {
    let q = screen.inverse_w;
    let side = |p: &[[f64; 2]; 3], k: usize| [p[k][0] - p[0][0], p[k][1] - p[0][1]];
    let (s, t) = ([side(&screen.points, 1), side(&screen.points, 2)], [side(texels, 1), side(texels, 2)]);
    // Derivatives along two sides, at the first corner.
    let t = [0, 1].map(|k| t[k].map(|v| v * (q[k + 1] / q[0])));
    let determinant = |m: &[[f64; 2]; 2]| m[0][0] * m[1][1] - m[0][1] * m[1][0];
    let norm = |m: &[[f64; 2]; 2]| m.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
    let (det_s, det_t) = (determinant(&s), determinant(&t));
    // J_0 = T S^-1, without the factor 1 / det(S), which no ratio has; columns of S and T are the sides.
    let j = [0, 1].map(|k| [t[0][k] * s[1][1] - t[1][k] * s[0][1], t[1][k] * s[0][0] - t[0][k] * s[1][0]]);
    let mean = 0.5 * j.iter().flatten().map(|v| v * v).sum::<f64>();
    let det_j = determinant(&j).abs();
    let root = (mean * mean - det_j * det_j).max(0.0).sqrt();
    let ratio = (mean + root) / det_j;
    let (low, high) = (q[0].min(q[1]).min(q[2]), q[0].max(q[1]).max(q[2]));
    // Both matrices may be off by six times what a coordinate is: their parts, relative to the inverse.
    let off = 6.0 * MOVED * norm(&s) / det_s.abs() + 6.0 * unsure * (high / low) * norm(&t) / det_t.abs();
    let dq = [q[1] - q[0], q[2] - q[0]];
    let slope = [dq[0] * s[1][1] - dq[1] * s[0][1], dq[1] * s[0][0] - dq[0] * s[1][0]];
    let steep = slope[0].hypot(slope[1]) / det_s.abs() / low * (0.5 * screen.perimeter);
    // Written so that NaN is infinite.
    if off < 0.5 && ratio.is_finite() {
        ratio * ((1.0 + off) / (1.0 - off)).powi(2) * (1.0 + steep).powi(2) * (high / low)
    } else {
        f64::INFINITY
    }
}

/// Twice the area of a triangle, and its perimeter.
fn area_and_perimeter([a, b, c]: [[f64; 2]; 3]) -> (f64, f64) {
    let edge = |p: [f64; 2], q: [f64; 2]| [q[0] - p[0], q[1] - p[1]];
    let length = |e: [f64; 2]| (e[0] * e[0] + e[1] * e[1]).sqrt();
    let (ab, ac, bc) = (edge(a, b), edge(a, c), edge(b, c));
    ((ab[0] * ac[1] - ab[1] * ac[0]).abs(), length(ab) + length(ac) + length(bc))
}
