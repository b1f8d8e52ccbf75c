//! The lists of edges that are drawn as lines. For each line style (a width, a colour, and a treatment of
//! hidden parts) the edges of the mesh that have it are collected, each once and without short chains, and
//! become passes for the back-ends. Wires, topology lines and contours are made here.

use std::sync::Arc;

use super::auto_width::AutoWidth;
use super::short_chains::remove_short;
use super::styles::{LineStyle, line_styles};
use crate::mesh::edges::EdgeList;
use crate::plan::context::PlanContext;
use crate::plan::edges::select::select;
use crate::plan::edges::silhouettes::{Silhouettes, hides_inside, unseen_side};
use crate::plan::outline::parts::contours;
use crate::plan::skips::SkipKind;
use crate::plan::{Edge, LinePass, PlanError, Projection, Projector, Shown};
use crate::scene::Scene;
use crate::spec::Hidden;

/// The passes that draw wires, topology and contours.
pub fn passes(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<LinePass>, PlanError> {
    let Scene { mesh, groups, camera, .. } = scene;
    let mut styles = line_styles(scene, cx)?;
    let hides = groups.hides_lines();
    let is_unneeded = styles.is_empty() && !groups.has_hull();
    if cx.skips.skip(SkipKind::Adjacency, is_unneeded, "no line asks which triangles are neighbours") {
        return Ok(Vec::new());
    }
    // Only where the eye is surely outside of the mesh is the inside of its faces never seen.
    let may_skip = hides && camera.contains_mesh && styles.iter().any(|style| style.hidden == Hidden::Hide);
    let (list, orientation) = match may_skip && hides_inside(groups) {
        true => cx.edges_and_orientation(mesh)?,
        false => (cx.edges(mesh)?, None),
    };
    cx.has_crowded_edges = !list.further_faces.is_empty();
    styles.iter_mut().try_for_each(|style| style.settle(scene, &list, cx.deadline))?;
    let unseen_side = orientation.and_then(|orientation| unseen_side(groups, orientation));
    let silhouettes = match styles.iter().any(|style| style.contour) {
        true => Some(cx.silhouettes(scene)?.1),
        false => None,
    };
    let contours = match &silhouettes {
        Some(silhouettes) => contours(scene, &list, silhouettes, cx)?,
        None => None,
    };
    let contours = contours.map(|(edges, short_chains)| {
        cx.short_chains += short_chains;
        edges
    });
    let source = Source { scene, list: &list, silhouettes: silhouettes.as_deref(), contours };
    let mut passes = Vec::new();
    for style in &mut styles {
        let edges = source.edges(style, cx)?;
        if !edges.is_empty() {
            if style.fades_by_edges {
                style.fade = AutoWidth::fade_of_features(scene, &edges, cx.deadline)?;
            }
            let is_chosen = style.contour && source.contours.is_some();
            let mut pass = style.pass(&edges, hides, unseen_side.filter(|_| !is_chosen));
            pass.contour &= !is_chosen;
            // Entries in the lists of up to four bands of the picture, a box of pixels, and whether it is a
            // silhouette. Of faces without a fringe, entries in a list of their own.
            let unfringed = if pass.shown == Shown::Faded && pass.is_complete { 16 } else { 0 };
            cx.budget.spend("lists of edges", edges.len() as u64, 16 + 8 + 1 + unfringed)?;
            passes.push(pass);
        }
    }
    Ok(passes)
}

/// The edges of a scene, from which each style takes its own.
struct Source<'s> {
    scene: &'s Scene<'s, 's>,
    list: &'s EdgeList,
    /// None where no style is a contour.
    silhouettes: Option<&'s Silhouettes>,
    /// The contours of this view, by number in the list; None where back-ends find them.
    contours: Option<Vec<u32>>,
}

impl Source<'_> {
    /// The edges that have a style. Holes ask for rims: of more than two faces, none is the other side
    /// of the surface.
    fn edges(&self, style: &LineStyle, cx: &mut PlanContext<'_>) -> Result<Arc<Vec<Edge>>, PlanError> {
        if style.takes_all(self.list) {
            if !style.has_all_edges || self.list.further_faces.is_empty() {
                return Ok(Arc::clone(&self.list.edges));
            }
            cx.budget.spend("drawn edges", self.list.len() as u64, size_of::<Edge>() as u64)?;
            let mut edges = self.list.edges.to_vec();
            for &[edge, _] in &self.list.further_faces {
                edges[edge as usize].faces[1] = Edge::NO_FACE;
            }
            return Ok(Arc::new(edges));
        }
        let mut found = match self.contours.as_ref().filter(|_| style.contour) {
            Some(chosen) => select("drawn edges", chosen.len(), cx, |range, found| {
                self.each(style, chosen[range].iter().map(|&i| i as usize), found);
            })?,
            None => select("drawn edges", self.list.len(), cx, |range, found| self.each(style, range, found))?,
        };
        if style.min_length_px > 0.0 {
            let projector = Projector::new(&Projection::new(&self.scene.camera, self.scene.size_px()));
            let min_px = f64::from(style.min_length_px);
            cx.short_chains += remove_short(&mut found, self.scene.mesh, &projector, min_px, cx)?;
        }
        Ok(Arc::new(found))
    }

    /// Calls `each` with every edge among these that has a style.
    fn each(&self, style: &LineStyle, indices: impl Iterator<Item = usize>, each: &mut dyn FnMut(Edge)) {
        let Scene { mesh, groups, .. } = self.scene;
        let silhouettes = self.silhouettes.filter(|_| style.contour);
        for i in indices {
            let edge = self.list.get(i);
            if style.draws(mesh, groups, &edge) {
                let is_crowded = style.has_all_edges && edge.face_count > 2;
                let faces = if is_crowded { [edge.faces[0], Edge::NO_FACE] } else { edge.faces };
                let all = Edge { vertices: edge.vertices, faces };
                if let Some(edge) = silhouettes.map_or(Some(all), |s| s.edge(mesh, i, &edge)) {
                    each(edge);
                }
            }
        }
    }
}
