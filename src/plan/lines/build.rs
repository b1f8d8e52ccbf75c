//! Which edges are drawn as lines, once each, in which style.

use super::primitives;
use crate::plan::lines::edge_class::{Class, class_of, is_of};
use crate::plan::lines::styles::{Want, contour_wants, topology_wants, wire_wants};

use crate::limits::{Deadline, Stopped};
use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, NO_FACE};
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::edges::Edges;
use crate::plan::edges::silhouettes::{Silhouettes, unseen_side};
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::{Edge, LinePass, PlanError};
use crate::scene::material_groups::MaterialGroups;
use crate::spec::{Hidden, Outline, Spec, Wire};

/// The passes of a scene. `contour_px` is the width of a contour; `is_outside` says that the eye is
/// surely outside of the mesh.
pub fn passes<'a>(
    mesh: &'a Mesh,
    spec: &Spec,
    groups: &MaterialGroups<'_>,
    (contour_px, is_outside): (impl Fn(&Outline) -> f32, bool),
    edges: &mut Edges<'a>,
    skips: &mut Skips<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<LinePass>, PlanError> {
    let mut wants = wire_wants(groups);
    wants.extend(spec.topology.iter().flat_map(topology_wants));
    wants.extend(contour_wants(groups, &contour_px));
    wants.retain(Want::is_seen);
    let hides = groups.has_fill() || groups.needs_occluder();
    let loose = primitives::passes(mesh, groups, contour_px, hides, cx)?;
    if skips.skip(
        SkipKind::Adjacency,
        wants.is_empty() && !groups.has_hull(),
        "no line asks which triangles are neighbours",
    ) {
        return Ok(loose);
    }
    let (list, silhouettes) = match wants.iter().any(|want| want.contour) {
        true => edges.with_silhouettes(mesh, groups, cx).map(|(list, found)| (list, Some(found)))?,
        false => (edges.of(mesh, cx)?, None),
    };
    let may_skip = hides && is_outside && wants.iter().any(|w| w.hidden == Hidden::Hide);
    let unseen_side = if may_skip { unseen_side(mesh, groups, list) } else { None };
    let source = Source { mesh, groups, list, silhouettes };
    let mut passes = Vec::new();
    for want in &wants {
        let mut count = 0;
        source.each(want, cx.deadline, |_| count += 1)?;
        if count > 0 {
            // Once as they are found, and once as they are shared.
            cx.budget.spend("drawn edges", count, 2 * size_of::<Edge>() as u64)?;
            let mut edges = Vec::with_capacity(count as usize);
            source.each(want, cx.deadline, |edge| edges.push(edge))?;
            let drawn = want.passes(&edges.into(), hides, unseen_side);
            // In the lists of up to four bands of the picture.
            cx.budget.spend("lists of edges", drawn.len() as u64 * count, 16)?;
            passes.extend(drawn);
        }
    }
    passes.extend(loose);
    Ok(passes)
}

/// Where edges that are drawn come from.
struct Source<'s> {
    mesh: &'s Mesh,
    groups: &'s MaterialGroups<'s>,
    list: &'s EdgeList,
    /// Where any lines are contours.
    silhouettes: Option<&'s Silhouettes<'s>>,
}

impl Source<'_> {
    /// Calls `each` with every edge that lines want.
    fn each(&self, want: &Want, deadline: &Deadline, mut each: impl FnMut(Edge)) -> Result<(), Stopped> {
        let silhouettes = self.silhouettes.filter(|_| want.contour);
        for (edge, i) in self.list.edges.iter().zip(0_u32..) {
            if (i as usize).is_multiple_of(CHECK_EVERY) {
                deadline.check()?;
            }
            if want.draws(self.mesh, self.groups, edge) {
                let all = Edge::new(&self.mesh.positions, edge.vertices, edge.faces);
                if let Some(edge) = silhouettes.map_or(Some(all), |s| s.edge(i, all)) {
                    each(edge);
                }
            }
        }
        Ok(())
    }
}

/// Premultiplied, opacity included.
pub fn color(wire: &Wire) -> [f32; 4] {
    wire.color.premultiplied().map(|v| v * wire.opacity)
}

/// Which edges of each triangle its part's wire follows; empty where it is all of them.
pub fn edge_masks(
    mesh: &Mesh,
    groups: &MaterialGroups<'_>,
    edges: &mut Edges<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<u8>, PlanError> {
    let classes: Vec<Class> =
        groups.layers.iter().map(|layers| layers.wire.as_ref().map_or(Class::All, class_of)).collect();
    let is_polygonal = mesh.edge_masks.iter().any(|&mask| mask != 0b111);
    let own = mesh.own_triangles().len();
    let is_all = own == mesh.triangles.len();
    if is_all && classes.iter().all(|class| *class == Class::All || (*class == Class::Polygon && !is_polygonal)) {
        return Ok(Vec::new());
    }
    cx.budget.spend("edge masks", mesh.triangles.len() as u64, 1)?;
    let class_at = |t: usize| classes.get(mesh.triangle_materials[t] as usize).copied().unwrap_or(Class::All);
    let mut masks: Vec<u8> = (0..mesh.triangles.len())
        .map(|t| match class_at(t) {
            // Lines and points have no edges.
            Class::All if t < own => 0b111,
            Class::All => 0,
            Class::Polygon => mesh.edge_masks[t],
            _ => 0,
        })
        .collect();
    let asks = |class: &Class| !matches!(class, Class::All | Class::Polygon);
    if classes.iter().any(asks) {
        mark(mesh, edges.of(mesh, cx)?, &mut masks, class_at);
    }
    Ok(masks)
}

/// Sets the bits of edges that belong to their triangle's class, where that depends on neighbours.
fn mark(mesh: &Mesh, list: &EdgeList, masks: &mut [u8], class_at: impl Fn(usize) -> Class) {
    let first_two = list.edges.iter().flat_map(|edge| edge.faces.map(|face| (edge, face)));
    let further = list.further_faces.iter().map(|&[edge, face]| (&list.edges[edge as usize], face));
    for (edge, face) in first_two.chain(further).filter(|&(_, face)| face != NO_FACE) {
        if is_of(class_at(face as usize), mesh, edge) {
            masks[face as usize] |= corner_bit(&mesh.triangles[face as usize], edge.vertices);
        }
    }
}

fn corner_bit(triangle: &[u32; 3], [a, b]: [u32; 2]) -> u8 {
    (0..3).filter(|&k| [[a, b], [b, a]].contains(&[triangle[k], triangle[(k + 1) % 3]])).map(|k| 1 << k).sum()
}
