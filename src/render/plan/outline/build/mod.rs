//! The mesh that draws an outline. Beside each visible part of a silhouette edge, where a surface
//! ends on screen, it has a quad as wide as the outline (an offset quad), and round joins at the
//! corners between these quads. Parts of chains that are too short have none (`chains`).
//!
//! Quads and joins cover the points within the outline's thickness of these parts, on the side where
//! nothing of the surface is. Where a corner turns inwards the offset quads overlap.

use crate::plan::PlanError;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::costs::spend_hull;
use crate::plan::geometry::Geometry;
use crate::plan::outline::outer_side::OuterSide;
use crate::plan::outline::parts::{OutlineParts, outlines};
use crate::plan::outline::round_join::RoundJoins;
use crate::plan::outline::screen_edges::{OutlineView, ScreenEdge, Way};
use crate::plan::outline::silhouette_edges::{ScreenMesh, SilhouetteEdge};
use crate::plan::outline::visible_parts::VisiblePart;
use crate::plan::outline::{EdgeEnd, HullPass, ScreenPoint, ScreenVertex};
use crate::plan::peeling::needed_pass;
use crate::plan::shared_slice::SharedSlice;
use crate::scene::{Scene, Thickness};
use crate::spec::OutlineMethod;

/// The hull of the materials that have one, in a picture with this margin.
pub fn hull_pass<'m>(
    scene: &Scene<'m, '_>,
    geometry: &Geometry<'m>,
    margin_px: u32,
    cx: &mut PlanContext<'_>,
) -> Result<HullPass<'m>, PlanError> {
    let groups = &scene.groups;
    let hulls = || outlines(scene, OutlineMethod::Hull);
    let thicknesses: Vec<Option<Thickness>> = hulls().map(|o| o.map(|o| scene.outline_thickness(o))).collect();
    let mut colors: Vec<[f32; 4]> = hulls().map(|o| o.map_or([0.0; 4], |o| o.color.premultiplied())).collect();
    let used: Vec<[f32; 4]> = (0..colors.len()).filter(|&m| thicknesses[m].is_some()).map(|m| colors[m]).collect();
    let color = used.first().copied().unwrap_or_default();
    if used.iter().all(|c| *c == color) {
        colors = vec![color];
    }
    // The ground has a material of its own.
    let has_several = groups.material_count() > 1 || groups.has_ground();
    let needs_materials = colors.len() > 1 || (needed_pass(groups).is_some() && has_several);
    let (list, silhouettes) = cx.silhouettes(scene)?;
    let mesh = ScreenMesh::new(scene, cx)?;
    let edges = mesh.silhouette_edges(&thicknesses, &list, &silhouettes, cx)?;
    let view = OutlineView::new(&mesh, &thicknesses, scene.size_px(), margin_px);
    let parts = OutlineParts::of(scene, &view, edges, OutlineMethod::Hull, cx)?;
    cx.short_chains += parts.short_chains;
    let canvas = Canvas { size_px: scene.size_px(), first_vertex: geometry.positions.len() as u32 };
    let mut hull = OutlineMesh::draw(&view, canvas, &parts, cx)?;
    spend_hull(&hull, scene, cx.budget)?;
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
    /// The number of the hull's first own vertex: the plan's positions come before.
    first_vertex: u32,
}

/// Builds the offset quads and the round joins.
struct OutlineMesh<'a> {
    view: &'a OutlineView<'a>,
    first_vertex: u32,
    joins: RoundJoins,
    hull: HullPass<'static>,
}

impl<'a> OutlineMesh<'a> {
    /// Draws the outlines of all visible parts of silhouette edges.
    fn draw(
        view: &'a OutlineView<'a>,
        Canvas { size_px, first_vertex }: Canvas,
        parts: &OutlineParts,
        cx: &mut PlanContext<'_>,
    ) -> Result<HullPass<'static>, PlanError> {
        // An offset quad has at most four corners of its own, and two triangles with a material.
        // Joins keep both ends, also of edges without a visible part.
        let OutlineParts { edges, places, drawn: visible, .. } = parts;
        let most = edges.len() + visible.len();
        let bytes = 4 * size_of::<ScreenVertex>() + 2 * (size_of::<[u32; 3]>() + 4) + 2 * size_of::<EdgeEnd>();
        cx.budget.spend("an outline's strips", most as u64, bytes as u64)?;
        cx.budget.spend("an outline's strips", view.view.mesh.positions.len() as u64 / 8 + 8, 1)?;
        let hull = HullPass {
            vertices: Vec::with_capacity(4 * visible.len()),
            triangles: Vec::with_capacity(2 * visible.len()),
            triangle_materials: Vec::with_capacity(2 * visible.len()),
            ..HullPass::default()
        };
        let joins = RoundJoins::with_capacity(2 * edges.len(), size_px);
        let mut outlines = Self { view, first_vertex, joins, hull };
        let mut drawn = DrawnVertices::new(view.view.mesh.positions.len());
        visible.iter().for_each(|part| drawn.add(&edges[part.edge as usize], part));
        let mut rest = &visible[..];
        for (i, (edge, place)) in edges.iter().zip(places).enumerate() {
            if i % CHECK_EVERY == 0 {
                cx.deadline.check()?;
            }
            let (own, after) = rest.split_at(rest.iter().take_while(|part| part.edge == i as u32).count());
            rest = after;
            if own.is_empty() && (!place.may_show || !edge.vertices.iter().any(|v| drawn.has(*v))) {
                continue;
            }
            outlines.offset_quads(edge, place, own);
        }
        outlines.joins.finish(view.view, first_vertex, &mut outlines.hull, cx)?;
        Ok(outlines.hull)
    }

    /// Adds the offset quads beside the visible parts of an edge.
    fn offset_quads(&mut self, edge: &SilhouetteEdge, place: &ScreenEdge, parts: &[VisiblePart]) {
        let Some(side) = OuterSide::of(self.view, edge, place) else { return };
        let ([a, b], Way { along, length }) = (place.ends, place.way());
        let out = f64::from(edge.free);
        let mut outer = [None; 2];
        for part in parts {
            let across = [-out * along[1], out * along[0]];
            let corners = part.range.map(|share| self.corners(edge, place, &side, share, across));
            let [[inner_a, outer_a], [inner_b, outer_b]] = corners;
            self.hull.triangles.extend([[inner_a, inner_b, outer_b], [inner_a, outer_b, outer_a]]);
            self.hull.triangle_materials.extend([edge.material; 2]);
            for k in (0..2).filter(|&k| part.range[k] == [0.0, 1.0][k]) {
                outer[k] = Some(corners[k][1]);
            }
        }
        for k in (0..2).filter(|&k| place.is_whole[k]) {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let end = place.ends[k];
            self.joins.push(EdgeEnd {
                vertex: edge.vertices[k],
                outer: outer[k],
                material: edge.material,
                free: if k == 0 { edge.free } else { -edge.free },
                angle: libm::atan2(sign * along[1], sign * along[0]),
                turn: libm::acos(sign * side.sine),
                middle: [end[0], end[1]],
                reach: side.reach[k],
                depth: side.ends[k][2],
                inv_w: end[3],
                slope: sign * (b[2] - a[2]) / length,
                is_hidden: false,
            });
        }
    }

    /// The inner and the outer corner of a quad at a share of the way along its edge.
    fn corners(
        &mut self,
        edge: &SilhouetteEdge,
        place: &ScreenEdge,
        side: &OuterSide,
        share: f64,
        out: [f64; 2],
    ) -> [u32; 2] {
        let k = usize::from(share > 0.5);
        let is_end = share == [0.0, 1.0][k];
        let outer = if is_end { side.ends[k] } else { side.at(share) };
        let inner = if is_end && place.is_whole[k] {
            edge.vertices[k]
        } else {
            // Under the face, so that rounding leaves no gap between both.
            let [x, y, z, inv_w] = if is_end { place.ends[k] } else { place.at(share) };
            self.vertex([x - out[0], y - out[1], z, inv_w])
        };
        [inner, self.vertex(outer)]
    }

    /// A new vertex of the hull.
    fn vertex(&mut self, point: ScreenPoint) -> u32 {
        self.hull.vertices.push(ScreenVertex::snapped(point));
        self.first_vertex + self.hull.vertices.len() as u32 - 1
    }
}

/// The vertices where visible parts end.
struct DrawnVertices(Vec<u64>);

impl DrawnVertices {
    fn new(count: usize) -> Self {
        Self(vec![0; count.div_ceil(64)])
    }

    fn add(&mut self, edge: &SilhouetteEdge, part: &VisiblePart) {
        for vertex in (0..2).filter(|&k| part.range[k] == [0.0, 1.0][k]).map(|k| edge.vertices[k] as usize) {
            self.0[vertex / 64] |= 1 << (vertex % 64);
        }
    }

    fn has(&self, vertex: u32) -> bool {
        self.0[vertex as usize / 64] >> (vertex % 64) & 1 == 1
    }
}

#[cfg(test)]
mod tests;
