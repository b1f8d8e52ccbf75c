//! Which edges are drawn as lines, once each, in which style.

use std::sync::Arc;

use super::build::Means;
use super::parts::{FADE, Parts};
use super::silhouette::{Silhouettes, unseen_side};
use super::skips::{SkipKind, Skips};
use super::{Edge, LinePass, PlanError, Shown, Side};
use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, MeshEdge, NO_FACE};
use crate::scene::color::Rgba;
use crate::scene::{Hidden, Outline, OutlineMethod, Spec, Topology, Wire, WireEdges, WireMethod};

/// How much wider than the polygons' edges those that tell of a fault are.
const FAULT_WIDTH: f32 = 2.5;

/// Lines of one style, and the edges that have it.
struct Want {
    width_px: f32,
    smoothing_px: f32,
    color: [f32; 4],
    hidden: Hidden,
    lit: bool,
    contour: bool,
    class: Class,
    /// Edges of which of [`Parts::looks`]; empty: all.
    looks: Vec<bool>,
}

/// A kind of edge.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    All,
    Polygon,
    /// Faces meet at an angle whose cosine is below this, or there are not two.
    Feature(f64),
    /// Two faces that meet so.
    Crease(f64),
    Boundary,
    Nonmanifold,
}

/// A mesh's edges, found when something first asks for them, and then kept.
#[derive(Default)]
pub struct Edges(Option<EdgeList>);

impl Edges {
    /// All of them.
    pub fn of(&mut self, mesh: &Mesh, means: &mut Means<'_>) -> Result<&EdgeList, PlanError> {
        let list = match self.0.take() {
            Some(list) => list,
            None => {
                means.deadline.check()?;
                EdgeList::of(mesh, means.budget)?
            }
        };
        Ok(self.0.insert(list))
    }
}

/// The passes of a scene. `contour_px` is the width of a contour; `is_outside` says that the eye is
/// surely outside of the mesh.
pub fn passes(
    mesh: &Mesh,
    spec: &Spec,
    parts: &Parts<'_>,
    (contour_px, is_outside): (impl Fn(&Outline) -> f32, bool),
    edges: &mut Edges,
    skips: &mut Skips<'_>,
    means: &mut Means<'_>,
) -> Result<Vec<LinePass>, PlanError> {
    let mut wants = wire_wants(parts);
    wants.extend(spec.topology.iter().flat_map(topology_wants));
    wants.extend(contour_wants(parts, contour_px));
    wants.retain(|want| want.width_px + want.smoothing_px > 0.0 && want.color[3] > 0.0);
    if skips.skip(
        SkipKind::Adjacency,
        wants.is_empty() && !parts.has_hull(),
        "no line asks which triangles are neighbours",
    ) {
        return Ok(Vec::new());
    }
    let list = edges.of(mesh, means)?;
    let hides = parts.has_fill() || parts.needs_occluder();
    let may_skip = hides && is_outside && wants.iter().any(|w| w.hidden == Hidden::Hide);
    let unseen_side = if may_skip { unseen_side(mesh, parts, list) } else { None };
    let silhouettes = match wants.iter().any(|want| want.contour) {
        true => Some(Silhouettes::new(mesh, parts, list, means.budget)?),
        false => None,
    };
    let mut passes = Vec::new();
    for want in &wants {
        let drawn =
            list.edges.iter().zip(0_u32..).filter(|(edge, _)| want.draws(mesh, parts, edge)).filter_map(|(edge, i)| {
                let all = Edge::new(&mesh.positions, edge.vertices, edge.faces);
                silhouettes.as_ref().filter(|_| want.contour).map_or(Some(all), |s| s.edge(i, all))
            });
        let edges: Arc<[Edge]> = drawn.collect();
        means.deadline.check()?;
        means.budget.spend("drawn edges", edges.len() as u64, 16)?;
        if !edges.is_empty() {
            let drawn = want.passes(&edges, hides, unseen_side);
            // In the lists of up to four bands of the picture.
            means.budget.spend("lists of edges", (drawn.len() * edges.len()) as u64, 16)?;
            passes.extend(drawn);
        }
    }
    Ok(passes)
}

/// Premultiplied, opacity included.
pub fn color(wire: &Wire) -> [f32; 4] {
    wire.color.premultiplied().map(|v| v * wire.opacity)
}

/// Which edges of each triangle its part's wire follows; empty where it is all of them.
pub fn edge_masks(
    mesh: &Mesh,
    parts: &Parts<'_>,
    edges: &mut Edges,
    means: &mut Means<'_>,
) -> Result<Vec<u8>, PlanError> {
    let classes: Vec<Class> =
        parts.layers.iter().map(|layers| layers.wire.as_ref().map_or(Class::All, class_of)).collect();
    let is_polygonal = mesh.edge_masks.iter().any(|&mask| mask != 0b111);
    let own = mesh.own_triangles().len();
    let is_all = own == mesh.triangles.len();
    if is_all && classes.iter().all(|class| *class == Class::All || (*class == Class::Polygon && !is_polygonal)) {
        return Ok(Vec::new());
    }
    means.budget.spend("edge masks", mesh.triangles.len() as u64, 1)?;
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
        mark(mesh, edges.of(mesh, means)?, &mut masks, class_at);
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

fn wire_wants(parts: &Parts<'_>) -> Vec<Want> {
    let mut kinds: Vec<(Wire, Vec<bool>)> = Vec::new();
    for (look, layers) in parts.looks.iter().enumerate() {
        let Some(wire) = layers.wire.filter(|wire| wire.method == WireMethod::Exact) else { continue };
        let at = kinds.iter().position(|(kind, _)| *kind == wire).unwrap_or_else(|| {
            kinds.push((wire, vec![false; parts.looks.len()]));
            kinds.len() - 1
        });
        kinds[at].1[look] = true;
    }
    let want = |(wire, looks): (Wire, Vec<bool>)| Want {
        width_px: wire.thickness,
        smoothing_px: wire.smoothing,
        color: color(&wire),
        hidden: wire.hidden,
        lit: wire.lit,
        contour: false,
        class: class_of(&wire),
        looks: if looks.iter().all(|&drawn| drawn) { Vec::new() } else { looks },
    };
    kinds.into_iter().map(want).collect()
}

fn class_of(wire: &Wire) -> Class {
    match wire.edges {
        WireEdges::Triangles => Class::All,
        WireEdges::Polygons => Class::Polygon,
        WireEdges::Feature => Class::Feature(cos_deg(wire.feature_angle_deg)),
        WireEdges::Boundary => Class::Boundary,
    }
}

/// Faults last, so that they lie on top.
fn topology_wants(topology: &Topology) -> Vec<Want> {
    let want = |color: Option<Rgba>, class, share: f32, hidden| {
        color.map(|color| Want {
            width_px: topology.thickness * share,
            smoothing_px: 0.0,
            color: color.premultiplied(),
            hidden,
            lit: false,
            contour: false,
            class,
            looks: Vec::new(),
        })
    };
    let crease = Class::Crease(cos_deg(topology.crease_angle_deg));
    let kinds = [
        want(topology.polygon, Class::Polygon, 1.0, Hidden::Hide),
        want(topology.crease, crease, FAULT_WIDTH, Hidden::Hide),
        // A fault on the far side is one too.
        want(topology.open, Class::Boundary, FAULT_WIDTH, Hidden::Fade),
        want(topology.nonmanifold, Class::Nonmanifold, FAULT_WIDTH, Hidden::Fade),
    ];
    kinds.into_iter().flatten().collect()
}

fn contour_wants(parts: &Parts<'_>, contour_px: impl Fn(&Outline) -> f32) -> Vec<Want> {
    let mut wants: Vec<Want> = Vec::new();
    for (look, layers) in parts.looks.iter().enumerate() {
        let Some(outline) = layers.outline.filter(|o| o.method == OutlineMethod::Contour) else { continue };
        let (width_px, color) = (contour_px(&outline), outline.color.premultiplied());
        let at = wants.iter().position(|w| w.width_px == width_px && w.color == color).unwrap_or_else(|| {
            let looks = vec![false; parts.looks.len()];
            let class = Class::All;
            wants.push(Want {
                width_px,
                smoothing_px: 0.0,
                color,
                hidden: Hidden::Hide,
                lit: false,
                contour: true,
                class,
                looks,
            });
            wants.len() - 1
        });
        wants[at].looks[look] = true;
    }
    wants
}

impl Want {
    fn draws(&self, mesh: &Mesh, parts: &Parts<'_>, edge: &MeshEdge) -> bool {
        let mut faces = edge.faces.into_iter().filter(|&face| face != NO_FACE);
        let look = |face: u32| parts.look_of[mesh.triangle_materials[face as usize] as usize] as usize;
        (self.looks.is_empty() || faces.any(|face| self.looks[look(face)])) && is_of(self.class, mesh, edge)
    }

    fn passes(&self, edges: &Arc<[Edge]>, hides: bool, unseen_side: Option<Side>) -> Vec<LinePass> {
        let pass = |shown, color| LinePass {
            edges: edges.clone(),
            width_px: self.width_px,
            smoothing_px: self.smoothing_px,
            color,
            shown,
            unseen_side: unseen_side.filter(|_| self.hidden == Hidden::Hide),
            contour: self.contour,
            lit: self.lit,
        };
        match self.hidden {
            Hidden::Show => vec![pass(Shown::All, self.color)],
            _ if !hides => vec![pass(Shown::All, self.color)],
            Hidden::Hide => vec![pass(Shown::Visible, self.color)],
            Hidden::Fade => {
                vec![pass(Shown::Hidden, self.color.map(|v| v * FADE)), pass(Shown::Visible, self.color)]
            }
        }
    }
}

fn is_of(class: Class, mesh: &Mesh, edge: &MeshEdge) -> bool {
    let bends = |limit: f64| {
        let [a, b] = edge.faces.map(|face| mesh.face_normals[face as usize].map(f64::from));
        let cos = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
        if a == [0.0; 3] || b == [0.0; 3] {
            // A face without area has no direction to bend from.
            return false;
        }
        // Two faces that disagree which side is out bend the other way round.
        (if edge.is_wound_alike { -cos } else { cos }) < limit
    };
    match class {
        Class::All => true,
        Class::Polygon => edge.is_polygon_edge,
        Class::Feature(limit) => edge.face_count != 2 || bends(limit),
        Class::Crease(limit) => edge.face_count == 2 && bends(limit),
        Class::Boundary => edge.face_count == 1,
        Class::Nonmanifold => edge.face_count > 2 || (edge.face_count == 2 && edge.is_wound_alike),
    }
}

fn cos_deg(degrees: f64) -> f64 {
    libm::cos(degrees.to_radians())
}

#[cfg(test)]
mod tests;
