//! The lamps of each lighting preset of a request. They turn with the camera, so that every view of a
//! model is lit equally well. Only the key light may have a direction from the request instead, in the
//! file's coordinates.

use glam::DVec3;

use crate::plan::{Lamp, Lights};
use crate::scene::camera::Camera;
use crate::spec::{Light, LightPreset};

/// A lamp's place in the camera's axes (right, up, towards the viewer) and its share of the
/// intensity.
type LampPosition = ([f64; 3], f32);

/// A lamp over the viewer's left shoulder. One straight ahead would leave shapes without a lit
/// side.
const HEADLIGHT: &[LampPosition] = &[([-0.5, 0.7, 1.0], 1.0)];

/// A key light from the left and above, a weak fill light from the right that keeps the shadow side
/// readable, and a rim light from behind that lifts the shape off the background.
const THREE_POINT: &[LampPosition] = &[([-0.8, 0.9, 0.9], 0.85), ([1.0, 0.15, 0.7], 0.35), ([0.5, 0.9, -0.8], 0.55)];

/// Large lamps at the left and the right of the viewer, and one above: few shadows, and edges that each
/// catch another of them.
const STUDIO: &[LampPosition] = &[([-0.7, 0.6, 1.0], 0.62), ([1.0, 0.1, 0.7], 0.28), ([0.1, 1.0, 0.05], 0.3)];

/// The lamps of a scene.
pub fn lights(light: &Light, camera: &Camera) -> Lights {
    let [right, up, back] = camera.axes;
    let places = match light.preset {
        LightPreset::Headlight => HEADLIGHT,
        LightPreset::ThreePoint => THREE_POINT,
        LightPreset::Studio => STUDIO,
        LightPreset::None => &[],
    };
    let strength = (1.0 - light.ambient) * light.intensity;
    let lamp = |(i, &([x, y, z], share)): (usize, &LampPosition)| {
        let preset = right * x + up * y + back * z;
        // The first lamp is the key light.
        let given = light.direction.filter(|_| i == 0).and_then(|d| (-DVec3::from(d)).try_normalize());
        let to_light = given.unwrap_or(preset.normalize());
        // A lamp exactly behind the model has no highlight on any side that is seen.
        let halfway = (to_light + back).try_normalize().unwrap_or(up);
        Lamp {
            to_light: to_light.as_vec3().to_array(),
            halfway: halfway.as_vec3().to_array(),
            strength: strength * share,
        }
    };
    Lights { lamps: places.iter().enumerate().map(lamp).collect(), ambient: light.ambient }
}
