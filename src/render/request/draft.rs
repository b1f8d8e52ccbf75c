//! The draft of a [`Spec`], which collects what a request says. It begins with the defaults and the
//! layers of the style, and each key that is read changes it. At the end, when every key is known,
//! defaults that depend on other keys are settled, and keys that contradict each other are refused.

use super::error::{RequestError, RequestFault};
use crate::request::Rules;
use crate::request::layers_draft::{LayersDraft, WireDraft};
use crate::request::sheet_draft::SheetDraft;
use crate::request::style::Style;
use crate::request::table::dependent::Dependent;
use crate::spec::words::{Words, word_for};
use crate::spec::{
    BackendChoice, CameraSpec, DebugView, Ground, ImageSpec, Layers, Light, LightPreset, Open, Outline, OutlineMethod,
    Points, QualityTarget, Samples, Spec, Surface, Topology, Wire, WireMethod,
};

/// Most different styles of exact wires and contours in one picture.
const LINE_STYLES_MAX: usize = 64;

/// A spec whose dependent defaults are still open. A material's document is also read into a draft;
/// only its layers are used.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The document's own layers; each of its materials begins from them.
    pub layers: LayersDraft,
    /// The topology layer, if it is on.
    pub topology: Option<Topology>,
    /// See [`Spec::points`].
    pub points: Points,
    /// See [`Spec::time_s`].
    pub time_s: Option<f64>,
    /// See [`Spec::ground`].
    pub ground: Ground,
    /// See [`Spec::camera`].
    pub camera: CameraSpec,
    /// The sheet, if it is on.
    pub sheet: Option<SheetDraft>,
    /// See [`Spec::light`].
    pub light: Light,
    /// By default the style's where there are lamps, 1 where there are none.
    pub ambient: Dependent<f32>,
    /// See [`Spec::image`].
    pub image: ImageSpec,
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// By default those of [`Samples::default_of`], unless a quality target chooses.
    pub samples: Dependent<Samples>,
    /// By default the server's, unless a quality target chooses.
    pub backend: Dependent<BackendChoice>,
    /// See [`QualityTarget::max_error`].
    pub max_error: Option<f64>,
    /// See [`QualityTarget::max_time_ms`].
    pub max_time_ms: Option<f64>,
}

impl Draft {
    /// The defaults and a style's layers, for pictures of at most so many pixels on a side.
    pub fn new(style: Style, side_px_max: u64) -> Self {
        let image = ImageSpec::default();
        let side_px_max = u32::try_from(side_px_max).unwrap_or(u32::MAX);
        Self {
            layers: LayersDraft::new(style),
            topology: (style == Style::Topology).then(Topology::default),
            points: Points::default(),
            time_s: None,
            ground: Ground::None,
            camera: CameraSpec::default(),
            sheet: None,
            light: Light { ambient: style.ambient(), ambient_occlusion: style.ambient_occlusion(), ..Light::default() },
            ambient: Dependent::default(),
            image,
            // The default size must not be larger than what a request may ask for.
            size_px: [image.width_px, image.height_px].map(|side| side.min(side_px_max)),
            samples: Dependent::default(),
            backend: Dependent::default(),
            max_error: None,
            max_time_ms: None,
        }
    }

    /// The surface layer, which any of its keys turns on.
    pub fn surface(&mut self) -> &mut Surface {
        self.layers.surface.get_or_insert_default()
    }

    /// The wire layer's dependent values; any of its keys turns it on.
    pub fn wire_draft(&mut self) -> &mut WireDraft {
        self.layers.wire.get_or_insert_default()
    }

    /// The wire layer's other values.
    pub fn wire(&mut self) -> &mut Wire {
        &mut self.wire_draft().line
    }

    /// The outline layer, which any of its keys turns on.
    pub fn outline(&mut self) -> &mut Outline {
        self.layers.outline.get_or_insert_default()
    }

    /// The topology layer, which any of its keys turns on.
    pub fn topology(&mut self) -> &mut Topology {
        self.topology.get_or_insert_default()
    }

    /// The sheet, which any of its keys turns on.
    pub fn sheet(&mut self) -> &mut SheetDraft {
        self.sheet.get_or_insert_default()
    }

    /// Settles what depends on several keys. Each material has a name. The rules have the server's
    /// default back-end, and the largest picture.
    pub fn finish(self, materials: Vec<(String, LayersDraft)>, rules: &Rules) -> Result<Spec, RequestError> {
        let (backend, px_max) = (rules.backend, rules.limits.image_px);
        let quality_target = self.quality_target(&materials, backend);
        let layers = self.layers.finish("")?;
        let materials = materials.into_iter().map(|(name, layers)| {
            let layers = layers.finish(&format!("materials.{name}."))?;
            Ok((name, layers))
        });
        let materials = materials.collect::<Result<Vec<_>, _>>()?;
        check_layers(&layers, &materials)?;
        check_uv_layout(&layers, &materials)?;
        check_camera(&self.camera)?;
        let has_lamps = self.light.preset != LightPreset::None;
        let light = Light { ambient: self.ambient.or(if has_lamps { self.light.ambient } else { 1.0 }), ..self.light };
        let [width_px, height_px] = self.size_px;
        let has_wires = layers.wire.is_some() || materials.iter().any(|(_, layers)| layers.wire.is_some());
        let samples = self.samples.or(Samples::default_of(self.size_px, has_wires));
        let image = ImageSpec { width_px, height_px, samples, ..self.image };
        let sheet = self.sheet.as_ref().map(|sheet| sheet.finish(&self.camera, &image, px_max)).transpose()?;
        let Self { topology, points, time_s, ground, camera, .. } = self;
        let backend = self.backend.or(backend);
        Ok(Spec {
            layers,
            materials,
            topology,
            points,
            time_s,
            ground,
            camera,
            sheet,
            light,
            image,
            backend,
            quality_target,
        })
    }

    fn quality_target(&self, materials: &[(String, LayersDraft)], backend: BackendChoice) -> Option<QualityTarget> {
        let &Self { max_error, max_time_ms, .. } = self;
        let open = Open {
            samples: !self.samples.is_given(),
            // A server whose default is not `auto` has a reason for it.
            backend: !self.backend.is_given() && backend == BackendChoice::Auto,
            wire: self.layers.has_open_wire(),
            material_wires: materials.iter().map(|(_, layers)| layers.has_open_wire()).collect(),
        };
        (max_error.is_some() || max_time_ms.is_some()).then_some(QualityTarget { max_error, max_time_ms, open })
    }
}

/// Checks what all materials of a picture have in common.
fn check_layers(layers: &Layers, materials: &[(String, Layers)]) -> Result<(), RequestError> {
    let unit = |layers: &Layers| layers.outline.filter(|o| o.method == OutlineMethod::Hull).map(|o| o.unit);
    check_shared(layers, materials, "outline.unit", unit, "all hulls of one picture have the same unit")?;
    let hidden = |layers: &Layers| layers.wire.filter(|w| w.method != WireMethod::Exact).map(|w| w.hidden);
    check_shared(layers, materials, "wire.hidden", hidden, "all wires by barycentrics do the same in one picture")?;

    // Each different line is a pass over the picture.
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

/// Fails if some materials show the layout of texture coordinates, and others lie in space.
fn check_uv_layout(layers: &Layers, materials: &[(String, Layers)]) -> Result<(), RequestError> {
    let is_flat = |layers: &Layers| layers.surface.is_some_and(|surface| surface.debug == DebugView::UvLayout);
    match materials.iter().find(|(_, of_material)| is_flat(of_material) && !is_flat(layers)) {
        Some((name, _)) => {
            let why = "it shows the whole mesh: give it as `surface.debug`";
            let key = format!("materials.{name}.surface.debug");
            Err(RequestError::new(RequestFault::Conflict, &key, word_for(DebugView::UvLayout), why))
        }
        None => Ok(()),
    }
}

/// Fails if two materials have different values of this key.
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
