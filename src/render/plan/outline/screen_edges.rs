//! Silhouette edges on screen, each cut to the part whose outline may be in the picture. How far an
//! outline reaches from its edge, and how deep it lies there, is computed here, too.

use crate::plan::context::PlanContext;
use crate::plan::edges::select::map;
use crate::plan::outline::ScreenPoint;
use crate::plan::outline::silhouette_edges::{ScreenMesh, SilhouetteEdge};
use crate::plan::{PX, PlanError};
use crate::scene::Thickness;

/// The widest outline, pixels: one around something beside the picture still lies in the guard
/// band.
const THICKNESS_MAX_PX: f64 = 1000.0;

/// Slope at which an outline recedes from its edge: length in depth per length across. Surfaces
/// next to the edge hide the outline, and what is farther behind does not.
pub const RECEDES: f64 = 0.5;

/// A silhouette edge on screen.
#[derive(Clone, Copy, Debug, Default, bytemuck::Zeroable)]
pub struct ScreenEdge {
    /// Its two ends.
    pub ends: [ScreenPoint; 2],
    /// True for an end that is the mesh edge's own: it is not cut.
    pub is_whole: [bool; 2],
    /// False if the edge lies behind the near plane, or outside of the picture with its outline.
    pub may_show: bool,
}

/// The way along an edge.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// From the first end to the second: a unit vector, or 0 where the length is.
    pub along: [f64; 2],
    /// 1/256 px.
    pub length: f64,
}

impl ScreenEdge {
    /// The point at a share of the way from the first end to the second.
    pub fn at(&self, share: f64) -> ScreenPoint {
        mix(&self.ends[0], &self.ends[1], share)
    }

    /// The way from the first end to the second.
    pub fn way(&self) -> Way {
        let [a, b] = self.ends;
        let way = [b[0] - a[0], b[1] - a[1]];
        let length = (way[0] * way[0] + way[1] * way[1]).sqrt();
        Way { along: way.map(|v| if length > 0.0 { v / length } else { 0.0 }), length }
    }
}

/// A mesh on screen, and how far the outlines of its materials reach.
pub struct OutlineView<'a> {
    /// The mesh in this view.
    pub view: &'a ScreenMesh<'a>,
    /// Half the size of the picture with its margin, 1/256 px.
    pub half: [f64; 2],
    /// 1/256 px per unit of the box at W = 1.
    pub scale: f64,
    thicknesses: &'a [Option<Thickness>],
    /// Change of Z and W per unit of the box towards the viewer.
    nearer: [f64; 2],
}

impl<'a> OutlineView<'a> {
    /// The view of a picture of this size. `thicknesses` are by material.
    pub fn new(
        view: &'a ScreenMesh<'a>,
        thicknesses: &'a [Option<Thickness>],
        size_px: [u32; 2],
        margin_px: u32,
    ) -> Self {
        let p = view.projection;
        let along = |row: &[f32; 4]| (0..3).map(|k| f64::from(row[k]) * f64::from(p.to_viewer[k])).sum::<f64>();
        let scale = (0..3).map(|k| f64::from(p.x[k]) * f64::from(p.x[k])).sum::<f64>().sqrt();
        let half = size_px.map(|size| 0.5 * PX * f64::from(size + 2 * margin_px));
        Self { view, half, scale, thicknesses, nearer: [along(&p.z), along(&p.w)] }
    }

    /// The distance that a material's outline reaches, 1/256 px.
    pub fn reach(&self, material: u32, inv_w: f64) -> f64 {
        let reach = match self.thicknesses.get(material as usize) {
            Some(Some(Thickness::Px(px))) => PX * f64::from(*px),
            Some(Some(Thickness::Object(units))) => f64::from(*units) * self.scale * inv_w,
            _ => 0.0,
        };
        reach.min(PX * THICKNESS_MAX_PX)
    }

    /// The depth of what lies farther from the viewer than a point, by `slope` times a distance on
    /// screen.
    pub fn receding(&self, [_, _, depth, inv_w]: ScreenPoint, slope: f64, distance: f64) -> f64 {
        let away = slope * distance / (self.scale * inv_w).max(1e-300);
        self.behind(depth, inv_w, away)
    }

    /// The depth of what lies farther by so many units of the box.
    pub fn behind(&self, depth: f64, inv_w: f64, away: f64) -> f64 {
        (depth / inv_w - away * self.nearer[0]) / (1.0 / inv_w - away * self.nearer[1])
    }

    /// The edges on screen.
    pub fn screen_edges(
        &self,
        edges: &[SilhouetteEdge],
        cx: &mut PlanContext<'_>,
    ) -> Result<Vec<ScreenEdge>, PlanError> {
        cx.budget.spend("an outline's edges", edges.len() as u64, size_of::<ScreenEdge>() as u64)?;
        Ok(map(edges, cx.deadline, |edge| self.on_screen(edge).unwrap_or_default())?)
    }

    /// The part of an edge before the near plane whose outline may be in the picture.
    fn on_screen(&self, edge: &SilhouetteEdge) -> Option<ScreenEdge> {
        let near_w = self.view.near_w();
        let [a, b] = edge.vertices.map(|v| self.homogeneous(v));
        let mut is_whole = [true; 2];
        let mut ends = [a, b];
        for k in 0..2 {
            if ends[k][3] < near_w {
                let (inside, outside) = (ends[1 - k], ends[k]);
                if inside[3] < near_w {
                    return None;
                }
                ends[k] = before(near_w, &inside, &outside);
                is_whole[k] = false;
            }
        }
        let points = ends.map(on_screen);
        let margin = points.map(|point| self.reach(edge.material, point[3])).into_iter().fold(0.0, f64::max) + 2.0 * PX;
        let mut range = [0.0, 1.0];
        let (from, to) = (points[0], points[1]);
        for (axis, half) in self.half.into_iter().enumerate() {
            let limit = half + margin;
            narrow(&mut range, limit - from[axis], limit - to[axis])?;
            narrow(&mut range, limit + from[axis], limit + to[axis])?;
        }
        let cut = [range[0] > 0.0, range[1] < 1.0];
        let ends = [0, 1].map(|k| if cut[k] { mix(&points[0], &points[1], range[k]) } else { points[k] });
        Some(ScreenEdge { ends, is_whole: [0, 1].map(|k| is_whole[k] && !cut[k]), may_show: true })
    }

    /// X, Y, Z, W.
    #[inline(always)]
    pub fn homogeneous(&self, vertex: u32) -> [f64; 4] {
        self.view.homogeneous(vertex)
    }
}

/// The point between a point before the near plane and one behind it that lies on the plane.
pub fn before(near_w: f64, inside: &[f64; 4], outside: &[f64; 4]) -> [f64; 4] {
    mix(inside, outside, (inside[3] - near_w) / (inside[3] - outside[3]))
}

/// X, Y, Z, W on screen.
#[inline(always)]
pub fn on_screen([x, y, z, w]: [f64; 4]) -> ScreenPoint {
    [x / w, y / w, z / w, 1.0 / w]
}

/// The point at a share of the way from `a` to `b`.
fn mix(a: &[f64; 4], b: &[f64; 4], t: f64) -> [f64; 4] {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// Cuts a range down to where the affine function with these values at 0 and 1 is not negative.
#[inline]
pub fn narrow(range: &mut [f64; 2], from: f64, to: f64) -> Option<()> {
    if from < 0.0 && to < 0.0 {
        return None;
    }
    if from < 0.0 {
        range[0] = range[0].max(from / (from - to));
    } else if to < 0.0 {
        range[1] = range[1].min(from / (from - to));
    }
    (range[0] < range[1]).then_some(())
}
