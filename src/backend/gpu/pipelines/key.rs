//! What a plan has: the shaders' `LOOK`, a constant of each pipeline, so that a kernel contains only what its plan needs.

use crate::plan::{DrawPlan, SurfacePass, flags};

pub const SURFACE: u32 = 1;
pub const HULL: u32 = 2;
pub const FACE_NORMALS: u32 = 8;
pub const VERTEX_NORMALS: u32 = 16;
pub const WIRES: u32 = 32;
pub const TRIANGLE_MATERIALS: u32 = 64;
pub const EDGE_MASKS: u32 = 128;
pub const LINES: u32 = 256;
pub const CLIPPED: u32 = 2048;
pub const EIGHT_SAMPLES: u32 = 512;
pub const SIXTEEN_SAMPLES: u32 = 1024;
pub const FOUR_SAMPLES: u32 = 4096;
/// How many samples a pixel has.
pub const SAMPLES: u32 = FOUR_SAMPLES | EIGHT_SAMPLES | SIXTEEN_SAMPLES;
pub const LIT_LINES: u32 = 8192;
pub const CONTOURS: u32 = 16384;
pub const ROLES: u32 = 0x10_0000;
pub const HULL_LOOKS: u32 = 0x40_0000;
pub const LAYERS: u32 = 0x80_0000;
pub const BEHIND_SURFACE: u32 = 0x100_0000;
pub const WIRES_ONLY: u32 = 0x200_0000;
pub const LAYERED_HULL: u32 = 0x400_0000;
pub const DERIVATIVE_NORMALS: u32 = 1 << 16;
pub const VERTEX_COLORS: u32 = 1 << 17;
pub const UVS: u32 = 1 << 18;
pub const TEXTURES: u32 = 1 << 19;
pub const WIRE_MINIMUM: u32 = 0x800_0000;
pub const WIRE_LIT: u32 = 0x1000_0000;
pub const DEBUG: u32 = 0x2000_0000;
pub const VARYING: u32 = 0x4000_0000;

/// The flags of a plan.
pub fn look(plan: &DrawPlan<'_>) -> u32 {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let count = plan.triangles.len();
    let mut look = when(plan.projection.clip, CLIPPED) | samples(plan.samples);
    if let Some(surface) = &plan.surface {
        let all = surface.all_flags();
        look |= when(surface.is_shaded, SURFACE) | when(surface.triangle_materials.len() == count, TRIANGLE_MATERIALS);
        look |= when(all & flags::FACE_NORMALS != 0, FACE_NORMALS);
        look |= when(all & flags::VERTEX_NORMALS != 0, VERTEX_NORMALS);
        look |= varying(surface, all);
        look |= when(all & flags::WIRES != 0, WIRES) | when(surface.edge_masks.len() == count, EDGE_MASKS);
    }
    if let Some(hull) = &plan.hull {
        look |= HULL | when(!hull.triangle_materials.is_empty(), HULL_LOOKS);
        look |= when(plan.has_peeled_hull(), LAYERED_HULL);
    }
    look |= when(plan.pass_masks.len() == count && count > 0, ROLES);
    if let Some(layers) = plan.peeling() {
        look |= LAYERS | when(layers.behind_surface, BEHIND_SURFACE) | when(layers.wires_only, WIRES_ONLY);
    }
    look | when(!plan.lines.is_empty(), LINES)
        | when(plan.lines.iter().any(|lines| lines.contour), CONTOURS)
        | when(plan.lights_lines(), LIT_LINES)
}

fn samples(count: u32) -> u32 {
    match count {
        1 => 0,
        4 => FOUR_SAMPLES,
        8 => EIGHT_SAMPLES,
        _ => SIXTEEN_SAMPLES,
    }
}

/// What changes over a triangle.
fn varying(surface: &SurfacePass<'_>, all: u32) -> u32 {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let is_textured = (0..4).any(|slot| surface.samples(slot)) && surface.uvs.is_some();
    let by_minimum = flags::WIRE_THRESHOLD | flags::WIRE_BARYCENTRIC | flags::WIRE_FWIDTH_MIN;
    let varies = flags::VERTEX_NORMALS | flags::DERIVATIVE_NORMALS | flags::VERTEX_COLORS | flags::WIRES | flags::DEBUG;
    when(all & flags::DERIVATIVE_NORMALS != 0, DERIVATIVE_NORMALS)
        | when(all & (flags::VERTEX_COLORS | flags::DEBUG) != 0 && surface.colors.is_some(), VERTEX_COLORS)
        | when((is_textured || all & flags::DEBUG != 0) && surface.uvs.is_some(), UVS)
        | when(is_textured, TEXTURES)
        | when(all & by_minimum != 0, WIRE_MINIMUM)
        | when(all & flags::WIRE_LIT != 0, WIRE_LIT)
        | when(all & flags::DEBUG != 0, DEBUG)
        | when(all & varies != 0 || is_textured, VARYING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_those_of_the_shader() {
        let shader = include_str!("../../../../shaders/common.wgsl");
        let all = [
            ("SURFACE", SURFACE),
            ("HULL", HULL),
            ("FACE_NORMALS", FACE_NORMALS),
            ("VERTEX_NORMALS", VERTEX_NORMALS),
            ("WIRES", WIRES),
            ("TRIANGLE_MATERIALS", TRIANGLE_MATERIALS),
            ("EDGE_MASKS", EDGE_MASKS),
            ("LINES", LINES),
            ("CLIPPED", CLIPPED),
            ("EIGHT_SAMPLES", EIGHT_SAMPLES),
            ("SIXTEEN_SAMPLES", SIXTEEN_SAMPLES),
            ("FOUR_SAMPLES", FOUR_SAMPLES),
            ("LIT_LINES", LIT_LINES),
            ("CONTOURS", CONTOURS),
            ("ROLES", ROLES),
            ("HULL_LOOKS", HULL_LOOKS),
            ("LAYERS", LAYERS),
            ("BEHIND_SURFACE", BEHIND_SURFACE),
            ("WIRES_ONLY", WIRES_ONLY),
            ("LAYERED_HULL", LAYERED_HULL),
            ("DERIVATIVE_NORMALS", DERIVATIVE_NORMALS),
            ("VERTEX_COLORS", VERTEX_COLORS),
            ("UVS", UVS),
            ("TEXTURES", TEXTURES),
            ("WIRE_MINIMUM", WIRE_MINIMUM),
            ("WIRE_LIT", WIRE_LIT),
            ("DEBUG", DEBUG),
            ("VARYING", VARYING),
        ];
        for (name, value) in all {
            let ways = [format!("const {name}: u32 = {value}u;"), format!("const {name}: u32 = {value:#X}u;")];
            assert!(ways.iter().any(|way| shader.contains(&way.replace("0X", "0x"))), "{name}");
        }
    }
}
