//! The light of lamps and surroundings at a point of a surface, by formulas and without an image (stage shade). Twin of
//! `shaders/surface/light.wgsl`.
//!
//! Lambert plus the GGX lobe for each lamp, and ambient light that is brighter from the top of the picture than from its
//! bottom. Metals have no diffuse colour. So they also mirror surroundings that turn with the camera: a dark room with three
//! bright windows, blurred by roughness.
//!
//! For faces that have one normal, both back-ends compute the same bits. Such a face has the same light all over.
//! If its colour lies on the rounding threshold between two 8-bit values, a different last bit would change all its pixels.

use crate::backend::cpu::geometry::transform::quick_recip;
use crate::backend::cpu::vector::dot;
use crate::plan::{Lights, Projection};

/// Share of the brightest value below which light is shown as it is.
pub const SHOULDER: f32 = 0.8;

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
        let lit = |v: f32| rolled_off(v * self.gain + self.gloss * c[3], c[3].max(0.0));
        [lit(c[0]), lit(c[1]), lit(c[2]), c[3]]
    }
}

/// As [`Light`], at `N` points.
pub struct LightLanes<const N: usize> {
    pub gain: [f32; N],
    pub gloss: [f32; N],
}

impl<const N: usize> LightLanes<N> {
    /// The base colours as they are.
    pub const NONE: Self = Self { gain: [Light::NONE.gain; N], gloss: [Light::NONE.gloss; N] };

    /// The same where only a share of the light is there.
    #[inline(always)]
    pub fn dimmed(mut self, open: &[f32; N]) -> Self {
        for l in 0..N {
            self.gain[l] *= open[l];
            self.gloss[l] *= open[l];
        }
        self
    }
}

/// A value of light that is shown: as it is up to the shoulder, and above it nearing `white` without ever
/// reaching it, so that bright surfaces keep their form (Reinhard et al. 2002, applied above the
/// shoulder).
#[inline(always)]
fn rolled_off(v: f32, white: f32) -> f32 {
    let start = SHOULDER * white;
    let (room, over) = (white - start, (v - start).max(0.0));
    let inverse = quick_recip((room + over).max(1e-30));
    v.max(0.0).min(start) + (room * over) * inverse
}

/// A colour with straight alpha under light.
#[inline(always)]
pub fn lit(base: [f32; 4], light: Light) -> [f32; 4] {
    lit_lanes(&base.map(|v| [v]), &LightLanes { gain: [light.gain], gloss: [light.gloss] }).map(|[v]| v)
}

/// As [`lit`], at `N` points.
#[inline(always)]
pub fn lit_lanes<const N: usize>(base: &[[f32; N]; 4], light: &LightLanes<N>) -> [[f32; N]; 4] {
    let mut colors = *base;
    for k in 0..3 {
        for l in 0..N {
            colors[k][l] = rolled_off(base[k][l] * light.gain[l] + light.gloss[l], 1.0);
        }
    }
    colors
}

/// Colours as they are, clamped to 1.
#[inline(always)]
pub fn unlit_lanes<const N: usize>(base: &[[f32; N]; 4]) -> [[f32; N]; 4] {
    let mut colors = *base;
    for k in 0..3 {
        for l in 0..N {
            colors[k][l] = base[k][l].clamp(0.0, 1.0);
        }
    }
    colors
}

/// Light on a surface with unit normal `n`: the bits of the other back-end.
#[inline(always)]
pub fn light(lights: &Lights, projection: &Projection, metallic: f32, roughness: f32, n: [f32; 3]) -> Light {
    let LightLanes { gain: [gain], gloss: [gloss] } =
        light_lanes(quick_recip, lights, projection, &[metallic], &[roughness], &n.map(|v| [v]));
    Light { gain, gloss }
}

/// [`light`] at `N` points. `inverse_of` is [`quick_recip`] for the bits of
/// the other back-end. The processor's own division is quicker, for normals whose bits differ anyway.
#[inline(always)]
pub fn light_lanes<const N: usize>(
    inverse_of: impl Fn(f32) -> f32,
    lights: &Lights,
    projection: &Projection,
    metallic: &[f32; N],
    roughness: &[f32; N],
    n: &[[f32; N]; 3],
) -> LightLanes<N> {
    let mut alpha_squared = [0.0; N];
    for l in 0..N {
        let alpha = (roughness[l] * roughness[l]).max(0.0025);
        alpha_squared[l] = alpha * alpha;
    }
    let (mut diffuse, mut shine, mut strength) = ([0.0; N], [0.0; N], 0.0);
    for lamp in &lights.lamps {
        let light_half = dot(lamp.to_light, lamp.halfway);
        for l in 0..N {
            let n = [n[0][l], n[1][l], n[2][l]];
            let n_light = dot(n, lamp.to_light).max(0.0);
            let n_half = dot(n, lamp.halfway).max(0.0);
            let lobe = n_half * n_half * (alpha_squared[l] - 1.0) + 1.0;
            let spread = lobe * lobe * (light_half * light_half).max(0.1);
            let gloss = alpha_squared[l] * inverse_of(spread * (4.0 * roughness[l] + 2.0));
            let direct = lamp.strength * n_light;
            diffuse[l] += direct;
            shine[l] += direct * gloss;
        }
        strength += lamp.strength;
    }
    // F0 = 0.04 (1 - metallic) + metallic base.
    let mut light = LightLanes::NONE;
    for l in 0..N {
        let matte = 1.0 - metallic[l];
        let n_up = dot([n[0][l], n[1][l], n[2][l]], projection.screen_up);
        let ambient = lights.ambient * (0.7 + 0.3 * n_up);
        light.gain[l] = matte * (ambient + diffuse[l]) + metallic[l] * shine[l];
        light.gloss[l] = 0.04 * matte * shine[l];
    }
    if metallic.iter().all(|metallic| *metallic <= 0.0) {
        return light;
    }
    for l in 0..N {
        let n = [n[0][l], n[1][l], n[2][l]];
        let (n_view, n_up) = (dot(n, projection.to_viewer), dot(n, projection.screen_up));
        // Schlick's rise towards grazing angles, less of it where the surface is rough.
        let grazing = 1.0 - n_view.clamp(0.0, 1.0);
        let square = grazing * grazing;
        let rise = square * square * grazing * (1.0 - roughness[l]);
        // The view's mirror image.
        let mirrored = |axis: [f32; 3], n_axis: f32| 2.0 * (n_view * n_axis) - dot(projection.to_viewer, axis);
        let right = mirrored(projection.screen_right, dot(n, projection.screen_right));
        let up = mirrored(projection.screen_up, n_up);
        let brightness = surroundings(&inverse_of, right, up, roughness[l]);
        let seen = metallic[l] * (lights.ambient + 0.5 * strength) * brightness;
        let (gain, gloss) = (light.gain[l] + seen * (1.0 - rise), light.gloss[l] + seen * rise);
        let is_metal = metallic[l] > 0.0;
        light.gain[l] = if is_metal { gain } else { light.gain[l] };
        light.gloss[l] = if is_metal { gloss } else { light.gloss[l] };
    }
    light
}

/// A window of the surroundings: a rectangle on screen, of directions of length 1. Directions before the model and
/// behind it share it.
struct Window {
    /// Left and right edge.
    right: [f32; 2],
    /// Lower and upper edge.
    up: [f32; 2],
    brightness: f32,
}

/// One above the viewer's left shoulder, and a tall one at each side.
const WINDOWS: [Window; 3] = [
    Window { right: [-0.5, -0.22], up: [0.68, 0.86], brightness: 3.5 },
    Window { right: [0.74, 0.92], up: [-0.35, 0.5], brightness: 3.2 },
    Window { right: [-0.92, -0.8], up: [-0.4, 0.6], brightness: 3.2 },
];

/// Brightness of the surroundings in the direction of length 1 that points so far to the right and up, on screen.
#[inline(always)]
fn surroundings(inverse_of: impl Fn(f32) -> f32, right: f32, up: f32, roughness: f32) -> f32 {
    const GROUND: f32 = 0.08;
    const SKY_ABOVE_GROUND: f32 = 0.34;
    let alpha = (roughness * roughness).max(0.0025);
    // Half the width of a window's soft edge, and the inverse of the whole, by one reciprocal.
    let sum = alpha + 0.7;
    let inverse = inverse_of(3.6 * (alpha * sum));
    let blur = (6.48 * (alpha * alpha)) * inverse;
    let sharpness = ((sum * sum) * inverse).min(25.0);
    let sky = soft_step(up, 0.0, sharpness.min(2.0));
    let mut windows = 0.0;
    for window in &WINDOWS {
        let across = soft_step(right, window.right[0], sharpness) - soft_step(right, window.right[1], sharpness);
        let along = soft_step(up, window.up[0], sharpness) - soft_step(up, window.up[1], sharpness);
        windows += window.brightness * (across * along);
    }
    // Towards the rim of the view a window has a larger solid angle than its rectangle, so blurred light gets more
    // of it.
    (GROUND + SKY_ABOVE_GROUND * sky) + (1.0 + blur * blur) * windows
}

/// 0 far below a soft edge, 1 far above.
#[inline(always)]
fn soft_step(place: f32, edge: f32, sharpness: f32) -> f32 {
    let t = (0.5 + (place - edge) * sharpness).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
