//! The automatic width of wires (lines along the mesh's edges) whose thickness a request leaves open. It
//! is 1 pixel. Where the picture's edges lie so close that such lines would cover more than 35 % of the
//! surface, they become thinner, down to 0.8 pixels, and then fainter, so that the surface can be seen.

mod open_edges;

pub use open_edges::open_edges;

use super::picked_faces::PickedFace;
use crate::mesh::Mesh;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::{PX, PlanError, Projection, Projector};
use crate::scene::Scene;

/// Share of the faces that lines cover at most, on average over their area on screen.
const COVERED_MAX: f64 = 0.35;

/// The widest and the thinnest line, pixels. Where the thinnest ones cover too much, they get fainter
/// instead: far below a pixel, width and opacity look the same, and these are drawn sooner.
const WIDTHS_PX: [f64; 2] = [0.8, 1.0];

/// Leading bits of a diameter's mantissa that tell its class: classes are 3 % apart.
const MANTISSA_BITS: u32 = 5;

/// The exponents of the smallest and the largest diameter: from 2^-10 to 2^10 px.
const EXPONENTS: [i64; 2] = [-10, 10];

/// Classes of diameters.
const CLASSES: usize = ((EXPONENTS[1] - EXPONENTS[0]) << MANTISSA_BITS) as usize;

/// Steps of widths and opacities in 1, coarse enough for the order of the faces to leave no trace.
const STEPS: f64 = 256.0;

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
    pub fn of(
        scene: &Scene<'_, '_>,
        are_polygons: bool,
        has_lines: impl Fn(usize) -> bool,
        cx: &mut PlanContext<'_>,
    ) -> Result<Self, PlanError> {
        let picked = cx.picked_faces(scene.mesh)?;
        let view = View::new(scene, are_polygons);
        let mut sizes = FaceSizes([0; CLASSES]);
        for faces in picked.chunks(CHECK_EVERY) {
            cx.deadline.check()?;
            sizes.add(&view, faces.iter().filter(|picked| has_lines(picked.face as usize)));
        }
        Ok(Self::around(&sizes))
    }

    /// The lines around faces of these sizes.
    fn around(faces: &FaceSizes) -> Self {
        let [mut thin, mut wide] = WIDTHS_PX;
        let step = |v: f64| ((v * STEPS).round() / STEPS) as f32;
        if faces.covered(wide) <= COVERED_MAX {
            return Self::WIDEST;
        }
        let least = faces.covered(thin);
        if least >= COVERED_MAX {
            return Self { width_px: thin as f32, opacity: step(COVERED_MAX / least) };
        }
        for _ in 0..12 {
            let middle = 0.5 * (thin + wide);
            if faces.covered(middle) > COVERED_MAX { wide = middle } else { thin = middle }
        }
        Self { width_px: step(thin), opacity: 1.0 }
    }
}

/// Areas of faces on screen, by the diameter of their inscribed circles. Whole numbers, whose sums do not
/// depend on an order.
struct FaceSizes([u64; CLASSES]);

impl FaceSizes {
    /// Adds faces but those with a corner behind the near plane or the centre outside the picture.
    fn add<'a>(&mut self, view: &View<'_>, faces: impl Iterator<Item = &'a PickedFace>) {
        for picked in faces {
            if let Some([area, diameter]) = view.size_of(picked.face as usize) {
                let class = &mut self.0[class_of(diameter)];
                *class = class.saturating_add((area * f64::from(picked.weight) * 256.0).round() as u64);
            }
        }
    }

    /// The share of the faces that lines of a width cover, 0 to 1; 0 if there are none.
    fn covered(&self, width_px: f64) -> f64 {
        let (mut covered, mut all) = (0.0, 0.0);
        for (class, &area) in self.0.iter().enumerate() {
            let free = (1.0 - width_px / diameter_of(class)).max(0.0);
            all += area as f64;
            covered += area as f64 * (1.0 - free * free);
        }
        if all > 0.0 { covered / all } else { 0.0 }
    }
}

/// The class of a diameter, by the leading bits of its binary form.
fn class_of(diameter: f64) -> usize {
    let leading = (diameter.to_bits() >> (52 - MANTISSA_BITS)) as i64 - ((1023 + EXPONENTS[0]) << MANTISSA_BITS);
    leading.clamp(0, CLASSES as i64 - 1) as usize
}

/// The diameter in the middle of a class.
fn diameter_of(class: usize) -> f64 {
    let leading = class as i64 + ((1023 + EXPONENTS[0]) << MANTISSA_BITS);
    f64::from_bits(((leading as u64) << (52 - MANTISSA_BITS)) | 1 << (51 - MANTISSA_BITS))
}

/// A mesh as it is seen.
struct View<'a> {
    mesh: &'a Mesh,
    projector: Projector,
    /// Half the picture's width and height.
    half_px: [f64; 2],
    are_polygons: bool,
}

impl<'a> View<'a> {
    fn new(scene: &Scene<'a, '_>, are_polygons: bool) -> Self {
        let projector = Projector::new(&Projection::new(&scene.camera, scene.size_px()));
        let half_px = scene.size_px().map(|px| 0.5 * f64::from(px));
        Self { mesh: scene.mesh, projector, half_px, are_polygons }
    }

    /// The area of a face on screen and the diameter of its inscribed circle, pixels.
    fn size_of(&self, face: usize) -> Option<[f64; 2]> {
        let [a, b, c] = self.mesh.triangles[face].map(|v| self.place_of(v));
        let corners = [a?, b?, c?];
        let is_inside = |k: usize| (corners.iter().map(|corner| corner[k]).sum::<f64>() / 3.0).abs() <= self.half_px[k];
        if !is_inside(0) || !is_inside(1) {
            return None;
        }
        let ways = [0, 1, 2].map(|k| [0, 1].map(|axis| corners[(k + 1) % 3][axis] - corners[k][axis]));
        // A face may be far larger than the picture.
        let picture = 4.0 * self.half_px[0] * self.half_px[1];
        let area = (0.5 * (ways[0][0] * ways[1][1] - ways[0][1] * ways[1][0]).abs()).min(picture);
        let mask = if self.are_polygons { self.mesh.edge_masks.get(face).copied().unwrap_or(7) } else { 7 };
        let drawn = (0..3).filter(|k| mask >> k & 1 == 1);
        let length: f64 = drawn.map(|k: usize| (ways[k][0] * ways[k][0] + ways[k][1] * ways[k][1]).sqrt()).sum();
        (area > 0.0).then_some([area, 4.0 * area / length])
    }

    /// The length of an edge on screen, pixels, if its middle is in the picture.
    fn length_of(&self, vertices: [u32; 2]) -> Option<f64> {
        let [a, b] = vertices.map(|v| self.place_of(v));
        let (a, b) = (a?, b?);
        let is_inside = |k: usize| (0.5 * (a[k] + b[k])).abs() <= self.half_px[k];
        let longest = self.half_px[0] + self.half_px[1];
        let length = ((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1])).sqrt();
        (is_inside(0) && is_inside(1)).then_some(length.min(2.0 * longest))
    }

    /// A vertex on screen, pixels from the centre; None behind the near plane.
    fn place_of(&self, vertex: u32) -> Option<[f64; 2]> {
        let [x, y, _] = self.projector.on_screen(self.mesh.positions[vertex as usize], self.projector.near_w(0.0))?;
        Some([x / PX, y / PX])
    }
}

#[cfg(test)]
mod tests;
