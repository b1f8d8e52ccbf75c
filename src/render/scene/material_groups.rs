//! Material groups: the triangles, lines and points of a mesh that share a material, and the style that
//! the request gives them (which layers are drawn, and how). From both it follows whether a group is
//! filled, and whether it is opaque or transparent.

use rapidhash::RapidHashMap;

use crate::mesh::material::AlphaMode;
use crate::mesh::{MaterialSlot, Mesh};
use crate::spec::{Cull, DebugView, Ground, Hidden, Layers, OutlineMethod, Spec, Wire, WireMethod};

/// Bytes that each material takes in [`MaterialGroups`].
pub const GROUP_BYTES: u64 = size_of::<&Layers>() as u64 + 4 + 1;

/// The material groups of a mesh, by material index.
pub struct MaterialGroups<'s> {
    /// The style of each material.
    pub by_material: Vec<&'s Layers>,
    /// Index into `styles`, by material.
    pub style_of: Vec<u32>,
    /// The styles in use, in the order in which materials first need them. Two names with equal
    /// styles are two entries.
    pub styles: Vec<&'s Layers>,
    fills: Vec<Fill>,
    has_fill: bool,
    needs_hiding_surface: bool,
    has_ground: bool,
}

/// The fill of a material group's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// No fill.
    None,
    /// Nothing shines through.
    Opaque,
    /// Surfaces behind may shine through.
    Transparent,
}

impl<'s> MaterialGroups<'s> {
    /// Finds the style of each material by its name.
    pub fn new(mesh: &Mesh, spec: &'s Spec) -> Self {
        let named: RapidHashMap<&str, u32> = spec.materials.iter().map(|(name, _)| name.as_str()).zip(1..).collect();
        let requested: Vec<&Layers> =
            std::iter::once(&spec.layers).chain(spec.materials.iter().map(|(_, layers)| layers)).collect();
        let (mut styles, mut place) = (Vec::new(), vec![u32::MAX; requested.len()]);
        let mut style_of = Vec::with_capacity(mesh.materials.len());
        for slot in &mesh.materials {
            let at = named.get(slot.name.as_str()).map_or(0, |&at| at as usize);
            if place[at] == u32::MAX {
                place[at] = styles.len() as u32;
                styles.push(requested[at]);
            }
            style_of.push(place[at]);
        }
        let by_material: Vec<&Layers> = style_of.iter().map(|&style| styles[style as usize]).collect();
        let fills: Vec<Fill> =
            by_material.iter().zip(&mesh.materials).map(|(layers, slot)| fill(layers, slot)).collect();
        let has_fill = fills.iter().any(|fill| *fill != Fill::None);
        let needs_hiding_surface = !has_fill && styles.iter().any(|layers| has_hideable_lines(layers));
        let has_ground = has_fill && spec.ground != Ground::None;
        Self { by_material, style_of, styles, fills, has_fill, needs_hiding_surface, has_ground }
    }

    /// Number of materials.
    pub fn material_count(&self) -> usize {
        self.by_material.len()
    }

    /// The fill of a material.
    pub fn fill(&self, material: usize) -> Fill {
        self.fills.get(material).copied().unwrap_or(Fill::Opaque)
    }

    /// The fills, by material.
    pub fn fills(&self) -> &[Fill] {
        &self.fills
    }

    /// True if any material has a fill.
    pub fn has_fill(&self) -> bool {
        self.has_fill
    }

    /// True if a material has a hull.
    pub fn is_outlined(&self, material: usize) -> bool {
        self.by_material.get(material).is_some_and(|layers| has_hull(layers))
    }

    /// True if the picture has a ground: one was asked for, and there is a surface to stand on it.
    pub fn has_ground(&self) -> bool {
        self.has_ground
    }

    /// Draws no ground: it is not seen.
    pub fn leave_ground_out(&mut self) {
        self.has_ground = false;
    }

    /// True if any material has a hull.
    pub fn has_hull(&self) -> bool {
        self.styles.iter().any(|layers| has_hull(layers))
    }

    /// True if any material has a wire that is shaded with the surface.
    pub fn has_barycentric_wire(&self) -> bool {
        self.styles.iter().any(|layers| barycentric_wire(layers).is_some())
    }

    /// True if any material has the debug view of the distance to edges.
    pub fn shows_edge_distance(&self) -> bool {
        self.styles.iter().any(|layers| layers.surface.is_some_and(|s| s.debug == DebugView::EdgeDistance))
    }

    /// True if lines need an invisible surface that only hides them.
    pub fn needs_hiding_surface(&self) -> bool {
        self.needs_hiding_surface
    }

    /// True if there is a surface that hides lines, visible or not.
    pub fn hides_lines(&self) -> bool {
        self.has_fill || self.needs_hiding_surface
    }

    /// The side that all materials leave out; none where they differ.
    pub fn common_cull(&self) -> Cull {
        let mut all = self.styles.iter().map(|layers| layers.surface.map_or(Cull::None, |s| s.cull));
        let first = all.next().unwrap_or(Cull::None);
        if all.all(|cull| cull == first) { first } else { Cull::None }
    }
}

/// The treatment of hidden edges in a style's barycentric wire, if the style has one.
pub fn barycentric_wire(layers: &Layers) -> Option<Hidden> {
    layers.wire.filter(|wire| wire.method != WireMethod::Exact).map(|wire| wire.hidden)
}

/// True if a style has lines of exact width that a surface would hide.
fn has_hideable_lines(layers: &Layers) -> bool {
    let is_hideable = |wire: Wire| wire.method == WireMethod::Exact && wire.hidden != Hidden::Show;
    layers.wire.is_some_and(is_hideable) || layers.outline.is_some_and(|o| o.method == OutlineMethod::Contour)
}

fn has_hull(layers: &Layers) -> bool {
    layers.outline.is_some_and(|outline| outline.method == OutlineMethod::Hull)
}

fn fill(layers: &Layers, slot: &MaterialSlot) -> Fill {
    let Some(surface) = &layers.surface else { return Fill::None };
    if surface.debug != DebugView::None {
        return Fill::Opaque;
    }
    let has_alpha = match (surface.color, slot.alpha) {
        (Some(color), _) => color.0[3] < 1.0,
        (None, AlphaMode::Opaque) => false,
        (None, AlphaMode::Mask(_) | AlphaMode::Blend) => true,
    };
    if has_alpha || surface.opacity < 1.0 || surface.facing_opacity < 1.0 { Fill::Transparent } else { Fill::Opaque }
}
