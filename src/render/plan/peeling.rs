//! Depth peeling, as a plan describes it. Transparent surfaces, the ground's shadow and some wires are
//! drawn by it in layers: at each sample the nearest one is found first, then the next behind it, and
//! so on, at most 16. It is decided here which pictures need such layers, and for each triangle whether
//! it belongs to the layers, to the opaque surface, to both, or to neither.

use std::borrow::Cow;

use super::geometry::Geometry;
use super::skips::{SkipKind, Skips};
use crate::scene::{Fill, MaterialGroups, barycentric_wire};
use crate::spec::{Cull, Hidden};

/// Layers that are peeled off per sample. What lies behind the last of them is not drawn.
const LAYERS_MAX: u32 = 16;

/// Alpha below which a surface is ignored: a tenth of a byte's last step in the most transparent
/// pictures.
pub const ALPHA_MIN: f32 = 1e-4;

/// Layers that tint the lines behind them and are told apart. All from the last of these on count as one, as far away as the
/// farthest of them.
pub const TINTS: usize = 4;

// A GPU keeps their depths in one vector.
const _: () = assert!(TINTS <= 4);

/// The share of their colour that fading hidden lines keep.
pub const FADE: f32 = 0.25;

/// Transparent surfaces, peeled off sample by sample.
///
/// Layer 0 of a sample is the nearest triangle with [`pass_mask::LAYER`] (or hull triangle, see
/// below). Layer k is the nearest behind layer k - 1 by (depth, lowest id first). All of them lie
/// in front of the visibility buffer's surface unless `behind_surface`. Each is shaded as the
/// surface is, and they lie over each other and over what the visibility buffer shows, nearest on
/// top.
///
/// Where layers stop at the surface, hull triangles are drawn into the layers and not into the
/// visibility buffer. Such a triangle adds nothing (but counts as a layer) where a nearer layer of
/// the same sample belongs to the same material (modulo 32), because a glass must not show its own
/// outline on its far side. Where layers go on behind the surface, everything filled is opaque, and
/// hulls may stay in the visibility buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeelingPass {
    /// Layers that are looked for; what lies behind the last of them is not drawn.
    pub count_max: u32,
    /// True if layers go on behind the surface: for wires that show through it.
    pub behind_surface: bool,
    /// True if layers show wires alone, and the visibility buffer shows triangles with
    /// [`pass_mask::LAYER`] without their wires.
    pub wires_only: bool,
    /// The share of its colour that a wire keeps from the second layer on, 0 to 1.
    pub fade: f32,
}

/// Bits that say which passes draw a triangle.
pub mod pass_mask {
    /// Drawn into the visibility buffer, if the plan has a surface.
    pub const SURFACE: u8 = 1;
    /// Drawn into the layers, if the plan has layers.
    pub const LAYER: u8 = 2;
    /// As surface or layer only where it faces the viewer, whatever
    /// [`SurfacePass::faces`](crate::plan::SurfacePass) says.
    pub const FRONT_ONLY: u8 = 8;
    /// As surface or layer only where it faces away from the viewer.
    pub const BACK_ONLY: u8 = 16;
}

/// The peeling pass of a plan; None where nothing shines through.
pub fn peeling_pass(groups: &MaterialGroups<'_>, has_hull: bool, skips: &mut Skips<'_>) -> Option<PeelingPass> {
    let needed = needed_pass(groups);
    // A kept but empty pass would draw hulls in another way.
    if skips.skip(SkipKind::Peeling, needed.is_none(), "nothing shines through") || (needed.is_none() && has_hull) {
        return None;
    }
    let empty = PeelingPass { count_max: 1, behind_surface: false, wires_only: false, fade: 1.0 };
    Some(needed.unwrap_or(empty))
}

/// The peeling pass that these groups need, if they need one.
pub fn needed_pass(groups: &MaterialGroups<'_>) -> Option<PeelingPass> {
    let is_transparent = groups.has_ground() || groups.fills().contains(&Fill::Transparent);
    let wires = || {
        let all = groups.by_material.iter().zip(groups.fills());
        all.filter_map(|(layers, fill)| Some((barycentric_wire(layers)?, *fill)))
    };
    let has_bare_wire = wires().any(|(_, fill)| fill == Fill::None);
    let shows_through = wires().any(|(hidden, fill)| fill == Fill::Opaque && hidden != Hidden::Hide);
    if !(is_transparent || has_bare_wire || shows_through) {
        return None;
    }
    // Wires that show through an opaque fill cannot be combined with transparent fills: then what
    // an opaque fill hides stays hidden.
    let wires_only = shows_through && !is_transparent;
    let fades = wires().any(|(hidden, _)| hidden == Hidden::Fade);
    let shows_nearest = !is_transparent && !wires_only && wires().all(|(hidden, _)| hidden == Hidden::Hide);
    Some(PeelingPass {
        count_max: if shows_nearest { 1 } else { LAYERS_MAX },
        behind_surface: wires_only,
        wires_only,
        fade: if fades { FADE } else { 1.0 },
    })
}

/// [`DrawPlan::pass_masks`](crate::plan::DrawPlan::pass_masks) of a plan with these passes, whose last
/// triangles are the ground.
pub fn pass_masks(
    groups: &MaterialGroups<'_>,
    geometry: &Geometry<'_>,
    ground_count: usize,
    has_surface: bool,
    pass: Option<&PeelingPass>,
) -> Cow<'static, [u8]> {
    let by_material: Vec<u8> = (0..groups.material_count()).map(|m| material_mask(groups, m, pass)).collect();
    let is_default = |mask: u8| {
        (mask & pass_mask::SURFACE != 0 || !has_surface) && mask & (pass_mask::FRONT_ONLY | pass_mask::BACK_ONLY) == 0
    };
    if pass.is_none() && by_material.iter().all(|&mask| is_default(mask)) {
        return Cow::Borrowed(&[]);
    }
    let mask = |m: u32| by_material.get(m as usize).copied().unwrap_or(pass_mask::SURFACE);
    let mut all: Vec<u8> = geometry.triangle_materials.iter().map(|&m| mask(m)).collect();
    for mask in all.iter_mut().skip(geometry.mesh_triangle_count) {
        // Lines and points face the viewer.
        *mask &= pass_mask::SURFACE | pass_mask::LAYER;
    }
    let ground = all.len() - ground_count;
    all[ground..].fill(pass_mask::LAYER);
    all.into()
}

/// The mask that all triangles of a material have.
fn material_mask(groups: &MaterialGroups<'_>, material: usize, pass: Option<&PeelingPass>) -> u8 {
    let layers = groups.by_material[material];
    let wire = barycentric_wire(layers);
    let mut mask = match groups.fill(material) {
        Fill::Opaque => pass_mask::SURFACE,
        Fill::Transparent => pass_mask::LAYER,
        Fill::None if wire.is_some() => pass_mask::LAYER,
        Fill::None if groups.needs_hiding_surface() => pass_mask::SURFACE,
        Fill::None => 0,
    };
    if pass.is_some_and(|pass| pass.wires_only) && wire.is_some_and(|hidden| hidden != Hidden::Hide) {
        mask |= pass_mask::LAYER;
    }
    // A side that all materials cull is left out by the surface pass already.
    match layers.surface.map_or(Cull::None, |s| s.cull) {
        cull if cull == groups.common_cull() => {}
        Cull::None => {}
        Cull::Back => mask |= pass_mask::FRONT_ONLY,
        Cull::Front => mask |= pass_mask::BACK_ONLY,
    }
    mask
}
