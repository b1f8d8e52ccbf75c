//! Stage shade, per point: wires from barycentric coordinates. Twin of `shaders/surface/wire.wgsl`.

use super::barycentric::{Barycentrics, Quad};
use crate::backend::cpu::RasterContext;
use crate::plan::{ShadedMaterial, SurfacePass, flags};

/// A shaded point: its triangle and its position.
pub struct Place<'a> {
    /// Everything that is drawn.
    pub context: &'a RasterContext<'a>,
    /// The triangle.
    pub id: u32,
    /// In 1/256 px from the picture's centre.
    pub at: [f32; 2],
    /// At the point.
    pub b: Barycentrics,
}

/// 1 on the wire, 0 away from it.
pub fn wire_cover(surface: &SurfacePass<'_>, material: &ShadedMaterial, place: &Place<'_>) -> f32 {
    let mask = edge_mask(surface, place.id);
    let b = &place.b;
    if material.flags & flags::WIRE_FWIDTH != 0 {
        return fwidth_cover(mask, material, b);
    }
    let (thickness, end) = (material.wire_thickness, material.wire_thickness + material.wire_smoothing);
    let nearest = min_drawn(mask, b.value);
    if material.flags & flags::WIRE_FWIDTH_MIN != 0 {
        // As a GPU's derivatives of the minimum would be: across a corner's bisector they mix two
        // coordinates.
        let quad = Quad::around(place.context.plan, place.at);
        let [own, across, down] = quad.barycentrics(place.context, place.id).map(|value| min_drawn(mask, value));
        let d = (across - own).abs() + (down - own).abs();
        return 1.0 - smoothstep(thickness * d, end * d, nearest);
    }
    if material.flags & flags::WIRE_BARYCENTRIC != 0 {
        return 1.0 - smoothstep(0.0, 0.1 * thickness, nearest);
    }
    if nearest < 0.02 * thickness { 1.0 } else { 0.0 }
}

/// The smoothstep of each coordinate by its own exact width, and the minimum of the three.
#[inline(always)]
pub fn fwidth_cover(mask: u8, material: &ShadedMaterial, b: &Barycentrics) -> f32 {
    let (thickness, end) = (material.wire_thickness, material.wire_thickness + material.wire_smoothing);
    let mut away = 1.0_f32;
    for i in 0..3 {
        if is_drawn(mask, i) {
            let d = b.fwidth(i);
            away = away.min(smoothstep(thickness * d, end * d, b.value[i]));
        }
    }
    1.0 - away
}

/// The edges of a triangle that are drawn: bit i runs from corner i to i + 1.
pub fn edge_mask(surface: &SurfacePass<'_>, id: u32) -> u8 {
    surface.edge_masks.get(id as usize).copied().unwrap_or(0b111)
}

/// True if the edge opposite corner `i` is drawn, where coordinate i vanishes. It runs from corner
/// i + 1 to i + 2.
#[inline(always)]
pub fn is_drawn(mask: u8, i: usize) -> bool {
    mask >> ((i + 1) % 3) & 1 == 1
}

/// The smallest coordinate of a drawn edge; far away where none is drawn.
fn min_drawn(mask: u8, value: [f32; 3]) -> f32 {
    (0..3).filter(|&i| is_drawn(mask, i)).fold(1e30, |least, i| value[i].min(least))
}

/// 0 up to `from`, 1 from `to` on.
#[inline(always)]
pub fn smoothstep(from: f32, to: f32, v: f32) -> f32 {
    if to <= from {
        return if v < from { 0.0 } else { 1.0 };
    }
    let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
