//! The line styles of a picture. A style is the width, the colour and the treatment of hidden parts of
//! some lines, and it says which edges of the mesh they follow. The styles follow from the wires, the
//! topology layer and the contours of the request; materials whose lines look the same share one.

use std::sync::Arc;

use crate::limits::{Deadline, Stopped};
use crate::mesh::Mesh;
use crate::mesh::creases::sharp_cos;
use crate::mesh::edges::{EdgeList, MeshEdge};
use crate::plan::context::PlanContext;
use crate::plan::edges::edge_class::{Class, belongs_to, class_of};
use crate::plan::lines::auto_width::{AutoWidth, OpenEdges, open_edges};
use crate::plan::lines::fade::LineFade;
use crate::plan::{Edge, FaceSide, LinePass, PlanError, Shown};
use crate::scene::{MaterialGroups, Scene};
use crate::spec::color::Rgba;
use crate::spec::{Hidden, OutlineMethod, Topology, Wire, WireEdges, WireMethod, WireThickness};

/// Width of edges that tell of a fault, in multiples of a polygon edge's.
const FAULT_WIDTH: f32 = 2.5;

/// A style of lines, and the edges that have it.
pub struct LineStyle {
    /// As [`LinePass::width_px`].
    pub width_px: f32,
    /// As [`LinePass::smoothing_px`].
    pub smoothing_px: f32,
    /// As [`LinePass::color`].
    pub color: [f32; 4],
    /// As [`LinePass::fade`].
    pub fade: Option<Arc<LineFade>>,
    /// True if the lines are to fade where the edges that have the style lie dense.
    pub fades_by_edges: bool,
    /// Treatment of the hidden parts of edges.
    pub hidden: Hidden,
    lit: bool,
    /// As [`LinePass::contour`].
    pub contour: bool,
    class: Class,
    /// True if every edge has the style.
    pub has_all_edges: bool,
    /// By index into [`MaterialGroups::styles`], which materials' edges; empty: all.
    styles: Vec<bool>,
    /// The least width where the lines would cover most of the surface; None: always as wide.
    thinnest_px: Option<f32>,
    /// Chains of edges that are shorter on screen are left out; 0: none.
    pub min_length_px: f32,
}

impl LineStyle {
    /// Unlit lines along all edges that they are given.
    pub fn everywhere(width_px: f32, smoothing_px: f32, color: [f32; 4], hidden: Hidden) -> Self {
        let (lit, contour, class, styles) = (false, false, Class::All, Vec::new());
        let (has_all_edges, thinnest_px, min_length_px) = (false, None, 0.0);
        Self {
            width_px,
            smoothing_px,
            color,
            fade: None,
            fades_by_edges: false,
            hidden,
            lit,
            contour,
            class,
            has_all_edges,
            styles,
            thinnest_px,
            min_length_px,
        }
    }

    /// True if the lines are visible at all.
    pub fn is_seen(&self) -> bool {
        self.width_px + self.smoothing_px > 0.0 && self.color[3] > 0.0
    }

    /// True if the style's lines are all edges of this list; a contour asks for other faces than theirs.
    pub fn takes_all(&self, list: &EdgeList) -> bool {
        let is_all = match self.class {
            Class::All => true,
            Class::Polygon => list.has_polygon_edges_alone(),
            _ => false,
        };
        is_all && self.styles.is_empty() && !self.contour
    }

    /// True if an edge has this style.
    pub fn draws(&self, mesh: &Mesh, groups: &MaterialGroups<'_>, edge: &MeshEdge) -> bool {
        let mut faces = edge.faces.into_iter().filter(|&face| face != Edge::NO_FACE);
        let style = |face: u32| groups.style_of[mesh.triangle_materials[face as usize] as usize] as usize;
        let has_material = self.styles.is_empty() || faces.any(|face| self.styles[style(face)]);
        has_material && belongs_to(self.class, mesh, edge)
    }

    /// Notes that a style has every edge of this list, if it follows polygons and there are no diagonals.
    /// Makes lines that would cover most of the surface thinner.
    pub fn settle(&mut self, scene: &Scene<'_, '_>, list: &EdgeList, deadline: &Deadline) -> Result<(), Stopped> {
        self.has_all_edges |= self.class == Class::Polygon && self.takes_all(list);
        if let Some(thinnest_px) = self.thinnest_px {
            let OpenEdges { width_px, opacity } = open_edges(scene, list, [thinnest_px, self.width_px], deadline)?;
            self.width_px = width_px.min(self.width_px);
            self.color = self.color.map(|v| v * opacity);
        }
        Ok(())
    }

    /// The pass that draws these edges.
    pub fn pass(&self, edges: &Arc<Vec<Edge>>, hides: bool, unseen_side: Option<FaceSide>) -> LinePass {
        LinePass {
            edges: edges.clone(),
            is_complete: self.has_all_edges,
            keeps_short_parts: self.has_all_edges,
            width_px: self.width_px,
            smoothing_px: self.smoothing_px,
            color: self.color,
            fade: self.fade.clone(),
            shown: match self.hidden {
                Hidden::Hide if hides => Shown::Visible,
                Hidden::Fade if hides => Shown::Faded,
                _ => Shown::All,
            },
            unseen_side: unseen_side.filter(|_| self.hidden == Hidden::Hide),
            contour: self.contour,
            lit: self.lit,
            is_tinted: self.hidden != Hidden::Show,
        }
    }
}

/// The line styles of a scene, in the order in which they are drawn.
pub fn line_styles(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<LineStyle>, PlanError> {
    let mut styles = wire_styles(scene, cx)?;
    styles.extend(scene.spec.topology.iter().flat_map(topology_styles));
    styles.extend(contour_styles(scene));
    styles.retain(LineStyle::is_seen);
    Ok(styles)
}

/// A wire's colour: premultiplied, opacity included.
pub fn wire_color(wire: &Wire) -> [f32; 4] {
    wire.color.premultiplied().map(|v| v * wire.opacity)
}

/// The width of a wire along edges of materials with some styles. Feature and boundary edges are taken to be
/// few; the fading of features is found when these edges are.
fn width(
    scene: &Scene<'_, '_>,
    wire: &Wire,
    styles: &[bool],
    cx: &mut PlanContext<'_>,
) -> Result<AutoWidth, PlanError> {
    let are_polygons = wire.edges == WireEdges::Polygons;
    match wire.thickness {
        WireThickness::Given(width_px) => Ok(AutoWidth::opaque(width_px)),
        WireThickness::Auto if are_polygons || wire.edges == WireEdges::Triangles => {
            let style = |i: usize| scene.groups.style_of[scene.mesh.triangle_materials[i] as usize] as usize;
            AutoWidth::of(scene, are_polygons, |i| styles[style(i)], cx)
        }
        WireThickness::Auto => Ok(AutoWidth::opaque(AutoWidth::FEATURE_PX)),
    }
}

/// Wires of exact width, each style once.
fn wire_styles(scene: &Scene<'_, '_>, cx: &mut PlanContext<'_>) -> Result<Vec<LineStyle>, PlanError> {
    let groups = &scene.groups;
    let mut kinds: Vec<(Wire, Vec<bool>)> = Vec::new();
    for (index, layers) in groups.styles.iter().enumerate() {
        let Some(wire) = layers.wire.filter(|wire| wire.method == WireMethod::Exact) else { continue };
        let at = kinds.iter().position(|(kind, _)| *kind == wire).unwrap_or_else(|| {
            kinds.push((wire, vec![false; groups.styles.len()]));
            kinds.len() - 1
        });
        kinds[at].1[index] = true;
    }
    let mut style = |(wire, styles): (Wire, Vec<bool>)| {
        let AutoWidth { width_px, fade } = width(scene, &wire, &styles, cx)?;
        Ok(LineStyle {
            width_px,
            smoothing_px: wire.smoothing,
            color: wire_color(&wire),
            fade,
            fades_by_edges: wire.thickness == WireThickness::Auto && wire.edges == WireEdges::Feature,
            hidden: wire.hidden,
            lit: wire.lit,
            contour: false,
            class: class_of(&wire),
            has_all_edges: class_of(&wire) == Class::All && styles.iter().all(|&has| has),
            styles: if styles.iter().all(|&has| has) { Vec::new() } else { styles },
            thinnest_px: None,
            min_length_px: if wire.edges == WireEdges::Feature { wire.min_length } else { 0.0 },
        })
    };
    kinds.into_iter().map(&mut style).collect()
}

/// The styles that show a mesh's topology. Faults come last, so that they lie on top.
fn topology_styles(topology: &Topology) -> Vec<LineStyle> {
    let style = |color: Option<Rgba>, class, share: f32, hidden| {
        color.map(|color| LineStyle {
            width_px: topology.thickness * share,
            smoothing_px: 0.0,
            color: color.premultiplied(),
            fade: None,
            fades_by_edges: false,
            hidden,
            lit: false,
            contour: false,
            class,
            has_all_edges: false,
            styles: Vec::new(),
            thinnest_px: (class == Class::Boundary).then_some(topology.thickness),
            min_length_px: 0.0,
        })
    };
    let crease = Class::Crease(sharp_cos(topology.crease_angle_deg));
    let kinds = [
        style(topology.polygon, Class::Polygon, 1.0, Hidden::Hide),
        style(topology.crease, crease, FAULT_WIDTH, Hidden::Hide),
        // A fault on the far side is a fault too, so hidden ones are shown.
        style(topology.open, Class::Boundary, FAULT_WIDTH, Hidden::Fade),
        style(topology.nonmanifold, Class::Nonmanifold, FAULT_WIDTH, Hidden::Fade),
    ];
    kinds.into_iter().flatten().collect()
}

/// Contours, each style once.
fn contour_styles(scene: &Scene<'_, '_>) -> Vec<LineStyle> {
    let mut styles: Vec<LineStyle> = Vec::new();
    let count = scene.groups.styles.len();
    for (index, layers) in scene.groups.styles.iter().enumerate() {
        let Some(outline) = layers.outline.filter(|o| o.method == OutlineMethod::Contour) else { continue };
        let (width_px, color) = (scene.contour_width_px(&outline), outline.color.premultiplied());
        let at = styles.iter().position(|s| s.width_px == width_px && s.color == color).unwrap_or_else(|| {
            let contour = LineStyle::everywhere(width_px, 0.0, color, Hidden::Hide);
            styles.push(LineStyle { contour: true, styles: vec![false; count], ..contour });
            styles.len() - 1
        });
        styles[at].styles[index] = true;
    }
    styles
}
