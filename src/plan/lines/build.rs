//! The edges that are drawn as lines, once each, in which style.

use super::styles::{LineStyle, line_styles};
use crate::limits::{Deadline, Stopped};
use crate::mesh::edges::EdgeList;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::edges::silhouettes::{Silhouettes, unseen_side};
use crate::plan::skips::SkipKind;
use crate::plan::{Edge, LinePass, PlanError};
use crate::scene::Scene;
use crate::spec::Hidden;

/// The passes that draw wires, topology and contours.
pub fn passes(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<LinePass>, PlanError> {
    let Scene { mesh, groups, camera, .. } = scene;
    let styles = line_styles(scene);
    let hides = groups.hides_lines();
    let is_unneeded = styles.is_empty() && !groups.has_hull();
    if cx.skips.skip(SkipKind::Adjacency, is_unneeded, "no line asks which triangles are neighbours") {
        return Ok(Vec::new());
    }
    let (list, silhouettes) = match styles.iter().any(|style| style.contour) {
        true => cx.silhouettes(scene).map(|(list, found)| (list, Some(found)))?,
        false => (cx.edges(mesh)?, None),
    };
    // Only where the eye is surely outside of the mesh is the inside of its faces never seen.
    let may_skip = hides && camera.contains_mesh && styles.iter().any(|style| style.hidden == Hidden::Hide);
    let unseen_side = if may_skip { unseen_side(mesh, groups, &list) } else { None };
    let source = Source { scene, list: &list, silhouettes: silhouettes.as_deref() };
    let mut passes = Vec::new();
    for style in &styles {
        let mut count = 0;
        source.each(style, cx.deadline, |_| count += 1)?;
        if count > 0 {
            // Once as they are found, and once as they are shared.
            cx.budget.spend("drawn edges", count, 2 * size_of::<Edge>() as u64)?;
            let mut edges = Vec::with_capacity(count as usize);
            source.each(style, cx.deadline, |edge| edges.push(edge))?;
            let drawn = style.passes(&edges.into(), hides, unseen_side);
            // Entries in the lists of up to four bands of the picture.
            cx.budget.spend("lists of edges", drawn.len() as u64 * count, 16)?;
            passes.extend(drawn);
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
}

impl Source<'_> {
    /// Calls `each` with every edge that has a style.
    fn each(&self, style: &LineStyle, deadline: &Deadline, mut each: impl FnMut(Edge)) -> Result<(), Stopped> {
        let Scene { mesh, groups, .. } = self.scene;
        let silhouettes = self.silhouettes.filter(|_| style.contour);
        for (edge, i) in self.list.edges.iter().zip(0_u32..) {
            if (i as usize).is_multiple_of(CHECK_EVERY) {
                deadline.check()?;
            }
            if style.draws(mesh, groups, edge) {
                // Holes ask for rims: of more than two faces, none is the other side of the surface.
                let is_crowded = style.has_all_edges && edge.face_count > 2;
                let faces = if is_crowded { [edge.faces[0], Edge::NO_FACE] } else { edge.faces };
                let all = Edge::new(&mesh.positions, edge.vertices, faces);
                if let Some(edge) = silhouettes.map_or(Some(all), |s| s.edge(mesh, i, all)) {
                    each(edge);
                }
            }
        }
        Ok(())
    }
}
