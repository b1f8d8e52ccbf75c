//! A special case of hidden lines: edges that lie in the plane of a triangle and whose own faces all lie behind it
//! (stage lines). Such a triangle hides the edge, too, except close to the triangle's sides, and in meshes in which
//! an edge has more than two faces. Twin of `shaders/lines/coplanar.wgsl`.
//!
//! An example is the edge at which a wall stands on a floor: it lies in the floor's plane. Seen from above the edge
//! is visible, and hidden-line removal keeps it however depths are rounded. Seen from below, the floor hides the
//! wall. So it has to hide the edge too, though both have the same depth.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::steepness::{Corner, NEARER_RATIO, sides};
use crate::backend::cpu::geometry::transform::recip;
use crate::plan::Edge;

/// Least distance of an edge from the triangle's sides, 1/256 px. A closer edge may be one of the triangle itself, or of
/// a neighbour that has vertices of its own.
pub const SIDE_MARGIN: f32 = 4.0;

/// Share of positions by which rounding may move them out of a triangle's plane: some units of f32's last place.
pub const IN_PLANE: f32 = 1.0 / 2_097_152.0;

/// A triangle on screen that may hide an edge.
pub struct HidingTriangle {
    pub id: u32,
    /// Times their W.
    pub corners: [Corner; 3],
    pub is_clockwise: bool,
    /// Depth error of its plane due to snapping.
    pub slack: f32,
}

impl HidingTriangle {
    /// True if an edge lies in the triangle's plane, and all of its faces on the side that the viewer does not see. The
    /// middle of the part that is inside the triangle on screen has these weights.
    ///
    /// False for lines and points without faces, which are painted on both sides, and in a plan with edges that have
    /// more than two faces: those do not name all of them.
    pub fn has_beneath(&self, context: &RasterContext<'_>, edge: &Edge, middle: [f32; 3]) -> bool {
        let [first, second] = edge.faces;
        (context.plan.names_all_faces && first != Edge::NO_FACE)
            && self.is_inside(middle)
            && self.is_plane_of(context, edge)
            && self.hides_face(context, edge, first)
            && (second == Edge::NO_FACE || self.hides_face(context, edge, second))
    }

    /// True if a point on screen is farther from all sides than rounding moves them: all is times the W of two corners.
    fn is_inside(&self, weights: [f32; 3]) -> bool {
        (0..3).all(|k| {
            let (a, b) = (self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]);
            let length = |i: usize| (a[i] * b[3] - b[i] * a[3]).abs();
            weights[k] > SIDE_MARGIN * (length(0) + length(1))
        })
    }

    /// True if an edge lies in the triangle's plane, by the positions themselves: on screen, planes are known less
    /// exactly. No hull's triangle has such an edge.
    fn is_plane_of(&self, context: &RasterContext<'_>, edge: &Edge) -> bool {
        let (triangles, positions) = (&context.plan.triangles, &context.plan.positions);
        let Some(triangle) = triangles.get(self.id as usize) else { return false };
        let [p, q, r] = triangle.map(|v| positions[v as usize]);
        let from_p = |v: [f32; 3]| [v[0] - p[0], v[1] - p[1], v[2] - p[2]];
        let (q, r) = (from_p(q), from_p(r));
        let normal = [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]];
        let length = |v: [f32; 3]| (v[0].abs() + v[1].abs()) + v[2].abs();
        let (area, longest) = (length(normal), length(q).max(length(r)));
        edge.vertices.iter().all(|&v| {
            let v = positions[v as usize];
            let to_v = from_p(v);
            let distance = ((normal[0] * to_v[0] + normal[1] * to_v[1]) + normal[2] * to_v[2]).abs();
            // Rounding of positions, times the area, and how the farther away the more it tilts the plane.
            distance <= (IN_PLANE * (length(p) + length(v))) * (area + length(to_v) * longest)
        })
    }

    /// True if the third corner of an edge's face surely lies behind the triangle's plane.
    fn hides_face(&self, context: &RasterContext<'_>, edge: &Edge, face: u32) -> bool {
        let [a, b] = edge.vertices;
        let Some(third) = context.triangle(face).into_iter().find(|&v| v != a && v != b) else { return false };
        let third = context.vertices[third as usize];
        if third.is_outside() {
            return false;
        }
        let [p, q, r] = sides(&self.corners, [third.x as f32, third.y as f32], self.is_clockwise);
        let [a, b, c] = &self.corners;
        let w = (p * a[3] + q * b[3]) + r * c[3];
        if w <= f32::MIN_POSITIVE {
            return false;
        }
        let share = recip(w);
        let depth = ((p * a[2] + q * b[2]) + r * c[2]) * share;
        // The farther from the triangle, the more its corners' rounding moves the plane.
        let reach = (((p * a[3]).abs() + (q * b[3]).abs()) + (r * c[3]).abs()) * share;
        depth - third.z > reach * (2.0 * self.slack + third.z * (NEARER_RATIO - 1.0))
    }
}
