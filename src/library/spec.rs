//! The request (what a picture shows, and how it looks) as a Rust value: a style, typed setters, and the keys of the
//! request document.

use std::sync::{Arc, OnceLock};

use meshsnap_render::limits::Limits;
use meshsnap_render::mesh::UpAxis;
use meshsnap_render::request::{self, Rules, word_for};
use meshsnap_render::spec::{self, BackendChoice, Hidden, NamedView, ProjectionKind, Samples, WireEdges};

use crate::Error;

/// A request: a style, and what overrides it.
///
/// Each setter gives the spec back, so that they can be written in a row. Later ones override earlier ones. A value that is
/// out of range is an error of the first picture, or of [`Spec::check`].
///
/// ```
/// use meshsnap::{Spec, View};
///
/// let spec = Spec::wire().size(800, 600).view(View::Iso).line_width(1.5).line_color("#a00");
/// spec.check(&Default::default())?;
/// # Ok::<(), meshsnap::Error>(())
/// ```
///
/// Everything else is a key of the request document, the same as over HTTP and on the command line
/// (docs/request.md lists them):
///
/// ```
/// use meshsnap::Spec;
///
/// let spec = Spec::outline().set("outline.thickness", "3").set("outline.unit", "px");
/// let error = spec.set("outline.thickness", "wide").check(&Default::default()).unwrap_err();
/// assert!(error.to_string().contains("outline.thickness"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Spec {
    document: Option<Arc<[u8]>>,
    /// Dotted keys and their values, as text.
    keys: Vec<(String, String)>,
    /// The request as it is read under the default limits. It is read once, by whatever needs it first.
    read: Arc<OnceLock<spec::Spec>>,
}

macro_rules! styles {
    ($($(#[$doc:meta])* $function:ident = $word:literal,)*) => {
        /// Styles: where a spec begins.
        impl Spec {
            $($(#[$doc])* pub fn $function() -> Self {
                Self::default().set("style", $word)
            })*
        }

        #[cfg(test)]
        fn all() -> Vec<Spec> {
            vec![$(Spec::$function()),*]
        }
    };
}

styles! {
    /// The mesh as it is meant to look: smooth by its own normals, or with creases where it has none.
    auto = "auto",
    /// One normal per face.
    flat = "flat",
    /// Normals blended between vertices.
    smooth = "smooth",
    /// Base colours without light.
    unlit = "unlit",
    /// Flat surface, and lines of exact width on the edges of its polygons.
    wire = "wire",
    /// Lines alone, those on the back too.
    wireframe = "wireframe",
    /// Smooth surface, and an outline around it.
    outline = "outline",
    /// White surface and lines: a drawing.
    hidden_line = "hidden-line",
    /// Flat surface, and polygon edges, open edges and non-manifold edges in a colour each.
    topology = "topology",
    /// Smooth surface, feature edges and a contour, as in a technical drawing.
    technical = "technical",
    /// The bare form: one matt colour for all materials, and strong occlusion.
    clay = "clay",
    /// Translucent surface in one colour, opaque where it turns away from the viewer.
    xray = "xray",
}

/// The picture.
impl Spec {
    /// Width and height, pixels.
    #[must_use]
    pub fn size(self, width_px: u32, height_px: u32) -> Self {
        self.set("size", format!("{width_px}x{height_px}"))
    }

    /// Samples per pixel. By default 4, or 16 in pictures of at most 65,536 pixels without wires.
    #[must_use]
    pub fn samples(self, samples: Samples) -> Self {
        self.set("samples", samples.to_string())
    }

    /// The background: a CSS colour such as `#fff`, two of them (`#fff..#dde`) for a gradient, or `transparent`.
    #[must_use]
    pub fn background(self, color: impl Into<String>) -> Self {
        self.set("background", color)
    }

    /// A background through which the page behind the picture is seen.
    #[must_use]
    pub fn transparent(self) -> Self {
        self.background("transparent")
    }
}

/// The camera.
impl Spec {
    /// A named direction to look from.
    #[must_use]
    pub fn view(self, view: NamedView) -> Self {
        let spec = self.set("camera.azimuth_deg", "null").set("camera.elevation_deg", "null");
        spec.set("view", word_for(view))
    }

    /// Another direction: degrees around the model, from its front to its right, and degrees above the ground.
    #[must_use]
    pub fn direction(self, azimuth_deg: f64, elevation_deg: f64) -> Self {
        let azimuth = self.set("camera.azimuth_deg", azimuth_deg.to_string());
        azimuth.set("camera.elevation_deg", elevation_deg.to_string())
    }

    /// The axis that is up, where the file is wrong about it.
    #[must_use]
    pub fn up(self, axis: UpAxis) -> Self {
        self.set("up", word_for(axis))
    }

    /// A view in which distant objects are not smaller.
    #[must_use]
    pub fn orthographic(self) -> Self {
        self.set("camera.projection", word_for(ProjectionKind::Orthographic))
    }

    /// The free border around the mesh, a share of the picture.
    #[must_use]
    pub fn margin(self, share: f64) -> Self {
        self.set("camera.margin", share.to_string())
    }
}

/// Surface and lines. A setter of lines turns lines on, where the style has none.
impl Spec {
    /// The colour of surfaces that have none of their own: a CSS colour.
    #[must_use]
    pub fn surface_color(self, color: impl Into<String>) -> Self {
        self.set("surface.color", color)
    }

    /// The opacity of surfaces, 0 to 1.
    #[must_use]
    pub fn opacity(self, opacity: f32) -> Self {
        self.set("surface.opacity", opacity.to_string())
    }

    /// The full width of lines, pixels; of the classic wire methods, the thickness in their own unit.
    #[must_use]
    pub fn line_width(self, width_px: f32) -> Self {
        self.set("wire.thickness", width_px.to_string())
    }

    /// The colour of lines: a CSS colour.
    #[must_use]
    pub fn line_color(self, color: impl Into<String>) -> Self {
        self.set("wire.color", color)
    }

    /// The edges that lines follow.
    #[must_use]
    pub fn edges(self, edges: WireEdges) -> Self {
        self.set("wire.edges", word_for(edges))
    }

    /// The treatment of lines behind a surface.
    #[must_use]
    pub fn hidden_lines(self, hidden: Hidden) -> Self {
        self.set("wire.hidden", word_for(hidden))
    }
}

/// The request document.
impl Spec {
    /// A spec from a request document in JSON.
    pub fn from_json(document: &str) -> Self {
        Self { document: Some(document.as_bytes().into()), ..Self::default() }
    }

    /// Sets a key of the request document: a dotted name such as `wire.color`, and its value as text.
    #[must_use]
    pub fn set(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.keys.push((key.into(), value.into()));
        self.read = Arc::default();
        self
    }

    /// Refuses unknown keys and values that are out of range under these limits. Drawing does so, too, under the limits of
    /// its renderer.
    pub fn check(&self, limits: &Limits) -> Result<(), Error> {
        self.understood(limits).map(|_| ())
    }

    /// The spec that the pipeline knows: defaults filled in, every value in range.
    pub(crate) fn understood(&self, limits: &Limits) -> Result<spec::Spec, Error> {
        let defaults = Limits::default();
        let are_defaults = (limits.image_px, limits.json_depth) == (defaults.image_px, defaults.json_depth);
        if let Some(read) = self.read.get().filter(|_| are_defaults) {
            return Ok(read.clone());
        }
        let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
        let read = request::read(self.document.as_deref(), &self.keys, &rules)?;
        if are_defaults {
            let _ = self.read.set(read.clone());
        }
        Ok(read)
    }
}

impl PartialEq for Spec {
    fn eq(&self, other: &Self) -> bool {
        (&self.document, &self.keys) == (&other.document, &other.keys)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_style_has_a_function_that_is_understood() {
        let words = request::words_of::<request::Style>();
        let styles = all();
        assert_eq!(styles.len(), words.len());
        for (style, word) in styles.iter().zip(words) {
            assert_eq!(style.keys[0].1, *word);
            style.check(&Limits::default()).unwrap();
        }
    }

    #[test]
    fn setters_say_what_their_keys_say() {
        let typed = Spec::wire()
            .size(80, 60)
            .samples(Samples::Adaptive)
            .background("#fff..#dde")
            .view(NamedView::Top)
            .direction(12.5, -7.0)
            .up(UpAxis::NegZ)
            .orthographic()
            .margin(0.125)
            .surface_color("#123")
            .opacity(0.5)
            .line_width(1.1)
            .line_color("#a00")
            .edges(WireEdges::Feature)
            .hidden_lines(Hidden::Fade);
        let document = r##"{
            "style": "wire", "surface": { "color": "#123", "opacity": 0.5 },
            "image": { "width": 80, "height": 60, "samples": "adaptive", "background": "#fff..#dde" },
            "camera": { "view": "top", "azimuth_deg": 12.5, "elevation_deg": -7, "up": "-z",
                        "projection": "orthographic", "margin": 0.125 },
            "wire": { "thickness": 1.1, "color": "#a00", "edges": "feature", "hidden": "fade" }
        }"##;
        let limits = Limits::default();
        assert_eq!(typed.understood(&limits).unwrap(), Spec::from_json(document).understood(&limits).unwrap());
        let turned = Spec::flat().direction(10.0, 10.0).view(NamedView::Top).understood(&limits).unwrap();
        assert_eq!(turned, Spec::flat().view(NamedView::Top).understood(&limits).unwrap(), "the last one counts");
        let clear = Spec::auto().transparent().understood(&limits).unwrap();
        assert_eq!(clear, Spec::auto().set("background", "transparent").understood(&limits).unwrap());
    }

    #[test]
    fn a_spec_is_read_once_and_again_after_a_change() {
        let spec = Spec::flat().size(8, 8);
        assert!(spec.read.get().is_none());
        spec.check(&Limits::default()).unwrap();
        assert!(spec.read.get().is_some());
        let larger = spec.clone().size(16, 16);
        assert_eq!(larger.understood(&Limits::default()).unwrap().image.width_px, 16);
        assert_eq!(spec.understood(&Limits::default()).unwrap().image.width_px, 8);
    }

    #[test]
    fn limits_count_when_the_spec_is_understood() {
        let mut limits = Limits::default();
        limits.image_px = 64;
        limits.json_depth = 2;
        let spec = Spec::flat().size(128, 128);
        spec.check(&Limits::default()).unwrap();
        assert!(spec.check(&limits).unwrap_err().to_string().contains("64"));
        let deep = Spec::from_json(r#"{ "camera": { "eye": [1, 2, 3], "target": [0, 0, 0] } }"#);
        deep.check(&Limits::default()).unwrap();
        deep.check(&limits).unwrap_err();
    }
}
