//! A [`Spec`] in the making: defaults, presets, and what can only be settled when every key is known.

use super::error::{RequestError, RequestFault};
use crate::request::layer_draft::Look;
use crate::request::table::words::{Style, Words, word_for};
use crate::spec::BackendChoice;
use crate::spec::color::Rgba;
use crate::spec::{
    CameraSpec, ImageSpec, Layers, Light, LightPreset, NamedView, Open, OutlineMethod, ProjectionKind, QualityTarget,
    Spec, Topology, WireMethod,
};

/// Different exact wires and contours in one picture.
const LINE_STYLES_MAX: usize = 64;

/// A spec whose dependent defaults are still open.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The document's own layers; each of its materials begins from them.
    pub look: Look,
    /// The topology layer, if it is on.
    pub topology: Option<Topology>,
    /// See [`Spec::time_s`].
    pub time_s: Option<f64>,
    /// See [`Spec::camera`].
    pub camera: CameraSpec,
    /// See [`Spec::light`]; but for the ambient share.
    pub light: Light,
    /// None: 0.3 where there are lamps, 1 where there are none.
    pub ambient: Option<f32>,
    /// See [`Spec::image`].
    pub image: ImageSpec,
    /// See [`Spec::backend`].
    pub backend: BackendChoice,
    /// See [`QualityTarget::max_error`].
    pub max_error: Option<f64>,
    /// See [`QualityTarget::max_time_ms`].
    pub max_time_ms: Option<f64>,
    /// What nobody has settled yet; but for the wires.
    pub open: Open,
}

impl Draft {
    /// The defaults, and a style's layers.
    pub fn new(style: Style, backend: BackendChoice) -> Self {
        Self {
            look: Look::new(style),
            topology: (style == Style::Topology).then(default_topology),
            time_s: None,
            camera: CAMERA,
            light: Light { preset: LightPreset::Headlight, direction: None, intensity: 1.0, ambient: 0.3 },
            ambient: None,
            image: IMAGE,
            backend,
            max_error: None,
            max_time_ms: None,
            // Whoever runs a server with one back-end has a reason.
            open: Open { samples: true, backend: backend == BackendChoice::Auto, ..Open::default() },
        }
    }

    /// The topology layer, turned on by being spoken of.
    pub fn topology(&mut self) -> &mut Topology {
        self.topology.get_or_insert_with(default_topology)
    }

    /// Turns the topology layer on or off.
    pub fn turn_topology(&mut self, on: bool) {
        self.topology = on.then(|| *self.topology());
    }

    /// Settles what depends on several keys. Each material has a name.
    pub fn finish(self, materials: Vec<(String, Look)>) -> Result<Spec, RequestError> {
        let Self {
            look,
            topology,
            time_s,
            camera,
            mut light,
            ambient,
            image,
            backend,
            max_error,
            max_time_ms,
            mut open,
        } = self;
        open.wire = look.has_open_wire();
        open.material_wires = materials.iter().map(|(_, look)| look.has_open_wire()).collect();
        let is_asked = max_error.is_some() || max_time_ms.is_some();
        let quality_target = is_asked.then_some(QualityTarget { max_error, max_time_ms, open });
        let layers = look.finish("")?;
        let materials = materials.into_iter().map(|(name, look)| {
            let layers = look.finish(&format!("materials.{name}."))?;
            Ok((name, layers))
        });
        let materials = materials.collect::<Result<Vec<_>, _>>()?;
        check_parts(&layers, &materials)?;
        check_camera(&camera)?;
        let has_lamps = light.preset != LightPreset::None;
        light.ambient = ambient.unwrap_or(if has_lamps { 0.3 } else { 1.0 });
        Ok(Spec { layers, materials, topology, time_s, camera, light, image, backend, quality_target })
    }
}

/// What all parts of a picture share.
fn check_parts(layers: &Layers, materials: &[(String, Layers)]) -> Result<(), RequestError> {
    let unit = |layers: &Layers| layers.outline.filter(|o| o.method == OutlineMethod::Hull).map(|o| o.unit);
    check_shared(layers, materials, "outline.unit", unit, "all hulls of one picture have the same unit")?;
    let hidden = |layers: &Layers| layers.wire.filter(|w| w.method != WireMethod::Exact).map(|w| w.hidden);
    check_shared(layers, materials, "wire.hidden", hidden, "all wires by barycentrics do the same in one picture")?;

    // Each is a pass over the picture.
    let exact = |layers: &Layers| layers.wire.filter(|wire| wire.method == WireMethod::Exact);
    let contour = |layers: &Layers| layers.outline.filter(|outline| outline.method == OutlineMethod::Contour);
    let (mut wires, mut contours) = (Vec::new(), Vec::new());
    for layers in std::iter::once(layers).chain(materials.iter().map(|(_, layers)| layers)) {
        wires.extend(exact(layers).filter(|wire| !wires.contains(wire)));
        contours.extend(contour(layers).filter(|outline| !contours.contains(outline)));
        if wires.len() + contours.len() > LINE_STYLES_MAX {
            let given = format!("more than {LINE_STYLES_MAX} different wires and contours");
            let why = format!("allowed are {LINE_STYLES_MAX} in one picture");
            return Err(RequestError::new(RequestFault::Conflict, "materials", given, why));
        }
    }
    Ok(())
}

/// Fails where two parts that have a value of this key have different ones.
fn check_shared<T: Words + PartialEq>(
    layers: &Layers,
    materials: &[(String, Layers)],
    key: &str,
    value: impl Fn(&Layers) -> Option<T>,
    rule: &str,
) -> Result<(), RequestError> {
    let named = materials.iter().map(|(name, layers)| (format!("materials.{name}.{key}"), value(layers)));
    let mut first: Option<(String, T)> = None;
    for (key, value) in std::iter::once((key.to_owned(), value(layers))).chain(named) {
        let Some(value) = value else { continue };
        match &first {
            None => first = Some((key, value)),
            Some((other, of_other)) if *of_other != value => {
                let why = format!("`{other}` is {}: {rule}", word_for(*of_other));
                return Err(RequestError::new(RequestFault::Conflict, &key, word_for(value), why));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn check_camera(camera: &CameraSpec) -> Result<(), RequestError> {
    let conflict = |key, given: &str, why: &str| Err(RequestError::new(RequestFault::Conflict, key, given, why));
    match (camera.eye, camera.target) {
        (Some(_), None) => conflict("camera.eye", "given", "`camera.target` is missing: give both or neither"),
        (None, Some(_)) => conflict("camera.target", "given", "`camera.eye` is missing: give both or neither"),
        (Some(eye), Some(target)) if eye == target => {
            conflict("camera.target", "the same point as `camera.eye`", "they must differ to say where to look")
        }
        (Some(_), _) if camera.from_file => {
            conflict("camera.from_file", "true", "`camera.eye` is given too: choose one of the two cameras")
        }
        _ => Ok(()),
    }
}

/// Faults in colours that stand out from each other and from any calm surface; edges of polygons recede.
fn default_topology() -> Topology {
    Topology {
        polygon: Some(Rgba::from_srgb8([0x33, 0x3a, 0x44, 0x99])),
        crease: None,
        open: Some(Rgba::from_srgb8([0xf0, 0x5a, 0x1e, 0xff])),
        nonmanifold: Some(Rgba::from_srgb8([0xd0, 0x1c, 0x9b, 0xff])),
        crease_angle_deg: 30.0,
        thickness: 1.0,
    }
}

const CAMERA: CameraSpec = CameraSpec {
    view: NamedView::Iso,
    azimuth_deg: None,
    elevation_deg: None,
    projection: ProjectionKind::Perspective,
    fov_deg: 35.0,
    height: None,
    up: None,
    margin: 0.05,
    eye: None,
    target: None,
    from_file: false,
};

const IMAGE: ImageSpec = ImageSpec { width_px: 512, height_px: 512, format: None, samples: 4, background: Rgba::WHITE };
