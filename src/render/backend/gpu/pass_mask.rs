//! The passes over triangles by which the stages visibility and peeling find what can be seen: one over the
//! triangles of the surface and one over those of the outline mesh. A pass draws into the visibility buffer (the
//! nearest triangle of each sample) or into the layers of depth peeling (what is transparent). The pass mask of a
//! surface triangle, one byte, says into which of these two the triangle is drawn (it may be both), and whether only
//! one of its sides is. Without masks, the surface is drawn into the visibility buffer alone.

use std::ops::Range;

use crate::plan::{DrawPlan, Faces, pass_mask};

/// Triangles of one pass.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Its index.
    pub ids: Range<u32>,
    /// True if any of them may need clipping.
    pub clip: bool,
    /// Drawn faces, unless a triangle's pass mask overrides them.
    pub faces: Faces,
    /// Bit that a triangle's pass mask must have; 0 for the outline mesh, which has no masks.
    pub pass_bit: u8,
}

impl Pass {
    /// The passes of the visibility buffer.
    pub fn of_visibility(plan: &DrawPlan<'_>) -> [Option<Self>; 2] {
        [Self::surface(plan, pass_mask::SURFACE), Self::hull(plan).filter(|_| !plan.has_peeled_hull())]
    }

    /// The passes of depth peeling. Without pass masks no surface is peeled.
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
