//! The margin: the pixels beyond the picture's border for which visibility samples are taken, too.
//! These say which face is visible there; nothing is drawn. Whether a plan has a margin is decided
//! here: it has none where nothing needs it, or where the whole mesh lies inside the picture.
//!
//! A line covers pixels on both sides of its edge, so a pixel at the picture's border may belong to
//! a line whose edge lies beyond it. Only samples there tell whether a face hides that edge. With
//! them, lines at the border look as they would in the middle of a larger picture. Adaptive
//! samples, for which a pixel is compared with its neighbours, need a margin, too. `build` passes on
//! how wide it has to be for both; a margin is at least 8 pixels wide.

use super::DrawPlan;
use super::context::{CHECK_EVERY, PlanContext};
use super::geometry::Geometry;
use super::projection::{PX, Projection, Projector};
use super::skips::SkipKind;
use crate::limits::{Deadline, Stopped};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::spec::ProjectionKind;

/// Distance from the picture's border from which a mesh counts as inside, 1/256 px: lines look a
/// pixel beside an edge too, and vertices are snapped.
const INSIDE: f64 = 2.0 * PX;

/// Distance from there, 1/256 px, up to which positions are looked at one by one.
const SURE: f64 = 64.0;

/// A limit of the errors that rounding a projection to f32 makes, per unit of the box.
const ROUNDED: f64 = 1e-6;

/// The least margin that is kept, pixels.
const KEPT_PX: u32 = 8;

/// The margin of a plan whose lines need `needed_px` where the mesh reaches the border.
///
/// No clamp is needed: with the widest lines that a request can ask for, the margin is 139 pixels.
/// Half of the largest picture and that end well inside the guard band.
pub fn margin_px(
    scene: &Scene<'_, '_>,
    geometry: &Geometry<'_>,
    needed_px: u32,
    cx: &mut PlanContext<'_>,
) -> Result<u32, Stopped> {
    let (is_unneeded, why) = match needed_px {
        0 => (true, "nothing asks what lies beyond a pixel"),
        _ => (is_inside(scene, geometry, cx.deadline)?, "the whole mesh lies inside the picture"),
    };
    let is_skipped = cx.skips.skip(SkipKind::Margin, is_unneeded, why);
    Ok(if is_skipped { 0 } else { needed_px.max(KEPT_PX) })
}

/// True if all positions are before the eye and inside the picture. Those of the mesh are looked at where
/// the camera cannot tell alone.
fn is_inside(scene: &Scene<'_, '_>, geometry: &Geometry<'_>, deadline: &Deadline) -> Result<bool, Stopped> {
    let size_px = scene.size_px();
    let projector = Projector::new(&Projection::new(&scene.camera, size_px));
    let near_w = projector.near_w(0.0);
    let half = size_px.map(|size| 128.0 * f64::from(size) - INSIDE);
    let known = if is_surely_inside(&scene.camera, size_px) { scene.mesh.positions.len() } else { 0 };
    let others = geometry.positions.get(known..).unwrap_or_default();
    for positions in others.chunks(CHECK_EVERY) {
        deadline.check()?;
        let is_inside = |p: &[f32; 3]| {
            let [x, y, w] = projector.place(*p);
            w >= near_w && x.abs() <= half[0] * w && y.abs() <= half[1] * w
        };
        if !positions.iter().all(is_inside) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// True if the camera alone shows that all positions of the mesh are before the eye and inside the picture,
/// also where the projection's rows are rounded to f32.
fn is_surely_inside(camera: &Camera, size_px: [u32; 2]) -> bool {
    let is_perspective = camera.kind == ProjectionKind::Perspective;
    // The near plane is at half the least distance.
    let nearest = if is_perspective { 2.0 * camera.near } else { 1.0 };
    // Rounding errors of W and of a place across, generously.
    let in_w = if is_perspective { ROUNDED * (camera.distance.abs() + 2.0) } else { 0.0 };
    let across = ROUNDED * (camera.center.abs().max_element() + 2.0);
    (0..2).all(|axis| {
        let half = 128.0 * f64::from(size_px[axis]);
        let rounded = half * (across / (camera.half_size[axis] * nearest) + in_w / nearest);
        rounded <= SURE && half * camera.reach[axis] + INSIDE + SURE <= half
    })
}

impl DrawPlan<'_> {
    /// Columns (or rows) that have visibility samples, from the first to before the last, given how
    /// many the picture has.
    #[inline(always)]
    pub fn seen_range(&self, size_px: u32) -> [i32; 2] {
        let margin = self.margin_px as i32;
        [-margin, size_px as i32 + margin]
    }
}

#[cfg(test)]
mod tests;
