//! The uniforms of shaders/common.wgsl, field for field.

use bytemuck::{Pod, Zeroable};

use crate::plan::{DrawPlan, Faces, HullOffset};

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
    edge_count: u32,
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
}

/// Distance between [`Batch`]es in their buffer: every device can bind at multiples of this.
pub const BATCH_STRIDE: usize = 256;

mod flags {
    pub const SURFACE: u32 = 1;
    pub const HULL: u32 = 2;
    pub const HULL_PX: u32 = 4;
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
            vertex_count: plan.positions.len() as u32,
            ..Self::default()
        };
        if plan.surface.is_some() {
            frame.flags |= flags::SURFACE;
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
        frame
    }
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
        assert_eq!(size_of::<Batch>(), 48);
    }

    #[test]
    fn flags_are_those_of_the_shader() {
        let shader = include_str!("../../../shaders/common.wgsl");
        for (name, value) in [("SURFACE", flags::SURFACE), ("HULL", flags::HULL), ("HULL_PX", flags::HULL_PX)] {
            assert!(shader.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
        }
    }
}
