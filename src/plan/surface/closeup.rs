//! Texture levels that a picture can reach: finer ones need not be kept.
//!
//! The sampler takes the level log2(max(|a|, |b|)), a and b being the derivatives of the texel
//! coordinates across and down a pixel. max(|a|, |b|)^2 >= |a x b|, the texels that a pixel covers.
//! Over a triangle with screen corners s_i, texel corners t_i and distances W_i, perspective
//! interpolation gives
//!
//! ```text
//! |a x b| (p) = area(t) / area(s) * W(p)^3 / (W_0 W_1 W_2)
//! ```
//!
//! (u and v are ratios of functions that are linear on screen, with the denominator 1 / W; the
//! Jacobian of such a ratio is a determinant of the planes over the denominator's cube.) A pixel is
//! shaded at the mean of its samples, which lie inside the triangle, where W is at least the
//! smallest W_i. So the least of this over all triangles bounds the level from below.
//!
//! Rounding: corners are snapped to whole units of 1/256 px, so area(s) may be larger than the true
//! one, by at most e perimeter + 3 e^2 for corners that move by e; and f32 coordinates make area(t)
//! uncertain in the same way. Both are taken at their worst. A corner that is snapped nowhere,
//! behind the eye or far outside, keeps every level.

use crate::limits::{Deadline, Stopped};
use crate::mesh::Mesh;
use crate::plan::geometry::Geometry;
use crate::plan::projection::Projection;

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
    /// Texels of level 0.
    pub texels: f64,
}

/// For each of `count` textures, a level that is reached or exceeded by every pixel that samples
/// the texture.
pub fn finest_levels(
    mesh: &Mesh,
    geometry: &Geometry<'_>,
    projection: &Projection,
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
        let screen = on_screen(geometry.triangles[t].map(|v| geometry.positions[v as usize]), projection);
        let corners = geometry.attribute_triangles[t];
        let before = list.len();
        list.retain(|&index| {
            let one = &uses[index];
            let uvs = if one.is_second_uvs { &mesh.second_uvs } else { &mesh.uvs };
            let uvs = corners.map(|v| uvs[v as usize]);
            let density = screen.map_or(0.0, |screen| screen * area_of_uvs(&uvs, &one.transform) * one.texels);
            // Written so that NaN counts as 0.
            least[index] = if density > 0.0 { least[index].min(density) } else { 0.0 };
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

/// The factor of the texel area: `W^3 / (W_0 W_1 W_2) / area(s)` at the nearest corner, in 1 /
/// px^2. None where a corner is outside.
fn on_screen(corners: [[f32; 3]; 3], projection: &Projection) -> Option<f64> {
    /// 4096 px, in 1/256 px.
    const GUARD: f64 = 1_048_576.0;
    /// Half a unit across and down, and twice what f32 is off at the guard band.
    const MOVED: f64 = 1.5;
    let mut points = [[0.0; 2]; 3];
    let mut depths = [1.0; 3];
    for k in 0..3 {
        let row = |row: &[f32; 4]| {
            let p = corners[k].map(f64::from);
            let [x, y, z, w] = row.map(f64::from);
            x * p[0] + y * p[1] + z * p[2] + w
        };
        let w = row(&projection.w);
        points[k] = [row(&projection.x) / w, row(&projection.y) / w];
        depths[k] = w;
        let inside = w > f64::from(projection.near_w) * (1.0 + 1e-6);
        if !(inside && points[k].iter().all(|c| c.abs() < GUARD * 0.999)) {
            return None;
        }
    }
    let (area, perimeter) = area_and_perimeter(points);
    let area_px = (area + MOVED * perimeter + 3.0 * MOVED * MOVED) / 65536.0;
    let nearest = depths[0].min(depths[1]).min(depths[2]);
    Some((nearest / depths[0]) * (nearest / depths[1]) * (nearest / depths[2]) / area_px)
}

/// Twice the area of a triangle in transformed texture coordinates, less what f32 may be off.
fn area_of_uvs(uvs: &[[f32; 2]; 3], transform: &[[f32; 3]; 2]) -> f64 {
    let mut largest = 0.0_f64;
    let points = uvs.map(|uv| {
        let [u, v] = uv.map(f64::from);
        transform.map(|row| {
            let [a, b, c] = row.map(f64::from);
            largest = largest.max((a * u).abs() + (b * v).abs() + c.abs());
            a * u + b * v + c
        })
    });
    let unsure = largest / 1_048_576.0;
    let (area, perimeter) = area_and_perimeter(points);
    (area - unsure * perimeter - 3.0 * unsure * unsure).max(0.0)
}

/// Twice the area of a triangle, and its perimeter.
fn area_and_perimeter([a, b, c]: [[f64; 2]; 3]) -> (f64, f64) {
    let edge = |p: [f64; 2], q: [f64; 2]| [q[0] - p[0], q[1] - p[1]];
    let length = |e: [f64; 2]| (e[0] * e[0] + e[1] * e[1]).sqrt();
    let (ab, ac, bc) = (edge(a, b), edge(a, c), edge(b, c));
    ((ab[0] * ac[1] - ab[1] * ac[0]).abs(), length(ab) + length(ac) + length(bc))
}
