//! The uniforms of shaders/common.wgsl, field for field.

use bytemuck::{Pod, Zeroable};

use crate::plan::{DrawPlan, Faces, HullOffset, Lights, LinePass, Shown, SurfacePass};

/// The plan's numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Frame {
    x_row: [f32; 4],
    y_row: [f32; 4],
    z_row: [f32; 4],
    w_row: [f32; 4],
    screen_up: [f32; 4],
    lamps: [[f32; 4]; Lights::LAMPS_MAX],
    halfways: [[f32; 4]; Lights::LAMPS_MAX],
    background: [f32; 4],
    hull_color: [f32; 4],
    near_w: f32,
    hull_push: f32,
    ambient: f32,
    lamp_count: u32,
    line_pass_count: u32,
    zero: u32,
    width: u32,
    height: u32,
    triangle_count: u32,
    vertex_count: u32,
    hull_base: u32,
    masks_at: u32,
    material_count: u32,
    /// WGSL rounds a struct up to its alignment.
    padding: [u32; 3],
}

/// A dispatch's numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
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
    pub line_width: f32,
    pub line_smoothing: f32,
    pub line_flags: u32,
    pub ink_at: u32,
    pub owners_at: u32,
}

/// Bits of [`Batch::line_flags`].
pub fn line_flags(lines: &LinePass, something_hides: bool, lights_lines: bool) -> u32 {
    // Where there is no surface there is nothing to hide behind, and no samples to ask.
    let shown = match lines.shown {
        Shown::All => 0,
        _ if !something_hides => 0,
        Shown::Visible => 1,
        Shown::Hidden => 2,
    };
    shown
        | u32::from(lines.skip_back_edges) << 2
        | u32::from(lines.contour) << 3
        | u32::from(lines.lit && lights_lines) << 4
}

/// Distance between [`Batch`]es in their buffer: every device can bind at multiples of this.
pub const BATCH_STRIDE: usize = 256;

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
            triangle_count: plan.triangles.len() as u32,
            hull_base: plan.positions.len() as u32,
            ..Self::default()
        };
        if let Some(surface) = &plan.surface {
            frame.surface(surface);
        }
        if let Some(hull) = &plan.hull {
            frame.hull_color = hull.colors[0];
            frame.hull_push = match hull.offset {
                HullOffset::Object(units) => units,
                HullOffset::Px(px) => 256.0 * px,
            };
        }
        frame.line_pass_count = plan.lines.len() as u32;
        frame
    }

    fn surface(&mut self, surface: &SurfacePass<'_>) {
        for (i, lamp) in surface.lights.lamps.iter().take(Lights::LAMPS_MAX).enumerate() {
            let [x, y, z] = lamp.to_light;
            self.lamps[i] = [x, y, z, lamp.strength];
            self.halfways[i] = xyz(lamp.halfway);
            self.lamp_count += 1;
        }
        self.ambient = surface.lights.ambient;
        self.material_count = surface.materials.len() as u32;
        self.masks_at = surface.triangle_materials.len() as u32;
    }
}

/// Triangles' materials, then edge masks four to a word: what [`Frame::masks_at`] points into.
pub fn attributes(surface: &SurfacePass<'_>) -> Vec<u8> {
    [bytemuck::cast_slice(surface.triangle_materials), &surface.edge_masks[..]].concat()
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
        assert_eq!(size_of::<Frame>(), 272);
        assert_eq!(size_of::<Batch>(), 72);
    }
}
