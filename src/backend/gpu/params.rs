//! The uniforms of shaders/common.wgsl, field for field.

use bytemuck::{Pod, Zeroable};

use crate::plan::{DrawPlan, Faces, HullOffset, LinePass, Normals, SurfacePass};

/// The plan's numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Frame {
    x_row: [f32; 4],
    y_row: [f32; 4],
    z_row: [f32; 4],
    w_row: [f32; 4],
    screen_up: [f32; 4],
    to_light: [f32; 4],
    halfway: [f32; 4],
    background: [f32; 4],
    hull_color: [f32; 4],
    wire_color: [f32; 4],
    line_color: [f32; 4],
    near_w: f32,
    hull_push: f32,
    metallic: f32,
    roughness: f32,
    intensity: f32,
    ambient: f32,
    wire_thickness: f32,
    wire_smoothing: f32,
    line_width: f32,
    line_smoothing: f32,
    zero: u32,
    flags: u32,
    width: u32,
    height: u32,
    samples: u32,
    triangle_count: u32,
    vertex_count: u32,
    hull_base: u32,
    materials_at: u32,
    masks_at: u32,
}

/// A dispatch's numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Batch {
    pub first: u32,
    pub count: u32,
    pub id_base: u32,
    pub vertex_base: u32,
    pub faces: u32,
    pub row_first: u32,
    pub row_end: u32,
    pub capacity: u32,
    pub large_first: u32,
    pub large_end: u32,
    pub huge_first: u32,
    pub huge_end: u32,
    pub edges_per_group: u32,
}

/// Distance between [`Batch`]es in their buffer: every device can bind at multiples of this.
pub const BATCH_STRIDE: usize = 256;

mod flags {
    pub const SURFACE: u32 = 1;
    pub const HULL: u32 = 2;
    pub const HULL_PX: u32 = 4;
    pub const FACE_NORMALS: u32 = 8;
    pub const VERTEX_NORMALS: u32 = 16;
    pub const FWIDTH: u32 = 32;
    pub const TRIANGLE_MATERIALS: u32 = 64;
    pub const EDGE_MASKS: u32 = 128;
    pub const LINES: u32 = 256;
    pub const LINES_HIDDEN: u32 = 512;
    pub const LINES_SKIP_BACK: u32 = 1024;
}

impl Frame {
    /// The numbers of a plan.
    pub fn new(plan: &DrawPlan<'_>) -> Self {
        let p = &plan.projection;
        let mut frame = Self {
            x_row: p.x,
            y_row: p.y,
            z_row: p.z,
            w_row: p.w,
            near_w: p.near_w,
            screen_up: xyz(p.screen_up),
            background: plan.background,
            width: plan.width_px,
            height: plan.height_px,
            samples: plan.samples,
            triangle_count: plan.triangles.len() as u32,
            hull_base: plan.positions.len() as u32,
            ..Self::default()
        };
        if let Some(surface) = &plan.surface {
            frame.surface(plan, surface);
        }
        if let Some(hull) = &plan.hull {
            frame.flags |= flags::HULL;
            frame.hull_color = hull.color;
            match hull.offset {
                HullOffset::Object(units) => frame.hull_push = units,
                HullOffset::Px(px) => {
                    frame.flags |= flags::HULL_PX;
                    frame.hull_push = 256.0 * px;
                }
            }
        }
        if let Some(lines) = &plan.lines {
            frame.lines(plan, lines);
        }
        frame
    }

    fn surface(&mut self, plan: &DrawPlan<'_>, surface: &SurfacePass<'_>) {
        self.flags |= flags::SURFACE;
        self.flags |= match surface.normals {
            Normals::None => 0,
            Normals::Face(_) => flags::FACE_NORMALS,
            Normals::Vertex { .. } => flags::VERTEX_NORMALS,
        };
        self.metallic = surface.metallic;
        self.roughness = surface.roughness;
        self.intensity = surface.intensity;
        self.ambient = surface.ambient;
        self.to_light = xyz(surface.to_light);
        self.halfway = xyz(surface.halfway);
        self.materials_at = surface.material_colors.len() as u32 * 4;
        self.masks_at = self.materials_at + surface.triangle_materials.len() as u32;
        if surface.triangle_materials.len() == plan.triangles.len() {
            self.flags |= flags::TRIANGLE_MATERIALS;
        }
        if let Some(wire) = &surface.fwidth {
            self.flags |= flags::FWIDTH;
            self.wire_color = wire.color;
            self.wire_thickness = wire.thickness;
            self.wire_smoothing = wire.smoothing;
            if wire.edge_masks.len() == plan.triangles.len() {
                self.flags |= flags::EDGE_MASKS;
            }
        }
    }

    fn lines(&mut self, plan: &DrawPlan<'_>, lines: &LinePass) {
        self.flags |= flags::LINES;
        self.line_color = lines.color;
        self.line_width = lines.width_px;
        self.line_smoothing = lines.smoothing_px;
        // Where there is no surface there is nothing to hide behind, and no samples to ask.
        if lines.hide_behind_surface && (plan.surface.is_some() || plan.hull.is_some()) {
            self.flags |= flags::LINES_HIDDEN;
        }
        if lines.skip_back_edges {
            self.flags |= flags::LINES_SKIP_BACK;
        }
    }
}

/// Material colours, then triangles' materials, then edge masks four to a word: what [`Frame::materials_at`] and
/// `masks_at` point into.
pub fn attributes(surface: &SurfacePass<'_>) -> Vec<u8> {
    let masks = surface.fwidth.as_ref().map_or(&[][..], |wire| wire.edge_masks);
    let colors: &[u8] = bytemuck::cast_slice(&surface.material_colors);
    [colors, bytemuck::cast_slice(surface.triangle_materials), masks].concat()
}

fn xyz(v: [f32; 3]) -> [f32; 4] {
    [v[0], v[1], v[2], 0.0]
}

/// The shaders' code for a choice of faces.
pub fn faces_code(faces: Faces) -> u32 {
    match faces {
        Faces::Both => 0,
        Faces::Front => 1,
        Faces::Back => 2,
    }
}

/// The batches, each at a multiple of [`BATCH_STRIDE`].
pub fn pack(batches: &[Batch]) -> Vec<u8> {
    let mut bytes = vec![0; batches.len().max(1) * BATCH_STRIDE];
    for (batch, slot) in batches.iter().zip(bytes.chunks_exact_mut(BATCH_STRIDE)) {
        slot[..size_of::<Batch>()].copy_from_slice(bytemuck::bytes_of(batch));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_the_shader() {
        assert_eq!(size_of::<Frame>(), 256);
        assert_eq!(size_of::<Batch>(), 52);
    }

    #[test]
    fn flags_are_those_of_the_shader() {
        let shader = include_str!("../../../shaders/common.wgsl");
        let all = [
            ("SURFACE", flags::SURFACE),
            ("HULL", flags::HULL),
            ("HULL_PX", flags::HULL_PX),
            ("FACE_NORMALS", flags::FACE_NORMALS),
            ("VERTEX_NORMALS", flags::VERTEX_NORMALS),
            ("FWIDTH", flags::FWIDTH),
            ("TRIANGLE_MATERIALS", flags::TRIANGLE_MATERIALS),
            ("EDGE_MASKS", flags::EDGE_MASKS),
            ("LINES", flags::LINES),
            ("LINES_HIDDEN", flags::LINES_HIDDEN),
            ("LINES_SKIP_BACK", flags::LINES_SKIP_BACK),
        ];
        for (name, value) in all {
            assert!(shader.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
        }
    }
}
