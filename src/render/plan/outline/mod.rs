//! The hull: an outline around surfaces, drawn as a mesh of triangles that is made for one view.
//!
//! Users know inverted hulls, copies of a mesh pushed out along its normals. This outline mesh
//! differs: a plan knows its camera, so it makes the border itself, as wide as it should be and
//! with round corners. Beside each visible part of a [silhouette edge](silhouette_edges), where a
//! surface ends on screen, lies an [offset quad](build), and around the vertices between two of them
//! a [round join](round_join).
//!
//! Contours, the outlines that are drawn as lines, come from the same silhouette edges ([`parts`]).

pub(crate) mod build;
pub(crate) mod chains;
pub(crate) mod hidden_directions;
mod outer_side;
pub(crate) mod parts;
pub(crate) mod round_join;
pub(crate) mod screen_edges;
pub(crate) mod silhouette_edges;
mod sort;
pub(crate) mod visible_parts;

pub use build::hull_pass;

use super::shared_slice::SharedSlice;

/// Triangles beside the edges where a surface ends in this view. They are drawn from both sides,
/// and surfaces before them hide them.
#[derive(Clone, Debug, Default)]
pub struct HullPass<'a> {
    /// Premultiplied linear RGBA, by material index; one where all are the same.
    pub colors: Vec<[f32; 4]>,
    /// Corners that are not the mesh's.
    pub vertices: Vec<ScreenVertex>,
    /// Indices into the plan's positions, followed by `vertices`. Those into the positions lie
    /// before the near plane and not far outside the picture, so nothing needs clipping.
    pub triangles: Vec<[u32; 3]>,
    /// A material index per triangle of the plan; empty where all are the same. Unlike the
    /// surface's materials, equal ones are not merged: the index also says what hides which hull,
    /// see [`PeelingPass`](super::PeelingPass).
    pub surface_materials: SharedSlice<'a, u32>,
    /// A material index per triangle of the hull; empty where all are the same.
    pub triangle_materials: Vec<u32>,
}

/// A vertex on screen, as back-ends have it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ScreenVertex {
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
    /// The material of an id in the visibility buffer, whether the plan's or the hull's triangle.
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

/// A point on screen: x and y in 1/256 px, reversed depth, 1 / W. All of these are affine along an
/// edge and across a face.
type ScreenPoint = [f64; 4];

impl ScreenVertex {
    /// The vertex at a point, which lies in the guard band.
    fn snapped([x, y, z, inv_w]: ScreenPoint) -> Self {
        // The clamp is never reached, but NaN must become a number here.
        let round = |v: f64| libm::rint(v).clamp(-1_048_576.0, 1_048_576.0) as i32;
        Self { x: round(x), y: round(y), z: z as f32, inv_w: inv_w as f32 }
    }
}

/// The end of a silhouette edge beside which an offset quad lies.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeEnd {
    /// The vertex where the edge ends.
    vertex: u32,
    /// The quad's outer corner there; None where no quad is drawn.
    outer: Option<u32>,
    /// The material whose outline it is.
    material: u32,
    /// The free side of the edge, seen from this end: 1 where angles grow, else -1.
    free: i8,
    /// Direction in which the edge leaves, radians.
    angle: f64,
    /// Angle from there to the outer corner's direction, positive.
    turn: f64,
    /// The end on screen, 1/256 px.
    middle: [f64; 2],
    /// Distance from the middle to the outer corner, 1/256 px.
    reach: f64,
    /// Depth of the outer corner.
    depth: f64,
    /// 1 / W
    inv_w: f64,
    /// Change of depth along the edge, away from here, per 1/256 px.
    slope: f64,
    /// True if a face of the vertex hides the edge.
    is_hidden: bool,
}
