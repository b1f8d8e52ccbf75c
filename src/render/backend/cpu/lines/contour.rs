//! The decision whether an edge is drawn in this view (stage lines). A pass of contours keeps only silhouettes, the
//! edges at which the surface ends on screen or turns away. An edge is dropped if all its faces show the viewer a
//! side that is known to be hidden, as the inside of a closed surface is ([`LinePass::unseen_side`]). Also the choice
//! of the face that lights an edge's line. Twin of `shaders/lines/contour.wgsl`.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous};
use crate::backend::cpu::geometry::visibility::area;
use crate::plan::{Edge, FaceSide, LinePass};

/// True if the pass draws the edge in this view: not on the far side of a closed surface, and for a
/// contour only the silhouette.
#[inline(always)]
pub fn is_drawn(context: &RasterContext<'_>, lines: &LinePass, edge: &Edge) -> bool {
    // For a contour, a face seen edge-on counts as hidden too: its line would coincide with that of
    // the visible side.
    let is_hidden = |face| context.faces_away(lines, face) || (lines.contour && context.is_edge_on(face));
    if lines.unseen_side.is_some() && edge.faces.into_iter().all(is_hidden) {
        return false;
    }
    !lines.contour || context.is_silhouette(edge)
}

impl RasterContext<'_> {
    /// The face whose light falls on an edge's line where the pixel sees no surface, plus 1: of
    /// those that look at the viewer the one with the highest id, so that the order of edges
    /// does not matter; of any, where none does.
    pub fn lighting_face(&self, lines: &LinePass, edge: &Edge) -> u32 {
        let towards = |face: u32| if self.faces_away(lines, face) { 0 } else { face + 1 };
        let best = towards(edge.faces[0]).max(towards(edge.faces[1]));
        if best > 0 { best } else { edge.faces[0].wrapping_add(1) }
    }

    /// True if a face certainly faces away. A missing face does.
    #[inline(always)]
    fn faces_away(&self, lines: &LinePass, face: u32) -> bool {
        if face == Edge::NO_FACE {
            return true;
        }
        let is_inside_out = lines.unseen_side == Some(FaceSide::Front);
        self.area_of(face).is_some_and(|area| area != 0 && (area < 0) == is_inside_out)
    }

    /// True if a face has no area on screen.
    fn is_edge_on(&self, face: u32) -> bool {
        self.area_of(face) == Some(0)
    }

    /// A face's area on screen, if all of its corners are there.
    #[inline(always)]
    fn area_of(&self, face: u32) -> Option<i64> {
        let vertices = self.screen_triangle(face);
        (!vertices.iter().any(ScreenVertex::is_outside)).then(|| area(&vertices))
    }

    /// True if all faces lie on one side of the edge on screen: there the surface ends, or turns
    /// back under itself. The winding of faces does not matter.
    pub fn is_silhouette(&self, edge: &Edge) -> bool {
        // Without a second face the surface ends here, even if the first is seen edge-on.
        if edge.faces[1] == Edge::NO_FACE {
            return true;
        }
        let [a, b] = self.sides_on_screen(edge).unwrap_or_else(|| edge.faces.map(|face| self.side_of(edge, face)));
        (a < 0 || b < 0) != (a > 0 || b > 0)
    }

    /// As [`side_of`](Self::side_of) finds them, of two faces of the mesh that are wholly on screen.
    #[inline(always)]
    fn sides_on_screen(&self, edge: &Edge) -> Option<[i32; 2]> {
        let [a, b] = edge.vertices;
        let [start, end] = [self.vertices[a as usize], self.vertices[b as usize]];
        let along = [i64::from(end.x) - i64::from(start.x), i64::from(end.y) - i64::from(start.y)];
        let mut is_outside = start.is_outside() | end.is_outside();
        let mut sides = [0; 2];
        for (side, face) in sides.iter_mut().zip(edge.faces) {
            let [p, q, r] = *self.plan.triangles.get(face as usize)?;
            // The corner that is not of the edge.
            let third = *self.vertices.get((p ^ q ^ r ^ a ^ b) as usize)?;
            is_outside |= third.is_outside();
            let to_third = [i64::from(third.x) - i64::from(start.x), i64::from(third.y) - i64::from(start.y)];
            *side = (along[0] * to_third[1] - along[1] * to_third[0]).signum() as i32;
        }
        (!is_outside).then_some(sides)
    }

    /// Side of the edge on which a face lies on screen: -1, 1, or 0 if it is seen edge-on or is
    /// missing.
    fn side_of(&self, edge: &Edge, face: u32) -> i32 {
        if face == Edge::NO_FACE {
            return 0;
        }
        let [a, b] = edge.vertices;
        let [p, q, r] = self.plan.triangles[face as usize];
        let is_end = |v| v == a || v == b;
        let corners = [
            a,
            b,
            if !is_end(p) {
                p
            } else if !is_end(q) {
                q
            } else {
                r
            },
        ];
        let vertices = corners.map(|v| self.vertices[v as usize]);
        if !vertices.iter().any(ScreenVertex::is_outside) {
            return area(&vertices).signum() as i32;
        }
        // With a corner behind the eye, the side of the face's plane on which the eye is decides.
        let corners = corners.map(|v| homogeneous(&self.plan.projection, self.plan.positions[v as usize]));
        let volume = volume(&corners);
        i32::from(volume > 0.0) - i32::from(volume < 0.0)
    }
}

/// Six times the volume that three points on screen, times W, span with the eye: its sign is right
/// for points behind the eye too.
pub fn volume([a, b, c]: &[[f32; 4]; 3]) -> f32 {
    let (x, y, w) = (a[1] * b[3] - a[3] * b[1], a[3] * b[0] - a[0] * b[3], a[0] * b[1] - a[1] * b[0]);
    (x * c[0] + y * c[1]) + w * c[3]
}
