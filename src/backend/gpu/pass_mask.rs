//! Which triangles go where: the GPU's side of a plan's roles.

use std::ops::Range;

use crate::plan::{DrawPlan, Faces, pass_mask};

/// Triangles that are drawn for the same reason.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Which.
    pub ids: Range<u32>,
    /// Whether any of them may need clipping.
    pub clip: bool,
    /// Which side, unless a triangle's role says.
    pub faces: Faces,
    /// The role that triangles must have; of a hull's none.
    pub pass_bit: u8,
}

impl Pass {
    /// What goes into the visibility buffer.
    pub fn of_visibility(plan: &DrawPlan<'_>) -> [Option<Self>; 2] {
        [Self::surface(plan, pass_mask::SURFACE), Self::hull(plan).filter(|_| !plan.has_peeled_hull())]
    }

    /// What goes into the layers. Without roles, no surface does.
    pub fn of_peeling(plan: &DrawPlan<'_>) -> [Option<Self>; 2] {
        let surface = Self::surface(plan, pass_mask::LAYER).filter(|_| !plan.pass_masks.is_empty());
        [surface, Self::hull(plan).filter(|_| plan.has_peeled_hull())]
    }

    fn surface(plan: &DrawPlan<'_>, pass_bit: u8) -> Option<Self> {
        let (ids, clip) = (0..plan.triangles.len() as u32, plan.projection.clip);
        plan.surface.as_ref().map(|s| Self { ids, clip, faces: s.faces, pass_bit })
    }

    fn hull(plan: &DrawPlan<'_>) -> Option<Self> {
        let first = plan.triangles.len() as u32;
        plan.hull.as_ref().map(|hull| {
            let ids = first..first + hull.triangles.len() as u32;
            Self { ids, clip: false, faces: Faces::Both, pass_bit: 0 }
        })
    }
}
