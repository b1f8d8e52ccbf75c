//! The width and the opacity of lines that mark open edges, which are edges with a single face. Where
//! these lines would cover more than 15 % of the surface, as on models that are put together from many
//! open surfaces, they become thinner and then fainter, down to half their opacity.

use super::{STEPS, View};
use crate::limits::{Deadline, Stopped};
use crate::mesh::edges::EdgeList;
use crate::plan::context::CHECK_EVERY;
use crate::scene::Scene;

/// Share of the faces that the lines cover at most, taken over the whole mesh.
const COVERED_MAX: f64 = 0.15;

/// The faintest lines. A fault stays visible.
const OPACITY_MIN: f64 = 0.5;

/// Width, pixels, and opacity of lines.
pub struct OpenEdges {
    pub width_px: f32,
    /// Multiplies the colour's own opacity.
    pub opacity: f32,
}

/// Lines of the open edges in a list: at most `widest_px` wide, and at least `thinnest_px`.
pub fn open_edges(
    scene: &Scene<'_, '_>,
    list: &EdgeList,
    [thinnest_px, widest_px]: [f32; 2],
    deadline: &Deadline,
) -> Result<OpenEdges, Stopped> {
    let view = View::new(scene, false);
    // Sums of whole numbers do not depend on an order.
    let whole = |v: f64| (v * 256.0).round() as u64;
    let (mut length, mut area) = (0, 0);
    for (i, edge) in list.iter().enumerate() {
        if i % CHECK_EVERY == 0 {
            deadline.check()?;
        }
        if edge.face_count == 1 {
            length += whole(view.length_of(edge.vertices).unwrap_or(0.0));
        }
    }
    if length > 0 {
        for face in 0..scene.mesh.triangles.len() {
            if face % CHECK_EVERY == 0 {
                deadline.check()?;
            }
            area +=
                whole(view.face(face).filter(|face| view.shows_middle(&face.corners)).map_or(0.0, |face| face.area));
        }
    }
    let per_px = length as f64 / (area as f64).max(1.0);
    let step = |v: f64| ((v * STEPS).round() / STEPS) as f32;
    let most = COVERED_MAX / per_px.max(1e-9);
    let width_px = most.clamp(f64::from(thinnest_px), f64::from(widest_px));
    Ok(OpenEdges { width_px: step(width_px), opacity: step((most / width_px.max(1e-9)).clamp(OPACITY_MIN, 1.0)) })
}
