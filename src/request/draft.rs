//! A [`Spec`] in the making: defaults, presets, and what can only be settled when every key is known.

use super::error::{RequestError, RequestFault};
use super::words::Style;
use crate::limits::BackendChoice;
use crate::scene::color::Rgba;
use crate::scene::{
    CameraSpec, Cull, DebugView, FlatNormals, Hidden, ImageSpec, Layers, Light, LightPreset, Outline, OutlineMethod,
    OutlineUnit, Projection, Shading, Spec, Surface, Topology, View, Wire, WireEdges, WireMethod,
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
            Style::Wireframe => (None, wire(Hidden::Fade), None),
            Style::Outline => (surface(Shading::Smooth), None, Some(OUTLINE)),
            Style::HiddenLine => (white, wire(Hidden::Hide), None),
            Style::Topology => (surface(Shading::Flat), None, None),
        };
        let light = Light { preset: LightPreset::Headlight, direction: None, intensity: 1.0, ambient: 0.3 };
        let topology = (style == Style::Topology).then_some(TOPOLOGY);
        let layers = Layers { surface, wire, outline };
        let spec = Spec { layers, materials: Vec::new(), topology, camera: CAMERA, light, image: IMAGE, backend };
        Self { spec, smoothing: None, ambient: None }
    }

    /// The surface layer, turned on by being spoken of.
    pub fn surface(&mut self) -> &mut Surface {
        self.spec.layers.surface.get_or_insert(SURFACE)
    }

    /// The wire layer, turned on by being spoken of.
    pub fn wire(&mut self) -> &mut Wire {
        self.spec.layers.wire.get_or_insert(WIRE)
    }

    /// The outline layer, turned on by being spoken of.
    pub fn outline(&mut self) -> &mut Outline {
        self.spec.layers.outline.get_or_insert(OUTLINE)
    }

    /// Settles what depends on several keys.
    pub fn finish(mut self) -> Result<Spec, RequestError> {
        if let Some(wire) = &mut self.spec.layers.wire {
            let default = if wire.method == WireMethod::Exact { 0.0 } else { 1.0 };
            wire.smoothing = self.smoothing.unwrap_or(default);
            if wire.method == WireMethod::Fwidth && wire.thickness > FWIDTH_MAX {
                let allowed = format!("a number from 0 to {FWIDTH_MAX} where `wire.method` is fwidth");
                return Err(RequestError::new(RequestFault::OutOfRange, "wire.thickness", wire.thickness, allowed));
            }
        }
        let has_lamps = self.spec.light.preset != LightPreset::None;
        self.spec.light.ambient = self.ambient.unwrap_or(if has_lamps { 0.3 } else { 1.0 });
        if let Some(Outline { unit: OutlineUnit::Px, thickness: Some(thickness), .. }) = self.spec.layers.outline
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

const SURFACE: Surface = Surface {
    shading: Shading::Flat,
    normals: FlatNormals::Face,
    color: None,
    metallic: None,
    roughness: None,
    emissive: None,
    opacity: 1.0,
    textures: true,
    debug: DebugView::None,
    cull: Cull::None,
};

const WIRE: Wire = Wire {
    method: WireMethod::Exact,
    color: Rgba::BLACK,
    thickness: 1.0,
    smoothing: 0.0,
    opacity: 1.0,
    lit: false,
    edges: WireEdges::Triangles,
    feature_angle_deg: 30.0,
    hidden: Hidden::Hide,
};

const OUTLINE: Outline =
    Outline { method: OutlineMethod::Hull, color: Rgba::BLACK, thickness: None, unit: OutlineUnit::Object };

const TOPOLOGY: Topology = Topology {
    polygon: Some(Rgba::BLACK),
    crease: None,
    open: Some(Rgba([1.0, 0.0, 0.0, 1.0])),
    nonmanifold: Some(Rgba([0.5, 0.0, 0.5, 1.0])),
    crease_angle_deg: 30.0,
    thickness: 1.0,
};

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
    from_file: false,
};

const IMAGE: ImageSpec = ImageSpec { width_px: 512, height_px: 512, format: None, samples: 4, background: Rgba::WHITE };
