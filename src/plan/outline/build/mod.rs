//! The outline mesh: an offset quad beside each silhouette edge, and round joins between them.
//!
//! It covers all points within the outline's thickness of where the surface ends on screen, on the
//! side where nothing of the surface is. Where a corner turns inwards the offset quads overlap.

use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::costs::spend_hull;
use crate::plan::geometry::Geometry;
use crate::plan::outline::round_join::RoundJoins;
use crate::plan::outline::silhouette_edges::{ScreenMesh, SilhouetteEdge};
use crate::plan::outline::{EdgeEnd, HullPass, HullVertex, ScreenPoint};
use crate::plan::peeling::needed_pass;
use crate::plan::projection::row_dot;
use crate::plan::shared_slice::SharedSlice;
use crate::plan::{Edge, PlanError};
use crate::scene::{Scene, Thickness};
use crate::spec::OutlineMethod;

/// 1/256 px in a pixel.
const PX: f64 = 256.0;

/// The widest outline, pixels: one around something beside the picture still lies in the guard
/// band.
const THICKNESS_MAX_PX: f64 = 1000.0;

/// Slope at which an outline recedes from its edge: length in depth per length across. Surfaces
/// next to the edge hide the outline, and what is farther behind does not.
const RECEDES: f64 = 0.5;

/// Largest slope of an outline that follows a face beyond its edge, so that it lies behind what
/// continues that face elsewhere: the other teeth of a gear.
const RECEDES_MAX: f64 = 2.5;

/// Slope of such an outline beyond that of its face.
const RECEDES_MORE: f64 = 0.05;

/// The least depth that is still before the far plane.
const DEPTH_MIN: f64 = 1e-30;

/// The hull of the materials that have one, in a picture with this margin.
pub fn hull_pass<'m>(
    scene: &Scene<'m, '_>,
    geometry: &Geometry<'m>,
    margin_px: u32,
    cx: &mut PlanContext<'_>,
) -> Result<HullPass<'m>, PlanError> {
    let groups = &scene.groups;
    let outline = |m: usize| groups.by_material[m].outline.filter(|o| o.method == OutlineMethod::Hull);
    let thicknesses: Vec<Option<Thickness>> =
        (0..groups.material_count()).map(|m| outline(m).map(|o| scene.outline_thickness(&o))).collect();
    let mut colors: Vec<[f32; 4]> =
        (0..groups.material_count()).map(|m| outline(m).map_or([0.0; 4], |o| o.color.premultiplied())).collect();
    let used: Vec<[f32; 4]> = (0..colors.len()).filter(|&m| thicknesses[m].is_some()).map(|m| colors[m]).collect();
    let color = used.first().copied().unwrap_or_default();
    if used.iter().all(|c| *c == color) {
        colors = vec![color];
    }
    let needs_materials = colors.len() > 1 || (needed_pass(groups).is_some() && groups.material_count() > 1);
    let (list, silhouettes) = cx.silhouettes(scene)?;
    let view = ScreenMesh::new(scene, cx)?;
    let edges = view.silhouette_edges(&thicknesses, &list, &silhouettes, cx)?;
    let canvas = Canvas { size_px: scene.size_px(), margin_px, first_vertex: geometry.positions.len() as u32 };
    let mut hull = OutlineMesh::draw(&view, &thicknesses, canvas, &edges, cx)?;
    spend_hull(&hull, groups, cx.budget)?;
    if !needs_materials {
        hull.triangle_materials = Vec::new();
    }
    let surface_materials = if needs_materials { geometry.triangle_materials.clone() } else { SharedSlice::default() };
    Ok(HullPass { colors, surface_materials, ..hull })
}

/// The picture that an outline mesh is drawn for.
#[derive(Clone, Copy)]
struct Canvas {
    size_px: [u32; 2],
    margin_px: u32,
    /// The number of the hull's first own vertex: the plan's positions come before.
    first_vertex: u32,
}

/// Builds the offset quads and the round joins.
struct OutlineMesh<'a> {
    view: &'a ScreenMesh<'a>,
    thicknesses: &'a [Option<Thickness>],
    first_vertex: u32,
    /// Half the size of the picture with its margin, 1/256 px.
    half: [f64; 2],
    /// 1/256 px per unit of the box at W = 1.
    scale: f64,
    /// Change of Z and W per unit of the box towards the viewer.
    nearer: [f64; 2],
    joins: RoundJoins,
    hull: HullPass<'static>,
}

impl<'a> OutlineMesh<'a> {
    /// Draws the outlines of all silhouette edges.
    fn draw(
        view: &'a ScreenMesh<'a>,
        thicknesses: &'a [Option<Thickness>],
        canvas: Canvas,
        edges: &[SilhouetteEdge],
        cx: &mut PlanContext<'_>,
    ) -> Result<HullPass<'static>, PlanError> {
        let Canvas { size_px, margin_px, first_vertex } = canvas;
        let p = view.projection;
        let along = |row: &[f32; 4]| (0..3).map(|k| f64::from(row[k]) * f64::from(p.to_viewer[k])).sum::<f64>();
        let scale = (0..3).map(|k| f64::from(p.x[k]) * f64::from(p.x[k])).sum::<f64>().sqrt();
        let half = size_px.map(|size| 0.5 * PX * f64::from(size + 2 * margin_px));
        // An offset quad has at most four corners of its own, and two triangles with a material.
        // Joins keep both ends.
        let bytes = 4 * size_of::<HullVertex>() + 2 * (size_of::<[u32; 3]>() + 4) + 2 * size_of::<EdgeEnd>();
        cx.budget.spend("an outline's strips", edges.len() as u64, bytes as u64)?;
        let hull = HullPass {
            vertices: Vec::with_capacity(4 * edges.len()),
            triangles: Vec::with_capacity(2 * edges.len()),
            triangle_materials: Vec::with_capacity(2 * edges.len()),
            ..HullPass::default()
        };
        let joins = RoundJoins::with_capacity(2 * edges.len(), size_px);
        let nearer = [along(&p.z), along(&p.w)];
        let mut outlines = Self { view, thicknesses, first_vertex, half, scale, nearer, joins, hull };
        for (i, edge) in edges.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                cx.deadline.check()?;
            }
            outlines.offset_quad(edge);
        }
        outlines.joins.finish(view, first_vertex, &mut outlines.hull, cx)?;
        Ok(outlines.hull)
    }

    /// Adds the offset quad beside an edge.
    fn offset_quad(&mut self, edge: &SilhouetteEdge) {
        let Some((ends, are_whole)) = self.on_screen(edge) else { return };
        let [a, b] = ends;
        let way = [b[0] - a[0], b[1] - a[1]];
        let length = (way[0] * way[0] + way[1] * way[1]).sqrt();
        let reach = ends.map(|end| self.reach(edge.material, end[3]));
        if length < 1e-6 || reach[0].max(reach[1]) <= 0.0 {
            return;
        }
        let along = way.map(|v| v / length);
        let out = f64::from(edge.free);
        // The outer side touches the circles around both ends, of which one may be nearer and
        // larger. Where that circle surrounds the other one, the quad is empty and the nearer end's
        // join reaches around.
        let sine = ((reach[0] - reach[1]) / length).clamp(-1.0, 1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        let normal = [sine * along[0] - cosine * out * along[1], sine * along[1] + cosine * out * along[0]];
        let depths = self.depths(edge, ends, [along[0], along[1], length], normal, reach);
        let outer = [0, 1].map(|k| {
            let at = [0, 1].map(|axis| ends[k][axis] + reach[k] * normal[axis]);
            self.vertex([at[0], at[1], depths[k], ends[k][3]])
        });
        let inner = [0, 1].map(|k| if are_whole[k] { edge.vertices[k] } else { self.vertex(ends[k]) });
        self.hull.triangles.extend([[inner[0], inner[1], outer[1]], [inner[0], outer[1], outer[0]]]);
        self.hull.triangle_materials.extend([edge.material; 2]);
        for k in (0..2).filter(|&k| are_whole[k]) {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            self.joins.push(EdgeEnd {
                vertex: edge.vertices[k],
                outer: outer[k],
                material: edge.material,
                free: if k == 0 { edge.free } else { -edge.free },
                angle: libm::atan2(sign * along[1], sign * along[0]),
                turn: libm::acos(sign * sine),
                middle: [ends[k][0], ends[k][1]],
                reach: reach[k],
                depth: depths[k],
                inv_w: ends[k][3],
                slope: sign * (b[2] - a[2]) / length,
                is_hidden: false,
            });
        }
    }

    /// A new vertex of the hull.
    fn vertex(&mut self, point: ScreenPoint) -> u32 {
        self.hull.vertices.push(HullVertex::snapped(point));
        self.first_vertex + self.hull.vertices.len() as u32 - 1
    }

    /// The distance that a material's outline reaches, 1/256 px.
    fn reach(&self, material: u32, inv_w: f64) -> f64 {
        let reach = match self.thicknesses.get(material as usize) {
            Some(Some(Thickness::Px(px))) => PX * f64::from(*px),
            Some(Some(Thickness::Object(units))) => f64::from(*units) * self.scale * inv_w,
            _ => 0.0,
        };
        reach.min(PX * THICKNESS_MAX_PX)
    }

    /// The part of an edge before the near plane whose outline may be in the picture, and which of
    /// its two ends are the edge's own.
    fn on_screen(&self, edge: &SilhouetteEdge) -> Option<([ScreenPoint; 2], [bool; 2])> {
        let near = f64::from(self.view.projection.near_w) * (1.0 + 1e-5);
        let [a, b] = edge.vertices.map(|v| self.homogeneous(v));
        let mut are_whole = [true; 2];
        let mut ends = [a, b];
        for k in 0..2 {
            if ends[k][3] < near {
                let (inside, outside) = (ends[1 - k], ends[k]);
                if inside[3] < near {
                    return None;
                }
                let t = (inside[3] - near) / (inside[3] - outside[3]);
                ends[k] = mix(&inside, &outside, t);
                are_whole[k] = false;
            }
        }
        let points = ends.map(|[x, y, z, w]| [x / w, y / w, z / w, 1.0 / w]);
        let margin = points.map(|point| self.reach(edge.material, point[3])).into_iter().fold(0.0, f64::max) + 2.0 * PX;
        let mut range = [0.0, 1.0];
        let (from, to) = (points[0], points[1]);
        for (axis, half) in self.half.into_iter().enumerate() {
            let limit = half + margin;
            narrow(&mut range, limit - from[axis], limit - to[axis])?;
            narrow(&mut range, limit + from[axis], limit + to[axis])?;
        }
        let cut = [range[0] > 0.0, range[1] < 1.0];
        let clipped = [0, 1].map(|k| if cut[k] { mix(&points[0], &points[1], range[k]) } else { points[k] });
        Some((clipped, [0, 1].map(|k| are_whole[k] && !cut[k])))
    }

    /// X, Y, Z, W.
    fn homogeneous(&self, vertex: u32) -> [f64; 4] {
        let [x, y, w] = self.view.places[vertex as usize];
        [x, y, row_dot(&self.view.projection.z, self.view.mesh.positions[vertex as usize]), w]
    }

    /// Depths of the outer corners of an offset quad.
    fn depths(
        &self,
        edge: &SilhouetteEdge,
        ends: [ScreenPoint; 2],
        [right, down, length]: [f64; 3],
        normal: [f64; 2],
        reach: [f64; 2],
    ) -> [f64; 2] {
        // Change of depth from the edge outwards, in the plane of the face that recedes most.
        let slope_along = (ends[1][2] - ends[0][2]) / length;
        let out = f64::from(edge.free);
        let slope = |face: u32| {
            let corners = self.view.mesh.triangles.get(face as usize)?;
            let third = corners.iter().find(|v| !edge.vertices.contains(v))?;
            let [x, y, z, w] = self.homogeneous(*third);
            let from = [x / w - ends[0][0], y / w - ends[0][1]];
            let across = out * (right * from[1] - down * from[0]);
            let is_known = w >= f64::from(self.view.projection.near_w) && across < -1e-6;
            is_known.then(|| (z / w - ends[0][2] - slope_along * (right * from[0] + down * from[1])) / across)
        };
        let slope = edge.faces.iter().filter(|face| **face != Edge::NO_FACE).filter_map(|face| slope(*face));
        let slope = slope.fold(f64::INFINITY, f64::min);
        let sideways = normal[0] * right + normal[1] * down;
        let outwards = out * (right * normal[1] - down * normal[0]);
        [0, 1].map(|k| {
            let [_, _, depth, inv_w] = ends[k];
            let receding = |share: f64| {
                let away = share * reach[k] / (self.scale * inv_w).max(1e-300);
                let (z, w) = (depth / inv_w - away * self.nearer[0], 1.0 / inv_w - away * self.nearer[1]);
                z / w
            };
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
}

fn mix(a: &[f64; 4], b: &[f64; 4], t: f64) -> [f64; 4] {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// Cuts a range down to where the affine function with these values at 0 and 1 is not negative.
fn narrow(range: &mut [f64; 2], from: f64, to: f64) -> Option<()> {
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

#[cfg(test)]
mod tests;
