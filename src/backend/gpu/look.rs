//! What a plan has: the shaders' `LOOK`, a constant of each pipeline, so that a kernel contains only what its plan needs.

use crate::plan::{DrawPlan, HullOffset, flags};

pub const SURFACE: u32 = 1;
pub const HULL: u32 = 2;
pub const HULL_PX: u32 = 4;
pub const FACE_NORMALS: u32 = 8;
pub const VERTEX_NORMALS: u32 = 16;
pub const WIRES: u32 = 32;
pub const TRIANGLE_MATERIALS: u32 = 64;
pub const EDGE_MASKS: u32 = 128;
pub const LINES: u32 = 256;
pub const CLIPPED: u32 = 2048;
pub const FOUR_SAMPLES: u32 = 4096;
pub const LIT: u32 = 1 << 20;

/// The flags of a plan.
pub fn look(plan: &DrawPlan<'_>) -> u32 {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let count = plan.triangles.len();
    let mut look = when(plan.projection.clip, CLIPPED) | when(plan.samples == 4, FOUR_SAMPLES);
    if let Some(surface) = &plan.surface {
        let all = surface.all_flags();
        look |= when(surface.is_shaded, SURFACE) | when(surface.triangle_materials.len() == count, TRIANGLE_MATERIALS);
        look |= when(all & flags::FACE_NORMALS != 0, FACE_NORMALS);
        look |= when(all & flags::VERTEX_NORMALS != 0, VERTEX_NORMALS);
        look |= when(all & flags::WIRES != 0, WIRES) | when(surface.edge_masks.len() == count, EDGE_MASKS);
    }
    if let Some(hull) = &plan.hull {
        look |= HULL | when(matches!(hull.offset, HullOffset::Px(_)), HULL_PX);
    }
    look | when(!plan.lines.is_empty(), LINES) | when(plan.lights_lines(), LIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_those_of_the_shader() {
        let shader = include_str!("../../../shaders/common.wgsl");
        let all = [
            ("SURFACE", SURFACE),
            ("HULL", HULL),
            ("HULL_PX", HULL_PX),
            ("FACE_NORMALS", FACE_NORMALS),
            ("VERTEX_NORMALS", VERTEX_NORMALS),
            ("WIRES", WIRES),
            ("TRIANGLE_MATERIALS", TRIANGLE_MATERIALS),
            ("EDGE_MASKS", EDGE_MASKS),
            ("LINES", LINES),
            ("CLIPPED", CLIPPED),
            ("FOUR_SAMPLES", FOUR_SAMPLES),
            ("LIT", LIT),
        ];
        for (name, value) in all {
            assert!(shader.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
        }
    }
}
