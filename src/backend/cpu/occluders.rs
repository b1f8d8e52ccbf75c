//! Triangles that may hide an edge, remembered from edge to edge.

use super::Stages;
use super::lines::Segment;
use super::samples::NOTHING;
use super::transform::ScreenVertex;
use super::visibility::Setup;
use crate::plan::Edge;

/// A triangle's plane, as a thing that edges may lie behind.
#[derive(Clone, Copy)]
pub struct Plane {
    id: u32,
    vertices: [u32; 3],
    /// Depth at the picture's corner and its change a pixel.
    depth: [f32; 3],
    /// What the surface may fall away over three quarters of a pixel: the curvature between neighbouring faces.
    tolerance: f32,
}

impl Plane {
    fn new(stages: &Stages<'_>, id: u32) -> Self {
        let (vertices, is_hull) = stages.triangle(id);
        // A hull shares its vertices' numbers with the surface, but not their place.
        let vertices = if is_hull { [u32::MAX; 3] } else { vertices };
        let corners = stages.screen_triangle(id);
        let in_front = Self { id, vertices, depth: [f32::INFINITY, 0.0, 0.0], tolerance: 0.0 };
        if corners.iter().any(ScreenVertex::is_outside) {
            return in_front;
        }
        Setup::new(&corners).map_or(in_front, |setup| {
            let [z, gx, gy] = setup.depth;
            let half = [stages.plan.width_px as f32 * 128.0, stages.plan.height_px as f32 * 128.0];
            let corner = z - gx * (setup.x[0] as f32 + half[0]) - gy * (setup.y[0] as f32 + half[1]);
            let (gx, gy) = (256.0 * gx, 256.0 * gy);
            Self { id, vertices, depth: [corner, gx, gy], tolerance: 0.75 * (gx.abs() + gy.abs()) }
        })
    }

    /// Whether this triangle, which is nearer than the edge at a sample close by, really lies in front of it. The plane is
    /// continued to the edge's own point, because close to a fold the sample itself may be nearer without hiding anything.
    ///
    /// `contour_depth` is of a contour the sample's depth (else: none): towards a silhouette the surface falls away faster than its plane: depth there goes with the root of the distance, and the
    /// tangent at any point, continued to the silhouette, comes down only half the way. So the other half is granted: as much
    /// again as the plane falls between the sample and the edge.
    #[inline(always)]
    pub fn hides(&self, edge: &Edge, segment: &Segment, t: f32, depth: f32, contour_depth: Option<f32>) -> bool {
        let point = segment.point(t);
        let plane = self.depth[0] + self.depth[1] * point[0] + self.depth[2] * point[1];
        let fall = contour_depth.map_or(0.0, |sample| (sample - plane).max(0.0));
        plane - fall > depth + self.tolerance && !self.meets(edge, segment, t)
    }

    /// Whether this triangle meets the edge at an end close to `t`: around a vertex, the faces of one fan do not hide each
    /// other's edges. Farther along they may, as a silhouette hides the edges behind it.
    #[inline(always)]
    fn meets(&self, edge: &Edge, segment: &Segment, t: f32) -> bool {
        let close = segment.close_to_ends(t);
        (0..2).any(|end| close[end] && self.vertices.contains(&edge.vertices[end]))
    }
}

/// Planes of triangles seen lately, by the low bits of their id: edges that lie close together look at the same ones.
pub struct PlaneCache(Vec<Plane>);

impl PlaneCache {
    const LEN: usize = 1024;

    /// Knows nothing yet.
    pub fn new() -> Self {
        let unknown = Plane { id: NOTHING, vertices: [0; 3], depth: [0.0; 3], tolerance: 0.0 };
        Self(vec![unknown; Self::LEN])
    }

    /// The triangle's plane.
    #[inline(always)]
    pub fn get(&mut self, stages: &Stages<'_>, id: u32) -> &Plane {
        let slot = &mut self.0[id as usize % Self::LEN];
        if slot.id != id {
            *slot = Plane::new(stages, id);
        }
        slot
    }
}
