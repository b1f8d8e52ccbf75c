//! Debug views, which show data of triangles as colours: barycentric coordinates, normals, texture coordinates and
//! others (stage shade, per point). Twin of `shaders/surface/debug.wgsl`.

use super::barycentric::{Corners, edge_distances_px};
use super::light::{light, lit};
use super::normal::normals;
use super::texture::{Uv, blend, floor, of_corners};
use super::wire::{ShadedPoints, edge_mask, is_drawn};
use crate::backend::cpu::vector::dot;
use crate::plan::{ShadedMaterial, SurfacePass, debug_views, flags};

/// The material's debug view at a point: opaque linear RGBA.
pub fn color(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    place: &ShadedPoints<'_, 1>,
    corners: &Corners<1>,
) -> [f32; 4] {
    let [b0, b1, b2] = place.b.value.map(|[v]| v);
    let projection = &place.context.plan.projection;
    let normal = || normals(surface, material, place).map(|[v]| v);
    match (material.flags & flags::DEBUG) >> flags::DEBUG_SHIFT {
        debug_views::BARYCENTRIC => shown([b0, b1, b2]),
        debug_views::MIN_BARYCENTRIC => shown([3.0 * b0.min(b1).min(b2); 3]),
        debug_views::EDGE_DISTANCE => {
            let mask = edge_mask(surface, place.ids[0]);
            let px = edge_distances_px(corners);
            let nearest = (0..3).filter(|&i| is_drawn(mask, i)).fold(8.0_f32, |least, i| least.min(px[i]));
            shown([nearest / 8.0; 3])
        }
        debug_views::NORMAL if material.flags & flags::LIT != 0 => {
            let n = normal();
            let axes = [projection.screen_right, projection.screen_up, projection.to_viewer];
            shown(axes.map(|axis| 0.5 + 0.5 * dot(n, axis)))
        }
        debug_views::UV => match &surface.uvs {
            Some(uvs) => shown(checker(Uv::new(&of_corners(uvs, &place.ids), &place.b).at.map(|[v]| v))),
            None => shown([0.5; 3]),
        },
        debug_views::FACE_ORIENTATION => {
            let paint = if place.b.front[0] { [0.36, 0.56, 0.86] } else { [0.86, 0.30, 0.26] };
            if material.flags & flags::LIT == 0 {
                return shown(paint);
            }
            lit(shown(paint), light(&surface.lights, projection, 0.0, material.roughness, normal()))
        }
        debug_views::VERTEX_COLOR => match &surface.colors {
            Some(colors) => {
                let [[r], [g], [b], _] = blend(&of_corners(colors, &place.ids), &place.b.value);
                [r, g, b, 1.0]
            }
            None => shown([0.5; 3]),
        },
        _ => shown([0.5; 3]),
    }
}

/// Eight squares a unit; u in red, v in green.
fn checker(uv: [f32; 2]) -> [f32; 3] {
    let uv = uv.map(|v| if v.abs() <= 1e30 { v.clamp(-65536.0, 65536.0) } else { 0.0 });
    let [i, j] = uv.map(|v| floor(8.0 * v));
    let bright = if (i + j) & 1 == 0 { 1.0 } else { 0.55 };
    let [u, v] = uv.map(|v| v - floor(v) as f32);
    [bright * (0.2 + 0.8 * u), bright * (0.2 + 0.8 * v), bright * 0.45]
}

/// The linear colour that is stored as these values: sRGB decoding (IEC 61966-2-1), the same bits
/// on both back-ends.
fn shown(display: [f32; 3]) -> [f32; 4] {
    let [r, g, b] = display.map(|v| {
        let v = v.clamp(0.0, 1.0);
        if v <= 0.04045 {
            return v * (1.0 / 12.92);
        }
        // Divided by 1.055. Written out: shaders fold constants in f64.
        let t = (v + 0.055) * 0.947_867_3;
        // t^2.4 = (t t^(-1/5))^3, the root by Newton's iteration from an integer guess.
        let mut root = f32::from_bits(0x4C2C_47E5_u32.wrapping_sub(t.to_bits() / 5));
        for _ in 0..4 {
            let square = root * root;
            root = root * (1.2 - (0.2 * t) * ((square * square) * root));
        }
        let part = t * root;
        (part * part) * part
    });
    [r, g, b, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::srgb::srgb_to_linear;

    #[test]
    fn display_values_are_decoded() {
        for i in 0..=1000 {
            let v = i as f32 / 1000.0;
            let want = srgb_to_linear(f64::from(v));
            assert!((f64::from(shown([v; 3])[0]) - want).abs() < 1e-6, "{v}");
        }
        assert_eq!(shown([-1.0, 0.0, 7.0])[..2], [0.0; 2]);
        assert_eq!(shown([7.0; 3]), shown([1.0; 3]));
    }
}
