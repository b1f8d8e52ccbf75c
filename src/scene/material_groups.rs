//! What each part of a mesh takes part in. A part is what shares a material.

use std::borrow::Cow;

use rapidhash::RapidHashMap;

use crate::mesh::Mesh;
use crate::mesh::material::AlphaMode;
use crate::plan::{PeelingPass, pass_mask};
use crate::spec::{Cull, DebugView, Hidden, Layers, OutlineMethod, Spec, Wire, WireMethod};

/// Layers that are peeled off before what is left counts as unseen.
const LAYERS_MAX: u32 = 16;

/// What remains of hidden lines that fade.
pub const FADE: f32 = 0.25;

/// Bytes that each material takes among [`MaterialGroups`].
pub const GROUP_BYTES: u64 = size_of::<&Layers>() as u64 + 4 + 1;

/// The parts of a mesh, by material index.
pub struct MaterialGroups<'a> {
    /// What is drawn of each.
    pub layers: Vec<&'a Layers>,
    /// Index of each part's layers in `looks`.
    pub look_of: Vec<u32>,
    /// The layers that any part has, each once for every way that the request names it.
    pub looks: Vec<&'a Layers>,
    fills: Vec<Fill>,
    has_fill: bool,
    needs_occluder: bool,
}

/// How a part's surface is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// Not at all.
    None,
    /// Nothing shines through.
    Opaque,
    /// Something may.
    Transparent,
}

impl<'a> MaterialGroups<'a> {
    /// Finds each material's look by its name.
    pub fn new(mesh: &Mesh, spec: &'a Spec) -> Self {
        let named: RapidHashMap<&str, u32> = spec.materials.iter().map(|(name, _)| name.as_str()).zip(1..).collect();
        let all: Vec<&Layers> =
            std::iter::once(&spec.layers).chain(spec.materials.iter().map(|(_, layers)| layers)).collect();
        // In the order in which materials first need them.
        let (mut looks, mut place) = (Vec::new(), vec![u32::MAX; all.len()]);
        let mut look_of = Vec::with_capacity(mesh.materials.len());
        for slot in &mesh.materials {
            let asked = named.get(slot.name.as_str()).map_or(0, |&at| at as usize);
            if place[asked] == u32::MAX {
                place[asked] = looks.len() as u32;
                looks.push(all[asked]);
            }
            look_of.push(place[asked]);
        }
        let layers: Vec<&Layers> = look_of.iter().map(|&look| looks[look as usize]).collect();
        let fills: Vec<Fill> = layers.iter().zip(&mesh.materials).map(|(layers, slot)| fill(layers, slot)).collect();
        let has_fill = fills.iter().any(|fill| *fill != Fill::None);
        let needs_occluder = !has_fill && looks.iter().any(|layers| hides_lines(layers));
        Self { layers, look_of, looks, fills, has_fill, needs_occluder }
    }

    /// How a part is filled.
    pub fn fill(&self, material: usize) -> Fill {
        self.fills.get(material).copied().unwrap_or(Fill::Opaque)
    }

    /// Whether any part is.
    pub fn has_fill(&self) -> bool {
        self.has_fill
    }

    /// Whether a part has a hull.
    pub fn is_outlined(&self, material: usize) -> bool {
        self.layers.get(material).is_some_and(|layers| has_hull(layers))
    }

    /// Whether any part has one.
    pub fn has_hull(&self) -> bool {
        self.looks.iter().any(|layers| has_hull(layers))
    }

    /// Whether any part has a wire that is drawn with the surface.
    pub fn has_barycentric_wire(&self) -> bool {
        self.looks.iter().any(|layers| barycentric_wire(layers).is_some())
    }

    /// Whether any part shows how far its edges are.
    pub fn shows_edge_distance(&self) -> bool {
        self.looks.iter().any(|layers| layers.surface.is_some_and(|s| s.debug == DebugView::EdgeDistance))
    }

    /// Whether a surface that nobody sees is needed to hide lines.
    pub fn needs_occluder(&self) -> bool {
        self.needs_occluder
    }

    /// The layers, if any part needs them.
    pub fn layers_pass(&self) -> Option<PeelingPass> {
        let transparent = self.fills.contains(&Fill::Transparent);
        let wires = || self.layers.iter().zip(&self.fills).filter_map(|(l, fill)| Some((barycentric_wire(l)?, *fill)));
        let bare = wires().any(|(_, fill)| fill == Fill::None);
        let through = wires().any(|(wire, fill)| fill == Fill::Opaque && wire != Hidden::Hide);
        if !(transparent || bare || through) {
            return None;
        }
        // Wires that show through an opaque fill and fills that let something through do not go together: then what is
        // hidden by an opaque fill stays hidden.
        let wires_only = through && !transparent;
        let fades = wires().any(|(wire, _)| wire == Hidden::Fade);
        let hides = !transparent && !wires_only && wires().all(|(wire, _)| wire == Hidden::Hide);
        Some(PeelingPass {
            count_max: if hides { 1 } else { LAYERS_MAX },
            behind_surface: wires_only,
            wires_only,
            fade: if fades { FADE } else { 1.0 },
        })
    }

    /// The bits of [`pass_mask`] of each part, given the plan's layers; `faces` is what the surface pass draws anyway.
    fn pass_mask(&self, material: usize, pass: Option<&PeelingPass>, common: Cull) -> u8 {
        let layers = self.layers[material];
        let wire = barycentric_wire(layers);
        let mut role = match self.fill(material) {
            Fill::Opaque => pass_mask::SURFACE,
            Fill::Transparent => pass_mask::LAYER,
            Fill::None if wire.is_some() => pass_mask::LAYER,
            Fill::None if self.needs_occluder() => pass_mask::SURFACE,
            Fill::None => 0,
        };
        if pass.is_some_and(|pass| pass.wires_only) && wire.is_some_and(|hidden| hidden != Hidden::Hide) {
            role |= pass_mask::LAYER;
        }
        match layers.surface.map_or(Cull::None, |s| s.cull) {
            cull if cull == common => {}
            Cull::None => {}
            Cull::Back => role |= pass_mask::FRONT_ONLY,
            Cull::Front => role |= pass_mask::BACK_ONLY,
        }
        role
    }

    /// Which side all parts hide; where they differ, none, and each part's role says.
    pub fn common_cull(&self) -> Cull {
        let mut all = self.looks.iter().map(|layers| layers.surface.map_or(Cull::None, |s| s.cull));
        let first = all.next().unwrap_or(Cull::None);
        if all.all(|cull| cull == first) { first } else { Cull::None }
    }

    /// [`DrawPlan::pass_masks`](crate::plan::DrawPlan::pass_masks) of a plan that has these passes.
    pub fn pass_masks(&self, mesh: &Mesh, surface: bool, pass: Option<&PeelingPass>) -> Cow<'static, [u8]> {
        let common = self.common_cull();
        let by_part: Vec<u8> = (0..self.layers.len()).map(|m| self.pass_mask(m, pass, common)).collect();
        let usual = |role: u8| {
            (role & pass_mask::SURFACE != 0 || !surface) && role & (pass_mask::FRONT_ONLY | pass_mask::BACK_ONLY) == 0
        };
        if pass.is_none() && by_part.iter().all(|&role| usual(role)) {
            return Cow::Borrowed(&[]);
        }
        let own = mesh.own_triangles().len();
        let role = |m: u32| by_part.get(m as usize).copied().unwrap_or(pass_mask::SURFACE);
        let mut all: Vec<u8> = mesh.triangle_materials.iter().map(|&m| role(m)).collect();
        for role in all.iter_mut().skip(own) {
            // Lines and points face the viewer.
            *role &= pass_mask::SURFACE | pass_mask::LAYER;
        }
        all.into()
    }
}

/// Whether hidden edges of a part's barycentric wire are shown, if it has one.
fn barycentric_wire(layers: &Layers) -> Option<Hidden> {
    layers.wire.filter(|wire| wire.method != WireMethod::Exact).map(|wire| wire.hidden)
}

/// Whether a look has lines of exact width that a surface would hide.
fn hides_lines(layers: &Layers) -> bool {
    let hides = |wire: Wire| wire.method == WireMethod::Exact && wire.hidden != Hidden::Show;
    layers.wire.is_some_and(hides) || layers.outline.is_some_and(|o| o.method == OutlineMethod::Contour)
}

fn has_hull(layers: &Layers) -> bool {
    layers.outline.is_some_and(|outline| outline.method == OutlineMethod::Hull)
}

fn fill(layers: &Layers, slot: &crate::mesh::MaterialSlot) -> Fill {
    let Some(surface) = &layers.surface else { return Fill::None };
    if surface.debug != DebugView::None {
        return Fill::Opaque;
    }
    let own_alpha = match (surface.color, slot.alpha) {
        (Some(color), _) => color.0[3] < 1.0,
        (None, AlphaMode::Opaque) => false,
        (None, AlphaMode::Mask(_) | AlphaMode::Blend) => true,
    };
    if own_alpha || surface.opacity < 1.0 { Fill::Transparent } else { Fill::Opaque }
}
