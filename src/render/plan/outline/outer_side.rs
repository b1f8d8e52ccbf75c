//! The outer side of an offset quad, the quad that draws the outline beside one silhouette edge. Its
//! place on screen follows from the outline's thickness. Its depth recedes from the viewer, so that
//! surfaces next to the edge hide the outline, and surfaces farther behind do not.

use crate::plan::Edge;
use crate::plan::outline::ScreenPoint;
use crate::plan::outline::screen_edges::{OutlineView, RECEDES, ScreenEdge, Way};
use crate::plan::outline::silhouette_edges::SilhouetteEdge;

/// Largest slope of an outline that follows a face beyond its edge, so that it lies behind what
/// continues that face elsewhere: the other teeth of a gear.
const RECEDES_MAX: f64 = 2.5;

/// Slope of such an outline beyond that of its face.
const RECEDES_MORE: f64 = 0.05;

/// The least depth that is still before the far plane.
const DEPTH_MIN: f64 = 1e-30;

/// The outer side of an edge's outline.
pub struct OuterSide {
    /// The distance from the edge at both ends, 1/256 px.
    pub reach: [f64; 2],
    /// The sine of the angle between the side and the edge.
    pub sine: f64,
    /// Its two corners.
    pub ends: [ScreenPoint; 2],
}

impl OuterSide {
    /// That of an edge; None if its outline has no area.
    pub fn of(view: &OutlineView<'_>, edge: &SilhouetteEdge, place: &ScreenEdge) -> Option<Self> {
        let way = place.way();
        let reach = place.ends.map(|end| view.reach(edge.material, end[3]));
        if way.length < 1e-6 || reach[0].max(reach[1]) <= 0.0 {
            return None;
        }
        let out = f64::from(edge.free);
        // It touches the circles around both ends, of which one may be nearer and larger. Where that circle
        // surrounds the other one, the quad is empty and the nearer end's join reaches around.
        let sine = ((reach[0] - reach[1]) / way.length).clamp(-1.0, 1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        let [right, down] = way.along;
        let normal = [sine * right - cosine * out * down, sine * down + cosine * out * right];
        let depths = depths(view, edge, place.ends, way, normal, reach);
        let ends = [0, 1].map(|k| {
            let at = [0, 1].map(|axis| place.ends[k][axis] + reach[k] * normal[axis]);
            [at[0], at[1], depths[k], place.ends[k][3]]
        });
        Some(Self { reach, sine, ends })
    }

    /// The point at a share of the way from its first corner to its second.
    pub fn at(&self, share: f64) -> ScreenPoint {
        std::array::from_fn(|i| self.ends[0][i] + share * (self.ends[1][i] - self.ends[0][i]))
    }
}

/// Depths of the two corners.
fn depths(
    view: &OutlineView<'_>,
    edge: &SilhouetteEdge,
    ends: [ScreenPoint; 2],
    Way { along: [right, down], length }: Way,
    normal: [f64; 2],
    reach: [f64; 2],
) -> [f64; 2] {
    // Change of depth from the edge outwards, in the plane of the face that recedes most.
    let slope_along = (ends[1][2] - ends[0][2]) / length;
    let out = f64::from(edge.free);
    let slope = |face: u32| {
        let corners = view.view.mesh.triangles.get(face as usize)?;
        let third = corners.iter().find(|v| !edge.vertices.contains(v))?;
        let [x, y, z, w] = view.homogeneous(*third);
        let from = [x / w - ends[0][0], y / w - ends[0][1]];
        let across = out * (right * from[1] - down * from[0]);
        let is_known = w >= view.view.projector.near_w(0.0) && across < -1e-6;
        is_known.then(|| (z / w - ends[0][2] - slope_along * (right * from[0] + down * from[1])) / across)
    };
    let slope = edge.faces.iter().filter(|face| **face != Edge::NO_FACE).filter_map(|face| slope(*face));
    let slope = slope.fold(f64::INFINITY, f64::min);
    let sideways = normal[0] * right + normal[1] * down;
    let outwards = out * (right * normal[1] - down * normal[0]);
    [0, 1].map(|k| {
        let depth = ends[k][2];
        let receding = |slope: f64| view.receding(ends[k], slope, reach[k]);
        let usual = receding(RECEDES);
        let followed = depth + reach[k] * (sideways * slope_along + outwards * slope);
        let depth = if followed < usual && followed > receding(RECEDES_MAX) {
            followed - (depth - receding(RECEDES_MORE))
        } else {
            usual
        };
        depth.max(DEPTH_MIN)
    })
}
