//! Wires from barycentric coordinates. Twin of `shaders/wire.wgsl`.

use super::barycentric::Barycentrics;
use crate::plan::{MaterialLook, SurfacePass};

/// 1 on the wire, 0 away from it.
pub fn wire_factor(surface: &SurfacePass<'_>, wire: &MaterialLook, id: usize, b: &Barycentrics) -> f32 {
    let mask = surface.edge_masks.get(id).copied().unwrap_or(0b111);
    let mut away = 1.0_f32;
    let (thickness, smoothing) = (wire.wire_thickness, wire.wire_smoothing);
    for i in 0..3 {
        // Coordinate i vanishes on the edge opposite corner i, which runs from corner i + 1 to i + 2.
        if mask >> ((i + 1) % 3) & 1 == 1 {
            let d = b.fwidth[i];
            away = away.min(smoothstep(thickness * d, (thickness + smoothing) * d, b.value[i]));
        }
    }
    1.0 - away
}

fn smoothstep(from: f32, to: f32, v: f32) -> f32 {
    if to <= from {
        return if v < from { 0.0 } else { 1.0 };
    }
    let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
