//! The pipeline key: bits for the features of a plan (what is to be drawn for one picture) that decide which code
//! draws it, such as textures, lines or the number of samples, and one bit for gangs.
//!
//! The bits on which a kernel depends are the constant `PIPELINE_KEY` of its pipeline, so that the pipeline contains
//! only the code that its plan needs.

use crate::plan::{DrawPlan, SurfacePass, flags, slots};

/// A shaded surface.
pub const SURFACE: u32 = 1;
/// An outline mesh.
pub const HULL: u32 = 2;
/// The jobs of a gang share the kernel. No feature of a plan: the code that draws a gang sets it.
pub const GANG: u32 = 4;
/// A material lit by face normals.
pub const FACE_NORMALS: u32 = 8;
/// A material lit by vertex normals.
pub const VERTEX_NORMALS: u32 = 16;
/// A material with barycentric wires.
pub const WIRES: u32 = 32;
/// A material index per triangle.
pub const TRIANGLE_MATERIALS: u32 = 64;
/// An edge mask per triangle.
pub const EDGE_MASKS: u32 = 128;
/// Line passes.
pub const LINES: u32 = 256;
/// Triangles may need clipping.
pub const CLIPPED: u32 = 2048;
/// 8 samples per pixel.
pub const EIGHT_SAMPLES: u32 = 512;
/// 16 samples per pixel.
pub const SIXTEEN_SAMPLES: u32 = 1024;
/// 4 samples per pixel; without any of the three it is 1.
pub const FOUR_SAMPLES: u32 = 4096;
/// A line pass is lit.
pub const LIT_LINES: u32 = 8192;
/// A line pass is a contour.
pub const CONTOURS: u32 = 16384;
/// Holes in faces tell what a line pass covers.
pub const HOLED: u32 = 32768;
/// A pass mask per triangle.
pub const PASS_MASKS: u32 = 0x10_0000;
/// Hollows go without some of the light.
pub const OCCLUSION: u32 = 0x20_0000;
/// A material index per triangle of the outline mesh.
pub const HULL_MATERIALS: u32 = 0x40_0000;
/// Depth peeling.
pub const PEELING: u32 = 0x80_0000;
/// Peeled layers behind the surface show too.
pub const BEHIND_SURFACE: u32 = 0x100_0000;
/// Peeled layers show wires alone.
pub const WIRES_ONLY: u32 = 0x200_0000;
/// The outline mesh is peeled too.
pub const PEELED_HULL: u32 = 0x400_0000;
/// A material lit by derivatives.
pub const DERIVATIVE_NORMALS: u32 = 1 << 16;
/// Vertex colours.
pub const VERTEX_COLORS: u32 = 1 << 17;
/// Texture coordinates.
pub const UVS: u32 = 1 << 18;
/// Textures.
pub const TEXTURES: u32 = 1 << 19;
/// Wires by the smallest coordinate.
pub const WIRE_MINIMUM: u32 = 0x800_0000;
/// Wires under the light.
pub const WIRE_LIT: u32 = 0x1000_0000;
/// A debug view.
pub const DEBUG: u32 = 0x2000_0000;
/// Colours vary over a triangle.
pub const VARYING: u32 = 0x4000_0000;
/// Some pixels are mixed.
pub const ADAPTIVE: u32 = 0x8000_0000;

/// The key of a plan.
pub fn pipeline_key(plan: &DrawPlan<'_>) -> u32 {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let count = plan.triangles.len();
    let mut key = when(plan.projection.clip, CLIPPED) | samples(plan.samples);
    if let Some(surface) = &plan.surface {
        let all = surface.all_flags();
        key |= when(surface.is_shaded, SURFACE) | when(surface.triangle_materials.len() == count, TRIANGLE_MATERIALS);
        key |= when(all & flags::FACE_NORMALS != 0, FACE_NORMALS);
        key |= when(all & (flags::VERTEX_NORMALS | flags::BY_ANGLE) != 0, VERTEX_NORMALS);
        key |= varying(surface, all);
        key |= when(all & flags::WIRES != 0, WIRES) | when(surface.edge_masks.len() == count, EDGE_MASKS);
    }
    if let Some(hull) = &plan.hull {
        key |= HULL | when(!hull.triangle_materials.is_empty(), HULL_MATERIALS);
        key |= when(plan.has_peeled_hull(), PEELED_HULL);
    }
    key |= when(plan.pass_masks.len() == count && count > 0, PASS_MASKS);
    if let Some(layers) = plan.peeling() {
        key |= PEELING | when(layers.behind_surface, BEHIND_SURFACE) | when(layers.wires_only, WIRES_ONLY);
    }
    key |= when(plan.occlusion.is_some(), OCCLUSION) | when(plan.has_mixed(), ADAPTIVE);
    key | when(!plan.lines.is_empty(), LINES)
        | when(plan.lines.iter().any(|lines| lines.contour), CONTOURS)
        | when(plan.lights_lines(), LIT_LINES)
        | when(plan.has_holes(), HOLED)
}

fn samples(count: u32) -> u32 {
    match count {
        1 => 0,
        4 => FOUR_SAMPLES,
        8 => EIGHT_SAMPLES,
        _ => SIXTEEN_SAMPLES,
    }
}

/// Bits for colours that vary over a triangle.
fn varying(surface: &SurfacePass<'_>, all: u32) -> u32 {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let is_textured = (0..slots::COUNT).any(|slot| surface.samples(slot)) && surface.uvs.is_some();
    let by_minimum = flags::WIRE_THRESHOLD | flags::WIRE_BARYCENTRIC | flags::WIRE_FWIDTH_MIN;
    let varies = flags::VERTEX_NORMALS
        | flags::DERIVATIVE_NORMALS
        | flags::VERTEX_COLORS
        | flags::WIRES
        | flags::DEBUG
        | flags::BY_ANGLE;
    when(all & flags::DERIVATIVE_NORMALS != 0, DERIVATIVE_NORMALS)
        | when(all & (flags::VERTEX_COLORS | flags::DEBUG) != 0 && surface.colors.is_some(), VERTEX_COLORS)
        | when((is_textured || all & flags::DEBUG != 0) && surface.uvs.is_some(), UVS)
        | when(is_textured, TEXTURES)
        | when(all & by_minimum != 0, WIRE_MINIMUM)
        | when(all & flags::WIRE_LIT != 0, WIRE_LIT)
        | when(all & flags::DEBUG != 0, DEBUG)
        | when(all & varies != 0 || is_textured, VARYING)
}
