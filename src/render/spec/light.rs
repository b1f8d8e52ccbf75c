//! Lamps and ambient light, as a request describes them.

use super::words::word_enums;

word_enums! {
    /// Sets of lamps.
    pub enum LightPreset {
        /// One lamp over the viewer's shoulder.
        Headlight = "headlight",
        /// Key, fill and rim lamps as in a studio; they turn with the camera.
        ThreePoint = "three-point",
        /// Large lamps at the left, at the right and above, as around a photographer's tent; the left one is the
        /// strongest.
        Studio = "studio",
        /// No lamps: ambient light alone.
        None = "none",
    }
}

/// Lamps and ambient light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The set of lamps.
    pub preset: LightPreset,
    /// Direction in which the key light shines, in file space and never zero. None: the preset's
    /// direction, relative to the camera.
    pub direction: Option<[f64; 3]>,
    /// Strength of the lamps, 0 to 10.
    pub intensity: f32,
    /// Share of light that comes from everywhere, 0 to 1.
    pub ambient: f32,
    /// Share of the light that the bottom of a deep hollow goes without, 0 to 1.
    pub ambient_occlusion: f32,
}

impl Default for Light {
    fn default() -> Self {
        Self { preset: LightPreset::Headlight, direction: None, intensity: 1.0, ambient: 0.3, ambient_occlusion: 0.0 }
    }
}
