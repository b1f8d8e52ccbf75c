//! Wires along the edges of triangles, found at a shaded point from its barycentric coordinates (stage shade). Twin
//! of `shaders/surface/wire.wgsl`.

use super::barycentric::{Barycentrics, Quad};
use crate::backend::cpu::context::RasterContext;
use crate::plan::{ShadedMaterial, SurfacePass, flags};

/// `N` shaded points: their triangles and their positions.
pub struct ShadedPoints<'a, const N: usize> {
    /// Everything that is drawn.
    pub context: &'a RasterContext<'a>,
    /// The triangles.
    pub ids: [u32; N],
    /// Columns, then rows, in 1/256 px from the picture's centre.
    pub at: [[f32; N]; 2],
    /// At the points.
    pub b: Barycentrics<N>,
}

/// 1 on the wire, 0 away from it, of points of one material.
#[inline(always)]
pub fn wire_covers<const N: usize>(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    place: &ShadedPoints<'_, N>,
) -> [f32; N] {
    let masks = place.ids.map(|id| edge_mask(surface, id));
    let b = &place.b;
    if material.flags & flags::WIRE_FWIDTH != 0 {
        return fwidth_covers(&masks, material, b);
    }
    let (thickness, end) = (material.wire_thickness, material.wire_thickness + material.wire_smoothing);
    let nearest = min_drawn(&masks, &b.value);
    let mut covers = [0.0; N];
    if material.flags & flags::WIRE_FWIDTH_MIN != 0 {
        // As a GPU's derivatives of the minimum would be: across a corner's bisector they mix two
        // coordinates.
        let quad = Quad::around(place.context.plan, &place.at);
        let [own, across, down] = quad.barycentrics(place.context, &place.ids).map(|value| min_drawn(&masks, &value));
        for l in 0..N {
            let d = (across[l] - own[l]).abs() + (down[l] - own[l]).abs();
            covers[l] = 1.0 - smoothstep(thickness * d, end * d, nearest[l]);
        }
        return covers;
    }
    let is_soft = material.flags & flags::WIRE_BARYCENTRIC != 0;
    for l in 0..N {
        let soft = 1.0 - smoothstep(0.0, 0.1 * thickness, nearest[l]);
        let hard = if nearest[l] < 0.02 * thickness { 1.0 } else { 0.0 };
        covers[l] = if is_soft { soft } else { hard };
    }
    covers
}

/// Coverage of each point by a wire, 0 to 1: one less the smallest smoothstep of the coordinates of drawn edges, each
/// by its own exact width. `masks` say which edges of each point's triangle are drawn.
#[inline(always)]
pub fn fwidth_covers<const N: usize>(masks: &[u8; N], material: &ShadedMaterial, b: &Barycentrics<N>) -> [f32; N] {
    let (thickness, end) = (material.wire_thickness, material.wire_thickness + material.wire_smoothing);
    let mut away = [1.0_f32; N];
    for i in 0..3 {
        let widths = b.fwidth(i);
        for l in 0..N {
            let step = smoothstep(thickness * widths[l], end * widths[l], b.value[i][l]);
            let nearer = away[l].min(step);
            away[l] = if is_drawn(masks[l], i) { nearer } else { away[l] };
        }
    }
    away.map(|away| 1.0 - away)
}

/// The edges of a triangle that are drawn: bit i runs from corner i to i + 1.
#[inline(always)]
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
#[inline(always)]
fn min_drawn<const N: usize>(masks: &[u8; N], value: &[[f32; N]; 3]) -> [f32; N] {
    let mut least = [1e30_f32; N];
    for i in 0..3 {
        for l in 0..N {
            let nearer = value[i][l].min(least[l]);
            least[l] = if is_drawn(masks[l], i) { nearer } else { least[l] };
        }
    }
    least
}

/// 0 up to `from`, 1 from `to` on.
#[inline(always)]
pub fn smoothstep(from: f32, to: f32, v: f32) -> f32 {
    let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
    let smooth = t * t * (3.0 - 2.0 * t);
    let sharp = if v < from { 0.0 } else { 1.0 };
    if to <= from { sharp } else { smooth }
}
