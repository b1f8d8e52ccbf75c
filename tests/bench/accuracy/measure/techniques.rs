//! The techniques that are compared, and the requests that ask each of them for the same picture.
//!
//! Lines are w pixels wide in truth. The approximating wire methods have no such number; each gets
//! the parameters with which it is w wide where its own measure is right. t is `wire.thickness`, s
//! is `wire.smoothing`, and b is the barycentric coordinate that is 0 on the edge:
//! - `fwidth`, `fwidth-min`: a wire is full up to t and gone at t + s, in multiples of |db/dx| +
//!   |db/dy|, which is a pixel for an edge along the axes; both triangles of an edge draw it, so it
//!   is 2t + s wide (half of each ramp counted). s = min(w, 1), t = (w - s) / 2. On diagonals that
//!   is 1.41 w, a property of the method.
//! - `barycentric`: half gone at b = 0.05 t, so that with h the height of a triangle on screen it
//!   is 0.1 t h wide.
//! - `threshold`: gone at b = 0.02 t, so 0.04 t h wide. For both h is the scene's median, and t at
//!   most 10.
//! - `hull`: a strip of w pixels beyond the silhouette; `contour`: w pixels, half of them inside.

use std::sync::LazyLock;

use meshsnap_render::spec::{Samples, ThicknessUnit, WIRE_METHODS, WireMethod};

use super::scenes::Scene;
use super::{SAMPLES, WHOLE_SAMPLES};

/// Scenes whose techniques can be compared with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// Lines along edges, hidden by a surface that is not seen. Error: of coverage.
    Wires,
    /// Lines around shapes. Error: of coverage.
    Outlines,
    /// Lit flat faces. Error: of colour, where a pixel shows one face alone.
    Faces,
    /// The same, of all pixels, so that anti-aliasing counts.
    Pictures,
    /// Pictures as users ask for them. Error: of colour, in all pixels.
    Whole,
    /// The same of textured faces without light.
    WholeTextures,
    /// Textured faces without light. Error: of colour, where a pixel shows one face alone.
    Textures,
}

/// A way to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Technique {
    Wire(WireMethod),
    Contour,
    Hull,
    FaceNormals,
    DerivativeNormals,
    Texture,
    /// Textures by one trilinear lookup per pixel. No request asks for it.
    Trilinear,
    /// Faces lit by their own normals.
    LitFaces,
    /// Faces lit by normals between corners.
    SmoothFaces,
    /// Lit faces under exact wires.
    WiredFaces,
    /// Lit faces under a contour.
    OutlinedFaces,
    /// Texture and background.
    TexturedFaces,
}

use Technique::{
    Contour, DerivativeNormals, FaceNormals, Hull, LitFaces, OutlinedFaces, SmoothFaces, Texture, TexturedFaces,
    Trilinear, Wire, WiredFaces,
};

/// Whole pictures, but for how normals are found.
const LIT: &[(&str, &str)] = &[
    ("light.preset", "three-point"),
    ("light.ambient_occlusion", "0"),
    ("surface.metallic", "0"),
    ("surface.color", "c08040"),
    ("background", "fff"),
];

static WIRES: LazyLock<Vec<Technique>> = LazyLock::new(|| WIRE_METHODS.iter().map(|row| Wire(row.method)).collect());

impl Family {
    pub fn techniques(self) -> &'static [Technique] {
        match self {
            Self::Wires => &WIRES,
            Self::Outlines => &[Contour, Hull],
            Self::Faces | Self::Pictures => &[FaceNormals, DerivativeNormals],
            Self::Textures => &[Texture, Trilinear],
            Self::Whole => &[LitFaces, SmoothFaces, WiredFaces, OutlinedFaces],
            Self::WholeTextures => &[TexturedFaces],
        }
    }

    /// The samples that are compared.
    pub fn samples(self) -> &'static [Samples] {
        match self {
            Self::Whole | Self::WholeTextures => WHOLE_SAMPLES,
            _ => SAMPLES,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Wires => "wires",
            Self::Outlines => "outlines",
            Self::Faces => "faces",
            Self::Pictures => "pictures",
            Self::Textures => "textures",
            Self::Whole => "whole pictures",
            Self::WholeTextures => "whole textured pictures",
        }
    }
}

impl Technique {
    /// Its name in docs/accuracy.json: that of the request, where it has one.
    pub fn name(self) -> &'static str {
        match self {
            Wire(method) => method.info().name,
            Contour => "contour",
            Hull => "hull",
            FaceNormals => "face",
            DerivativeNormals => "derivative",
            Texture => "texture",
            Trilinear => "trilinear",
            LitFaces => "lit faces",
            SmoothFaces => "smooth faces",
            WiredFaces => "wires over faces",
            OutlinedFaces => "contour over faces",
            TexturedFaces => "textured faces",
        }
    }

    /// The thickness to ask for; `height_px` is the median height of the scene's triangles on
    /// screen.
    pub fn thickness(self, width_px: f64, height_px: f64) -> f64 {
        let unit = if let Wire(method) = self { method.info().unit } else { ThicknessUnit::Pixels };
        match (self, unit) {
            (FaceNormals | DerivativeNormals | Texture | Trilinear | LitFaces | SmoothFaces | TexturedFaces, _) => 0.0,
            (_, ThicknessUnit::Pixels) => width_px,
            (_, ThicknessUnit::Derivatives) => 0.5 * (width_px - width_px.min(1.0)),
            // Both triangles of an edge draw the wire.
            (_, ThicknessUnit::TriangleHeight(share)) => (width_px / height_px / (2.0 * share)).min(10.0),
        }
    }

    /// A request's keys. Lines are opaque white on nothing, so that alpha is coverage. A hull needs
    /// a surface before it, so it is white on a black one.
    pub fn keys(self, scene: &Scene, samples: Samples, thickness: f64) -> Vec<(&'static str, String)> {
        let mut keys: Vec<(&str, &str)> = match self {
            Wire(_) => vec![
                ("style", "wireframe"),
                ("wire.method", self.name()),
                ("wire.hidden", "hide"),
                ("wire.color", "fff"),
                ("background", "transparent"),
            ],
            Contour => vec![("style", "unlit"), ("surface", "null"), ("background", "transparent")],
            Hull => vec![("style", "unlit"), ("surface.color", "000"), ("background", "000")],
            FaceNormals | DerivativeNormals => vec![
                ("style", "flat"),
                ("surface.normals", self.name()),
                ("light.preset", "three-point"),
                ("surface.metallic", "0"),
                ("surface.color", "c08040"),
                ("background", "fff"),
            ],
            Texture | Trilinear | TexturedFaces => vec![("style", "unlit"), ("background", "fff")],
            LitFaces | WiredFaces | OutlinedFaces => [&[("style", "flat")], LIT].concat(),
            SmoothFaces => [&[("style", "smooth")], LIT].concat(),
        };
        match self {
            WiredFaces => keys.extend([
                ("wire.method", "exact"),
                ("wire.hidden", "hide"),
                ("wire.edges", "triangles"),
                ("wire.color", "001133"),
            ]),
            OutlinedFaces => keys.extend([
                ("outline.method", "contour"),
                ("outline.unit", "px"),
                ("outline.color", "001133"),
                ("outline.min_length", "0"),
            ]),
            _ => {}
        }
        if matches!(self, Contour | Hull) {
            keys.extend([("outline.method", self.name()), ("outline.unit", "px"), ("outline.color", "fff")]);
            // The truth has the short chains, too.
            keys.push(("outline.min_length", "0"));
        }
        let mut keys: Vec<(&str, String)> = keys.into_iter().map(|(k, v)| (k, v.to_owned())).collect();
        match self {
            Wire(method) => {
                if scene.keys.iter().all(|(key, _)| *key != "wire.edges") {
                    keys.push(("wire.edges", "triangles".to_owned()));
                }
                keys.push(("wire.thickness", thickness.to_string()));
                if method.info().unit == ThicknessUnit::Derivatives {
                    keys.push(("wire.smoothing", scene.width_px.min(1.0).to_string()));
                }
            }
            Contour | Hull | OutlinedFaces => keys.push(("outline.thickness", thickness.to_string())),
            WiredFaces => keys.push(("wire.thickness", thickness.to_string())),
            FaceNormals | DerivativeNormals | Texture | Trilinear | LitFaces | SmoothFaces | TexturedFaces => {}
        }
        keys.push(("samples", samples.to_string()));
        keys
    }
}
