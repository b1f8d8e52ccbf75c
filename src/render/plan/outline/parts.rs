//! The parts of silhouette edges (where a surface ends on screen) that an outline draws: those that
//! no face hides, without chains that are too short or would be dotted lines. Both kinds of outlines
//! are made from them: hulls, which are meshes beside the shape, and contours, which are lines along
//! the edges that have such parts. Only where the least length of all contours is 0 do back-ends find
//! the contours instead.

use crate::mesh::edges::EdgeList;
use crate::plan::PlanError;
use crate::plan::context::PlanContext;
use crate::plan::edges::silhouettes::{Silhouettes, hiding_materials};
use crate::plan::outline::chains::{ChainLength, remove_short};
use crate::plan::outline::screen_edges::{OutlineView, ScreenEdge};
use crate::plan::outline::silhouette_edges::{ScreenMesh, SilhouetteEdge};
use crate::plan::outline::visible_parts::{VisiblePart, visible_parts};
use crate::scene::{Scene, Thickness};
use crate::spec::{Outline, OutlineMethod};

/// The silhouette edges of a view, and the parts of them that are drawn.
pub struct OutlineParts {
    /// All silhouette edges.
    pub edges: Vec<SilhouetteEdge>,
    /// The same on screen.
    pub places: Vec<ScreenEdge>,
    /// The parts that are drawn, in the order of the edges.
    pub drawn: Vec<VisiblePart>,
    /// Chains that are left out because they are short.
    pub short_chains: u32,
}

impl OutlineParts {
    /// Those of a scene's outlines of one method.
    pub fn of(
        scene: &Scene<'_, '_>,
        view: &OutlineView<'_>,
        edges: Vec<SilhouetteEdge>,
        method: OutlineMethod,
        cx: &mut PlanContext<'_>,
    ) -> Result<Self, PlanError> {
        let places = view.screen_edges(&edges, cx)?;
        let mut drawn = visible_parts(view, &edges, &places, &hiding_materials(&scene.groups), method, cx)?;
        let min_px = outlines(scene, method).map(|outline| outline.and_then(|o| o.min_length)).collect();
        let least = ChainLength { min_px, width: if method == OutlineMethod::Hull { 1.0 } else { 2.0 } };
        let short_chains = remove_short(&mut drawn, view, &edges, &places, &least, cx)?;
        Ok(Self { edges, places, drawn, short_chains })
    }
}

/// By material, the outline of this method, if the material has one.
pub fn outlines<'s>(
    scene: &'s Scene<'_, '_>,
    method: OutlineMethod,
) -> impl Iterator<Item = Option<&'s Outline>> + use<'s> {
    scene.groups.by_material.iter().map(move |layers| layers.outline.as_ref().filter(|o| o.method == method))
}

/// The contours that are drawn, by number in the list of edges, in order; and the number of chains
/// that are left out. None where no chain is too short for one: then back-ends find the contours.
pub fn contours(
    scene: &Scene<'_, '_>,
    list: &EdgeList,
    silhouettes: &Silhouettes,
    cx: &mut PlanContext<'_>,
) -> Result<Option<(Vec<u32>, u32)>, PlanError> {
    let contours = || outlines(scene, OutlineMethod::Contour);
    if contours().flatten().all(|outline| outline.min_length == Some(0.0)) {
        return Ok(None);
    }
    cx.budget.spend("materials", scene.groups.material_count() as u64, size_of::<Option<Thickness>>() as u64)?;
    let reach = |outline: &Outline| Thickness::Px(0.5 * scene.contour_width_px(outline));
    let reaches: Vec<Option<Thickness>> = contours().map(|outline| outline.map(reach)).collect();
    let mesh = ScreenMesh::new(scene, cx)?;
    let edges = mesh.silhouette_edges(&reaches, list, silhouettes, cx)?;
    let view = OutlineView::new(&mesh, &reaches, scene.size_px(), 0);
    let parts = OutlineParts::of(scene, &view, edges, OutlineMethod::Contour, cx)?;
    cx.budget.spend("an outline's edges", parts.drawn.len() as u64, 4)?;
    let mut drawn: Vec<u32> = parts.drawn.iter().map(|part| parts.edges[part.edge as usize].index).collect();
    drawn.dedup();
    Ok(Some((drawn, parts.short_chains)))
}
