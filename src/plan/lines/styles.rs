//! The styles of lines that a scene asks for, and the edges that have each.

use std::sync::Arc;

use crate::mesh::Mesh;
use crate::mesh::edges::{MeshEdge, NO_FACE};
use crate::plan::lines::edge_class::{Class, class_of, cos_deg, is_of};
use crate::plan::{Edge, LinePass, Shown, Side};
use crate::scene::material_groups::{FADE, MaterialGroups};
use crate::spec::color::Rgba;
use crate::spec::{Hidden, Outline, OutlineMethod, Topology, Wire, WireMethod};

/// How much wider than the polygons' edges those that tell of a fault are.
const FAULT_WIDTH: f32 = 2.5;

/// Lines of one style, and the edges that have it.
pub struct Want {
    /// As [`LinePass::width_px`].
    pub width_px: f32,
    /// As [`LinePass::smoothing_px`].
    pub smoothing_px: f32,
    /// As [`LinePass::color`].
    pub color: [f32; 4],
    /// What becomes of what is hidden.
    pub hidden: Hidden,
    lit: bool,
    /// As [`LinePass::contour`].
    pub contour: bool,
    class: Class,
    /// Edges of which of [`MaterialGroups::looks`]; empty: all.
    looks: Vec<bool>,
}

impl Want {
    /// Lines of a style, not lit, along all edges that they are given.
    pub fn everywhere(width_px: f32, smoothing_px: f32, color: [f32; 4], hidden: Hidden) -> Self {
        let (lit, contour, class, looks) = (false, false, Class::All, Vec::new());
        Self { width_px, smoothing_px, color, hidden, lit, contour, class, looks }
    }

    /// Whether they leave a trace.
    pub fn is_seen(&self) -> bool {
        self.width_px + self.smoothing_px > 0.0 && self.color[3] > 0.0
    }

    /// Whether an edge is one of them.
    pub fn draws(&self, mesh: &Mesh, groups: &MaterialGroups<'_>, edge: &MeshEdge) -> bool {
        let mut faces = edge.faces.into_iter().filter(|&face| face != NO_FACE);
        let look = |face: u32| groups.look_of[mesh.triangle_materials[face as usize] as usize] as usize;
        (self.looks.is_empty() || faces.any(|face| self.looks[look(face)])) && is_of(self.class, mesh, edge)
    }

    /// What draws these edges, the hidden ones first.
    pub fn passes(&self, edges: &Arc<[Edge]>, hides: bool, unseen_side: Option<Side>) -> Vec<LinePass> {
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

/// Lines of exact width along the edges of surfaces, each style once.
pub fn wire_wants(groups: &MaterialGroups<'_>) -> Vec<Want> {
    let mut kinds: Vec<(Wire, Vec<bool>)> = Vec::new();
    for (look, layers) in groups.looks.iter().enumerate() {
        let Some(wire) = layers.wire.filter(|wire| wire.method == WireMethod::Exact) else { continue };
        let at = kinds.iter().position(|(kind, _)| *kind == wire).unwrap_or_else(|| {
            kinds.push((wire, vec![false; groups.looks.len()]));
            kinds.len() - 1
        });
        kinds[at].1[look] = true;
    }
    let want = |(wire, looks): (Wire, Vec<bool>)| Want {
        width_px: wire.thickness,
        smoothing_px: wire.smoothing,
        color: crate::plan::lines::build::color(&wire),
        hidden: wire.hidden,
        lit: wire.lit,
        contour: false,
        class: class_of(&wire),
        looks: if looks.iter().all(|&drawn| drawn) { Vec::new() } else { looks },
    };
    kinds.into_iter().map(want).collect()
}

/// Faults last, so that they lie on top.
pub fn topology_wants(topology: &Topology) -> Vec<Want> {
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

/// Contours, each style once.
pub fn contour_wants(groups: &MaterialGroups<'_>, contour_px: impl Fn(&Outline) -> f32) -> Vec<Want> {
    let mut wants: Vec<Want> = Vec::new();
    for (look, layers) in groups.looks.iter().enumerate() {
        let Some(outline) = layers.outline.filter(|o| o.method == OutlineMethod::Contour) else { continue };
        let (width_px, color) = (contour_px(&outline), outline.color.premultiplied());
        let at = wants.iter().position(|w| w.width_px == width_px && w.color == color).unwrap_or_else(|| {
            let looks = vec![false; groups.looks.len()];
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
