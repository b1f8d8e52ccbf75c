//! Spec and mesh to plan.

use super::{DrawPlan, Projection};
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::scene::Spec;

/// Decides what is drawn.
pub fn build<'a>(mesh: &'a Mesh, spec: &Spec, budget: &mut Budget) -> Result<DrawPlan<'a>, LimitExceeded> {
    budget.spend("the picture", u64::from(spec.image.width_px) * u64::from(spec.image.height_px), 4)?;
    Ok(DrawPlan {
        width_px: spec.image.width_px,
        height_px: spec.image.height_px,
        samples: spec.image.samples,
        positions: &mesh.positions,
        triangles: &mesh.triangles,
        projection: Projection {
            x: [0.0; 4],
            y: [0.0; 4],
            z: [0.0; 4],
            w: [0.0; 4],
            near_w: 1.0,
            clip: false,
            to_viewer: [0.0; 3],
            screen_up: [0.0; 3],
            screen_right: [0.0; 3],
        },
        surface: None,
        hull: None,
        lines: None,
        background: spec.image.background.premultiplied(),
        skips: Vec::new(),
    })
}
