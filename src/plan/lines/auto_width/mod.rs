//! The width of wires whose thickness is left open: lines that let the surface be seen.

use crate::mesh::Mesh;
use crate::plan::Projection;
use crate::plan::projection::row_dot;
use crate::scene::Scene;

/// Share of the faces that lines cover at most, on average over their area on screen.
const COVERED_MAX: f64 = 0.35;

/// The widest and the thinnest line, pixels. Where the thinnest ones cover too much, they get fainter
/// instead: far below a pixel, width and opacity look the same, and these are drawn sooner.
const WIDTHS_PX: [f64; 2] = [0.8, 1.0];

/// Faces that are looked at, at most: every so many of a larger mesh.
const FACES_MAX: usize = 1 << 13;

/// Width and opacity of lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutoWidth {
    /// Full width, pixels.
    pub width_px: f32,
    /// Multiplies the colour's own opacity.
    pub opacity: f32,
}

impl AutoWidth {
    /// Lines with room around them.
    pub const WIDEST: Self = Self { width_px: 1.0, opacity: 1.0 };

    /// The lines along all edges of a scene, or those of its polygons, around the triangles that `has_lines`
    /// names.
    ///
    /// Lines of width w cover `1 - (1 - w / 2r)^2` of a triangle whose inscribed circle has the radius r, and
    /// all of it from w = 2r on. With diagonals left out, `r = 2 area / length of drawn edges` is taken.
    pub fn of(scene: &Scene<'_, '_>, are_polygons: bool, has_lines: impl Fn(usize) -> bool) -> Self {
        let faces = faces(scene, are_polygons, has_lines);
        let area: f64 = faces.iter().map(|[area, _]| area).sum();
        let covered = |width_px: f64| {
            let share = |[area, diameter]: &[f64; 2]| {
                let free = (1.0 - width_px / diameter).max(0.0);
                area * (1.0 - free * free)
            };
            faces.iter().map(share).sum::<f64>() / area
        };
        let [mut thin, mut wide] = WIDTHS_PX;
        // Not true either if no face has an area.
        if !(covered(wide) > COVERED_MAX) {
            return Self::WIDEST;
        }
        let least = covered(thin);
        if least >= COVERED_MAX {
            return Self { width_px: thin as f32, opacity: (COVERED_MAX / least) as f32 };
        }
        for _ in 0..10 {
            let middle = 0.5 * (thin + wide);
            if covered(middle) > COVERED_MAX { wide = middle } else { thin = middle }
        }
        Self { width_px: thin as f32, opacity: 1.0 }
    }
}

/// Area on screen and diameter of the inscribed circle of each face that is looked at, pixels. Those with a
/// corner behind the near plane or the centre outside the picture are left out.
fn faces(scene: &Scene<'_, '_>, are_polygons: bool, has_lines: impl Fn(usize) -> bool) -> Vec<[f64; 2]> {
    let mesh: &Mesh = scene.mesh;
    let projection = Projection::new(&scene.camera, scene.size_px(), true);
    let half = scene.size_px().map(|px| 0.5 * f64::from(px));
    let near_w = f64::from(projection.near_w);
    let place = |v: u32| {
        let p = mesh.positions[v as usize];
        let [x, y, w] = [&projection.x, &projection.y, &projection.w].map(|row| row_dot(row, p));
        (w >= near_w).then(|| [x / w / 256.0, y / w / 256.0])
    };
    let of = |i: usize| {
        let [a, b, c] = mesh.triangles[i].map(place);
        let corners = [a?, b?, c?];
        let is_inside = |k: usize| (corners.iter().map(|corner| corner[k]).sum::<f64>() / 3.0).abs() <= half[k];
        if !is_inside(0) || !is_inside(1) {
            return None;
        }
        let ways = [0, 1, 2].map(|k| [0, 1].map(|axis| corners[(k + 1) % 3][axis] - corners[k][axis]));
        let area = 0.5 * (ways[0][0] * ways[1][1] - ways[0][1] * ways[1][0]).abs();
        let mask = if are_polygons { mesh.edge_masks.get(i).copied().unwrap_or(7) } else { 7 };
        let drawn = (0..3).filter(|k| mask >> k & 1 == 1);
        let length: f64 = drawn.map(|k: usize| (ways[k][0] * ways[k][0] + ways[k][1] * ways[k][1]).sqrt()).sum();
        (area > 0.0).then_some([area, 4.0 * area / length])
    };
    let step = mesh.triangles.len().div_ceil(FACES_MAX).max(1);
    (0..mesh.triangles.len()).step_by(step).filter(|&i| has_lines(i)).filter_map(of).collect()
}

#[cfg(test)]
mod tests;
