//! The request as a Rust value: a style and the keys of the request document.

use crate::Error;
use meshsnap_render::limits::Limits;
use meshsnap_render::request::{self, Rules};
use meshsnap_render::spec::{self, BackendChoice};

/// A request: a style, and the keys of the request document that override it.
///
/// Styles and keys are those of the HTTP interface and of `meshsnap render`.
///
/// ```
/// use meshsnap::Spec;
///
/// let spec = Spec::wire().size_px(256, 192)?.set("view", "front")?.set("wire.color", "#a00")?;
/// let error = spec.set("wire.thickness", "wide").unwrap_err();
/// assert!(error.to_string().contains("wire.thickness"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spec {
    document: Option<Vec<u8>>,
    overrides: Vec<(String, String)>,
}

macro_rules! styles {
    ($($(#[$doc:meta])* $function:ident = $word:literal,)*) => {
        /// Styles: where a spec begins.
        impl Spec {
            $($(#[$doc])* pub fn $function() -> Self {
                Self { document: None, overrides: vec![("style".to_owned(), $word.to_owned())] }
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

impl Spec {
    /// A spec from a request document in JSON.
    pub fn from_json(document: &str) -> Result<Self, Error> {
        Self { document: Some(document.as_bytes().to_vec()), overrides: Vec::new() }.checked()
    }

    /// The same with a key of the request document set: a dotted name such as `wire.color`, and its
    /// value as text. Later keys override earlier ones.
    pub fn set(&self, key: &str, value: &str) -> Result<Self, Error> {
        let mut spec = self.clone();
        spec.overrides.push((key.to_owned(), value.to_owned()));
        spec.checked()
    }

    /// The same with another picture size, pixels.
    pub fn size_px(&self, width_px: u32, height_px: u32) -> Result<Self, Error> {
        self.set("size", &format!("{width_px}x{height_px}"))
    }

    fn checked(self) -> Result<Self, Error> {
        self.understood()?;
        Ok(self)
    }

    /// The spec that the pipeline knows: defaults filled in, every value in range.
    pub(crate) fn understood(&self) -> Result<spec::Spec, Error> {
        let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
        Ok(request::read(self.document.as_deref(), &self.overrides, &rules)?)
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
            assert_eq!(style.overrides[0].1, *word);
            style.understood().unwrap();
        }
    }
}
