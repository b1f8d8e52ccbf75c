//! Stage shade, per point: light without images. Twin of `shaders/surface/light.wgsl`.
//!
//! Lambert plus the GGX lobe for each lamp, and a sky that is brighter than the ground. Metals have
//! no diffuse colour, so they mirror a studio instead: bright above, a little brighter at the
//! horizon, dark below, and blurred by roughness.
//!
//! Both back-ends compute the same bits: a whole flat face has one light, and that may lie on the
//! threshold between two bytes.

use crate::backend::cpu::geometry::transform::quick_recip;
use crate::backend::cpu::vector::dot;
use crate::plan::{Lights, Projection};

/// Effect of light on a base colour: `base * gain + gloss`, per channel.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Factor of the base colour.
    pub gain: f32,
    /// Light that the base colour does not tint.
    pub gloss: f32,
}

impl Light {
    /// The base colour as it is.
    pub const NONE: Self = Self { gain: 1.0, gloss: 0.0 };

    /// The effect on a premultiplied colour; no channel exceeds alpha.
    #[inline(always)]
    pub fn on_premultiplied(self, c: [f32; 4]) -> [f32; 4] {
        // Not `f32::clamp`, which would not bear an alpha below 0.
        let under = |v: f32| (v * self.gain + self.gloss * c[3]).max(0.0).min(c[3].max(0.0));
        [under(c[0]), under(c[1]), under(c[2]), c[3]]
    }
}

/// A colour with straight alpha under light, clamped to 1.
#[inline(always)]
pub fn lit(base: [f32; 4], light: Light) -> [f32; 4] {
    let [r, g, b] = [0, 1, 2].map(|k| (base[k] * light.gain + light.gloss).clamp(0.0, 1.0));
    [r, g, b, base[3]]
}

/// Light on a surface with unit normal `n`: the bits of the other back-end.
#[inline(always)]
pub fn light(lights: &Lights, projection: &Projection, metallic: f32, roughness: f32, n: [f32; 3]) -> Light {
    let [gain, gloss] = light_lanes(quick_recip, lights, projection, metallic, roughness, &n.map(|v| [v]));
    Light { gain: gain[0], gloss: gloss[0] }
}

/// [`light`] on several normals: gains, then glosses. `inverse_of` is [`quick_recip`] for the bits of
/// the other back-end. The processor's own division is quicker, for normals whose bits differ anyway.
#[inline(always)]
pub fn light_lanes<const N: usize>(
    inverse_of: impl Fn(f32) -> f32,
    lights: &Lights,
    projection: &Projection,
    metallic: f32,
    roughness: f32,
    n: &[[f32; N]; 3],
) -> [[f32; N]; 2] {
    let alpha = (roughness * roughness).max(0.0025);
    let alpha_squared = alpha * alpha;
    let (mut diffuse, mut shine, mut strength) = ([0.0; N], [0.0; N], 0.0);
    for lamp in &lights.lamps {
        let light_half = dot(lamp.to_light, lamp.halfway);
        for l in 0..N {
            let n = [n[0][l], n[1][l], n[2][l]];
            let n_light = dot(n, lamp.to_light).max(0.0);
            let n_half = dot(n, lamp.halfway).max(0.0);
            let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
            let spread = lobe * lobe * (light_half * light_half).max(0.1);
            let gloss = alpha_squared * inverse_of(spread * (4.0 * roughness + 2.0));
            let direct = lamp.strength * n_light;
            diffuse[l] += direct;
            shine[l] += direct * gloss;
        }
        strength += lamp.strength;
    }
    // F0 = 0.04 (1 - metallic) + metallic base.
    let matte = 1.0 - metallic;
    let (mut gain, mut gloss) = ([0.0; N], [0.0; N]);
    for l in 0..N {
        let n_up = dot([n[0][l], n[1][l], n[2][l]], projection.screen_up);
        let ambient = lights.ambient * (0.7 + 0.3 * n_up);
        gain[l] = matte * (ambient + diffuse[l]) + metallic * shine[l];
        gloss[l] = 0.04 * matte * shine[l];
    }
    if metallic > 0.0 {
        for l in 0..N {
            let n = [n[0][l], n[1][l], n[2][l]];
            let (n_view, n_up) = (dot(n, projection.to_viewer), dot(n, projection.screen_up));
            // Schlick's rise towards grazing angles, less of it where the surface is rough.
            let grazing = 1.0 - n_view.clamp(0.0, 1.0);
            let square = grazing * grazing;
            let rise = square * square * grazing * (1.0 - roughness);
            let mirrored = 2.0 * (n_view * n_up) - dot(projection.to_viewer, projection.screen_up);
            let seen = metallic * (lights.ambient + 0.5 * strength) * studio(&inverse_of, mirrored, roughness);
            gain[l] += seen * (1.0 - rise);
            gloss[l] += seen * rise;
        }
    }
    [gain, gloss]
}

/// Brightness of the studio in a direction that rises by `up` (the sine of its elevation).
#[inline(always)]
fn studio(inverse_of: impl Fn(f32) -> f32, up: f32, roughness: f32) -> f32 {
    const GROUND: f32 = 0.36;
    const SKY_ABOVE_GROUND: f32 = 0.79;
    const HORIZON: f32 = 0.35;
    let blur = 0.2 + 0.8 * roughness;
    let square = blur * blur;
    // 1 / blur and 1 / sum by one reciprocal.
    let sum = square + 4.0 * (up * up);
    let inverse = inverse_of(blur * sum);
    // 0 below -blur, 1 above blur.
    let t = (0.5 + (0.5 * up) * (sum * inverse)).clamp(0.0, 1.0);
    let sky = t * t * (3.0 - 2.0 * t);
    let horizon = (HORIZON * (1.0 - roughness)) * ((square * blur) * inverse);
    (GROUND + SKY_ABOVE_GROUND * sky) + horizon
}
