//! Which triangles go where: the GPU's side of a plan's roles.

use crate::plan::{DrawPlan, Faces, roles};

/// Triangles that are drawn for the same reason.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// Added to a triangle's index to get its id.
    pub id_base: u32,
    /// Added to a vertex index to get its record.
    pub vertex_base: u32,
    /// Which side, unless a triangle's role says.
    pub faces: Faces,
    /// The role that triangles must have.
    pub role: u8,
}

impl Pass {
    /// What goes into the visibility buffer.
    pub fn of_surface(plan: &DrawPlan<'_>) -> [Option<Self>; 2] {
        [Self::surface(plan, roles::SURFACE), Self::hull(plan).filter(|_| !plan.has_layered_hull())]
    }

    /// What goes into the layers. Without roles, no surface does.
    pub fn of_layers(plan: &DrawPlan<'_>) -> [Option<Self>; 2] {
        let surface = Self::surface(plan, roles::LAYER).filter(|_| !plan.roles.is_empty());
        [surface, Self::hull(plan).filter(|_| plan.has_layered_hull())]
    }

    fn surface(plan: &DrawPlan<'_>, role: u8) -> Option<Self> {
        plan.surface.as_ref().map(|s| Self { id_base: 0, vertex_base: 0, faces: s.faces, role })
    }

    fn hull(plan: &DrawPlan<'_>) -> Option<Self> {
        let (id_base, vertex_base) = (plan.triangles.len() as u32, plan.positions.len() as u32);
        plan.hull.as_ref().map(|_| Self { id_base, vertex_base, faces: Faces::Back, role: roles::HULL })
    }
}
