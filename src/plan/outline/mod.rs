//! The hull: the outline around a surface, as triangles that are on screen already.

pub(crate) mod build;
pub(crate) mod round_join;
pub(crate) mod silhouette_edges;
pub(crate) mod vertex_occlusion;

pub use build::hull_pass;
/// Triangles beside the edges where a surface ends in this view. They are drawn from both sides, and what lies before them hides them.
///
/// A plan knows its camera, so it need not push a copy of the mesh out and let the depth test find what sticks out on all sides: it
/// draws that border itself, as wide as it should be, with round corners.
#[derive(Clone, Debug, Default)]
pub struct HullPass<'a> {
    /// Premultiplied linear RGBA, by material index; one where all are the same.
    pub colors: Vec<[f32; 4]>,
    /// Corners that are not the mesh's.
    pub vertices: Vec<HullVertex>,
    /// Indices into the plan's positions, followed by `vertices`. Those into the positions lie before the near plane and not far
    /// outside the picture: nothing needs clipping.
    pub triangles: Vec<[u32; 3]>,
    /// Material index a triangle of the mesh; empty where all are the same. Unlike the surface's, never merged because they look alike:
    /// it also says what hides which hull, see [`PeelingPass`](super::PeelingPass).
    pub surface_materials: &'a [u32],
    /// The same of `triangles`.
    pub triangle_materials: Vec<u32>,
}

/// A corner on screen.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct HullVertex {
    /// 1/256 px right of the picture's centre, at most 4096 px.
    pub x: i32,
    /// 1/256 px below the centre, at most 4096 px.
    pub y: i32,
    /// Reversed depth.
    pub z: f32,
    /// 1 / W
    pub inv_w: f32,
}

impl HullPass<'_> {
    /// The material of an id in the visibility buffer, the hull's or not.
    #[inline(always)]
    pub fn material(&self, id: usize) -> u32 {
        let own = || self.triangle_materials.get(id - self.surface_materials.len());
        self.surface_materials.get(id).or_else(own).copied().unwrap_or(0)
    }

    /// The colour of the hull's triangle that has this id.
    #[inline(always)]
    pub fn color(&self, id: usize) -> [f32; 4] {
        let last = self.colors.len().saturating_sub(1);
        self.colors.get((self.material(id) as usize).min(last)).copied().unwrap_or_default()
    }
}

/// How far an outline reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thickness {
    /// In units of the box, as they are at each point's depth.
    Object(f32),
    /// On screen, in pixels.
    Px(f32),
}
