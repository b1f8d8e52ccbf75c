//! A [`Spec`] in the making: defaults, presets, and what can only be settled when every key is known.

use super::error::{RequestError, RequestFault};
use super::words::{LightPreset, Style};
use crate::limits::BackendChoice;
use crate::scene::color::Rgba;
use crate::scene::{
    CameraSpec, Cull, Hidden, ImageSpec, Light, Outline, OutlineUnit, Projection, Shading, Spec, Surface, View, Wire,
    WireEdges, WireMethod,
};

/// Largest thickness of a wire in multiples of `fwidth`; an exact one is in pixels.
const FWIDTH_MAX: f32 = 10.0;

/// Largest outline in pixels: wider than any picture's border needs, and far from overflowing fixed point.
const OUTLINE_PX_MAX: f32 = 100.0;

/// A spec whose dependent defaults are still open.
#[derive(Clone, Debug)]
pub struct Draft {
    /// Everything that does not depend on other keys.
    pub spec: Spec,
    /// None: 0 for exact lines, 1 for `fwidth`.
    pub smoothing: Option<f32>,
    /// Which lamps.
    pub light: LightPreset,
    /// None: 0.3 under a headlight, 1 without one.
    pub ambient: Option<f32>,
}

impl Draft {
    /// The defaults, and a style's layers.
    pub fn new(style: Style, backend: BackendChoice) -> Self {
        let surface = |shading| Some(Surface { shading, ..SURFACE });
        let wire = |hidden| Some(Wire { hidden, ..WIRE });
        let white = Some(Surface { shading: Shading::Unlit, color: Some(Rgba::WHITE), ..SURFACE });
        let (surface, wire, outline) = match style {
            Style::Flat => (surface(Shading::Flat), None, None),
            Style::Smooth => (surface(Shading::Smooth), None, None),
            Style::Unlit => (surface(Shading::Unlit), None, None),
            Style::Wire => (surface(Shading::Flat), wire(Hidden::Hide), None),
            Style::Wireframe => (None, wire(Hidden::Show), None),
            Style::Outline => (surface(Shading::Smooth), None, Some(OUTLINE)),
            Style::HiddenLine => (white, wire(Hidden::Hide), None),
        };
        let light = Light { intensity: 1.0, ambient: 0.3 };
        let spec = Spec { surface, wire, outline, camera: CAMERA, light, image: IMAGE, backend };
        Self { spec, smoothing: None, light: LightPreset::Headlight, ambient: None }
    }

    /// The surface layer, turned on by being spoken of.
    pub fn surface(&mut self) -> &mut Surface {
        self.spec.surface.get_or_insert(SURFACE)
    }

    /// The wire layer, turned on by being spoken of.
    pub fn wire(&mut self) -> &mut Wire {
        self.spec.wire.get_or_insert(WIRE)
    }

    /// The outline layer, turned on by being spoken of.
    pub fn outline(&mut self) -> &mut Outline {
        self.spec.outline.get_or_insert(OUTLINE)
    }

    /// Settles what depends on several keys.
    pub fn finish(mut self) -> Result<Spec, RequestError> {
        if let Some(wire) = &mut self.spec.wire {
            let default = if wire.method == WireMethod::Exact { 0.0 } else { 1.0 };
            wire.smoothing = self.smoothing.unwrap_or(default);
            if wire.method == WireMethod::Fwidth && wire.thickness > FWIDTH_MAX {
                let allowed = format!("a number from 0 to {FWIDTH_MAX} where `wire.method` is fwidth");
                return Err(RequestError::new(RequestFault::OutOfRange, "wire.thickness", wire.thickness, allowed));
            }
        }
        match self.light {
            LightPreset::Headlight => self.spec.light.ambient = self.ambient.unwrap_or(0.3),
            LightPreset::None => self.spec.light = Light { intensity: 0.0, ambient: self.ambient.unwrap_or(1.0) },
        }
        if let Some(Outline { unit: OutlineUnit::Px, thickness: Some(thickness), .. }) = self.spec.outline
            && thickness > OUTLINE_PX_MAX
        {
            let allowed = format!("a number from 0 to {OUTLINE_PX_MAX} where `outline.unit` is px");
            return Err(RequestError::new(RequestFault::OutOfRange, "outline.thickness", thickness, allowed));
        }
        check_camera(&self.spec.camera)?;
        Ok(self.spec)
    }
}

fn check_camera(camera: &CameraSpec) -> Result<(), RequestError> {
    let conflict = |key, given: &str, why: &str| Err(RequestError::new(RequestFault::Conflict, key, given, why));
    match (camera.eye, camera.target) {
        (Some(_), None) => conflict("camera.eye", "given", "`camera.target` is missing: give both or neither"),
        (None, Some(_)) => conflict("camera.target", "given", "`camera.eye` is missing: give both or neither"),
        (Some(eye), Some(target)) if eye == target => {
            conflict("camera.target", "the same point as `camera.eye`", "they must differ to say where to look")
        }
        _ => Ok(()),
    }
}

const SURFACE: Surface =
    Surface { shading: Shading::Flat, color: None, metallic: 0.0, roughness: 0.6, cull: Cull::None };

const WIRE: Wire = Wire {
    method: WireMethod::Exact,
    color: Rgba::BLACK,
    thickness: 1.0,
    smoothing: 0.0,
    opacity: 1.0,
    edges: WireEdges::Triangles,
    hidden: Hidden::Hide,
};

const OUTLINE: Outline = Outline { color: Rgba::BLACK, thickness: None, unit: OutlineUnit::Object };

const CAMERA: CameraSpec = CameraSpec {
    view: View::Iso,
    azimuth_deg: None,
    elevation_deg: None,
    projection: Projection::Perspective,
    fov_deg: 35.0,
    height: None,
    up: None,
    margin: 0.05,
    eye: None,
    target: None,
};

const IMAGE: ImageSpec = ImageSpec { width_px: 512, height_px: 512, format: None, samples: 4, background: Rgba::WHITE };
