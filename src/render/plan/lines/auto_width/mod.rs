//! The automatic width of wires along all edges of a mesh, or all edges of its polygons, whose thickness a
//! request leaves open. It is 1 pixel. If the picture's edges lie so close that such lines would cover more
//! than 35 % of the surface, all lines become thinner, down to 0.8 pixels. Wherever lines of that width cover
//! more than 35 % of the surface around a place, they are [fainter](super::fade) there, so that the surface
//! can be seen.

mod features;
mod open_edges;

pub use open_edges::{OpenEdges, open_edges};

use std::sync::Arc;

use super::fade::{Density, LineFade, nearest};
use crate::mesh::Mesh;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::{PX, PlanError, Projection, Projector};
use crate::scene::Scene;

/// Share of the faces that lines cover at most: on average over their area on screen, and around each place.
const COVERED_MAX: f64 = 0.35;

/// The thinnest and the widest line, pixels. Where the thinnest ones cover too much, they get fainter
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
#[derive(Clone, Debug, PartialEq)]
pub struct AutoWidth {
    /// Full width, pixels.
    pub width_px: f32,
    /// Multiplies the colour's own opacity, from place to place; None: by 1.
    pub fade: Option<Arc<LineFade>>,
}

impl AutoWidth {
    /// Opaque lines of a width.
    pub fn opaque(width_px: f32) -> Self {
        Self { width_px, fade: None }
    }

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
        let mut density = Density::new(scene.size_px());
        for faces in picked.chunks(CHECK_EVERY) {
            cx.deadline.check()?;
            for picked in faces.iter().filter(|picked| has_lines(picked.face as usize)) {
                if let Some(face) = view.face(picked.face as usize) {
                    if view.shows_middle(&face.corners) {
                        sizes.add(&face, picked.weight);
                    }
                    let corners = face.corners.map(|corner| view.in_picture(corner));
                    let covered = WIDTHS_PX.map(|width_px| covered_share(width_px, face.diameter));
                    density.add_face(corners, face.area, f64::from(picked.weight), covered);
                }
            }
        }
        let width = sizes.width();
        let [thin, wide] = WIDTHS_PX;
        let fade = density.fade(COVERED_MAX, (width - thin) / (wide - thin));
        Ok(Self { width_px: width as f32, fade: fade.map(Arc::new) })
    }
}

/// Areas of faces on screen, by the diameter of their inscribed circles. Whole numbers, whose sums do not
/// depend on an order.
struct FaceSizes([u64; CLASSES]);

impl FaceSizes {
    /// Adds a face that stands for `weight` faces.
    fn add(&mut self, face: &FaceOnScreen, weight: f32) {
        let class = &mut self.0[class_of(face.diameter)];
        *class = class.saturating_add(nearest(face.area * f64::from(weight) * 256.0) as u64);
    }

    /// The width of lines around these faces, pixels.
    fn width(&self) -> f64 {
        let [mut thin, mut wide] = WIDTHS_PX;
        if self.covered(wide) <= COVERED_MAX {
            return wide;
        }
        if self.covered(thin) >= COVERED_MAX {
            return thin;
        }
        for _ in 0..12 {
            let middle = 0.5 * (thin + wide);
            if self.covered(middle) > COVERED_MAX { wide = middle } else { thin = middle }
        }
        (thin * STEPS).round() / STEPS
    }

    /// The share of the faces that lines of a width cover, 0 to 1; 0 if there are none.
    fn covered(&self, width_px: f64) -> f64 {
        let (mut covered, mut all) = (0.0, 0.0);
        for (class, &area) in self.0.iter().enumerate() {
            all += area as f64;
            covered += area as f64 * covered_share(width_px, diameter_of(class));
        }
        if all > 0.0 { covered / all } else { 0.0 }
    }
}

/// The share of a face that lines of this width cover, given the diameter of its inscribed circle, 0 to 1.
fn covered_share(width_px: f64, diameter: f64) -> f64 {
    let free = (1.0 - width_px / diameter).max(0.0);
    1.0 - free * free
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

/// Units of a face's corners on screen in a pixel.
const UNITS: f64 = 4096.0;

/// Corners are taken to lie at most this far from the picture's middle, in units: products of two distances fit 64
/// bits.
const FARTHEST: f64 = (1_u64 << 29) as f64;

/// A distance in whole units, given in pixels.
fn in_units(distance_px: f64) -> i64 {
    nearest((distance_px * UNITS).clamp(-FARTHEST, FARTHEST))
}

/// A face as it is seen, pixels.
struct FaceOnScreen {
    /// From the middle of the picture.
    corners: [[f64; 2]; 3],
    area: f64,
    /// Of its inscribed circle.
    diameter: f64,
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

    /// A face on screen; None with a corner behind the near plane, or without an area. Its corners are rounded and
    /// sums are those of whole numbers, so that nothing depends on the corner that a file names first.
    fn face(&self, face: usize) -> Option<FaceOnScreen> {
        let [a, b, c] = self.mesh.triangles[face].map(|v| self.place_of(v));
        let corners = [a?, b?, c?].map(|corner| corner.map(in_units));
        let ways = [0, 1, 2].map(|k| [0, 1].map(|axis| corners[(k + 1) % 3][axis] - corners[k][axis]));
        let twice = (ways[0][0] * ways[1][1] - ways[0][1] * ways[1][0]).unsigned_abs();
        // A face may be far larger than the picture.
        let picture = 4.0 * self.half_px[0] * self.half_px[1];
        let area = (0.5 * twice as f64 / (UNITS * UNITS)).min(picture);
        let mask = if self.are_polygons { self.mesh.edge_masks.get(face).copied().unwrap_or(7) } else { 7 };
        let drawn = (0..3).filter(|k| mask >> k & 1 == 1);
        let length_of = |[x, y]: [i64; 2]| nearest((x as f64 * x as f64 + y as f64 * y as f64).sqrt());
        let length = drawn.map(|k: usize| length_of(ways[k])).sum::<i64>() as f64 / UNITS;
        let corners = corners.map(|corner| corner.map(|v| v as f64 / UNITS));
        (area > 0.0).then_some(FaceOnScreen { corners, area, diameter: 4.0 * area / length })
    }

    /// True if the middle of a face lies in the picture.
    fn shows_middle(&self, corners: &[[f64; 2]; 3]) -> bool {
        (0..2).all(|k| (corners.iter().map(|corner| corner[k]).sum::<f64>() / 3.0).abs() <= self.half_px[k])
    }

    /// A place given from the picture's middle, from its upper left corner.
    fn in_picture(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| place[k] + self.half_px[k])
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
