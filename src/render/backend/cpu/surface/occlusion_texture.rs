//! The effect of a mesh file's occlusion texture, which darkens ambient light and no other (stage shade, per point).
//! Twin of `shaders/surface/occlusion_texture.wgsl`.

use super::light::LightLanes;
use crate::backend::cpu::vector::dot;
use crate::plan::{Lights, Projection};

/// Takes ambient light away where the texture's red is below 1. `strength` is 0 for none of it to 1; metals
/// have no ambient light of this kind, and keep what they mirror.
#[inline(always)]
pub fn apply_occlusion_texture<const N: usize>(
    light: &mut LightLanes<N>,
    (lights, projection): (&Lights, &Projection),
    (strength, red): (f32, &[f32; N]),
    metallic: &[f32; N],
    n: &[[f32; N]; 3],
) {
    for l in 0..N {
        let n_up = dot([n[0][l], n[1][l], n[2][l]], projection.screen_up);
        let ambient = (1.0 - metallic[l]) * (lights.ambient * (0.7 + 0.3 * n_up));
        light.gain[l] -= ambient * (strength * (1.0 - red[l]));
    }
}
