//! The request document, understood: presets applied, defaults filled in, every value in range.
//!
//! A layer that is `Some` is drawn. Units are in the names.

use super::color::Rgba;
pub use crate::image::ImageFormat;
pub use crate::limits::BackendChoice;
use crate::mesh::UpAxis;

/// Everything a request says.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// The filled surface, if any.
    pub surface: Option<Surface>,
    /// Lines along the mesh's edges, if any.
    pub wire: Option<Wire>,
    /// The line around the shape, if any.
    pub outline: Option<Outline>,
    /// Where from.
    pub camera: CameraSpec,
    /// Lit how.
    pub light: Light,
    /// Size, format, sampling, background.
    pub image: ImageSpec,
    /// Which back-end draws.
    pub backend: BackendChoice,
}

/// How a surface takes light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shading {
    /// One normal a triangle.
    Flat,
    /// Interpolated vertex normals.
    Smooth,
    /// The base colour, as it is.
    Unlit,
}

/// Which faces are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    /// Both sides.
    None,
    /// Front faces only.
    Back,
    /// Back faces only.
    Front,
}

/// The filled surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// How it takes light.
    pub shading: Shading,
    /// Overrides the file's own base colours; None keeps them (or a calm grey where there are none).
    pub color: Option<Rgba>,
    /// 0 to 1.
    pub metallic: f32,
    /// 0 to 1.
    pub roughness: f32,
    /// Which faces are drawn.
    pub cull: Cull,
}

/// How wires are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireMethod {
    /// Full width in pixels by exact box-filter coverage.
    Exact,
    /// `min_i smoothstep(t d_i, (t + s) d_i, b_i)` with `d = fwidth(b)`.
    Fwidth,
}

/// Which edges a wire follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireEdges {
    /// Every triangle's edges.
    Triangles,
    /// Edges of the file's polygons: no triangulation diagonals.
    Polygons,
}

/// What becomes of edges behind a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hidden {
    /// Not drawn.
    Hide,
    /// Drawn as if nothing lay in front.
    Show,
}

/// Lines along the mesh's edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wire {
    /// The technique.
    pub method: WireMethod,
    /// Line colour.
    pub color: Rgba,
    /// `exact`: full width, pixels. `fwidth`: threshold in multiples of `d`, 0 to 10.
    pub thickness: f32,
    /// `exact`: extra ramp, pixels. `fwidth`: width of the smoothstep in multiples of `d`, 0 to 10.
    pub smoothing: f32,
    /// 0 to 1.
    pub opacity: f32,
    /// Which edges.
    pub edges: WireEdges,
    /// What becomes of hidden edges.
    pub hidden: Hidden,
}

/// Unit of an outline's thickness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineUnit {
    /// Model units, along the normal.
    Object,
    /// Pixels, on screen.
    Px,
}

/// An inverted hull: the back faces, pushed out, in one colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Line colour.
    pub color: Rgba,
    /// In `unit`. None: 3 px; or in object units, 0.03 for a model whose longest side is 2, and in proportion for others.
    pub thickness: Option<f32>,
    /// Unit of `thickness`.
    pub unit: OutlineUnit,
}

/// Named directions to look from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From the front right, above: azimuth 45 degrees, elevation 30.
    Iso,
    /// Azimuth 0.
    Front,
    /// Azimuth 180.
    Back,
    /// Azimuth -90.
    Left,
    /// Azimuth 90.
    Right,
    /// From above.
    Top,
    /// From below.
    Bottom,
}

/// How depth becomes size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Farther is smaller.
    Perspective,
    /// It is not.
    Orthographic,
}

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSpec {
    /// A named direction; azimuth and elevation override its angles.
    pub view: View,
    /// Angle around the up axis, degrees; 0 is the front, 90 the right.
    pub azimuth_deg: Option<f64>,
    /// Angle above the horizon, degrees, -90 to 90.
    pub elevation_deg: Option<f64>,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Vertical field of view, degrees, 0.01 to 179.
    pub fov_deg: f64,
    /// Orthographic view height in file units; None fits.
    pub height: Option<f64>,
    /// Overrides the format's up axis.
    pub up: Option<UpAxis>,
    /// Free border as a fraction of the picture's size, each side, 0 to 0.45.
    pub margin: f64,
    /// Position in file space; given together with `target`, nothing is fitted.
    pub eye: Option<[f64; 3]>,
    /// The point in file space at the picture's centre.
    pub target: Option<[f64; 3]>,
}

/// Light: a headlight over an ambient term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Strength of the headlight, 0 to 10.
    pub intensity: f32,
    /// Share of light that comes from everywhere, 0 to 1.
    pub ambient: f32,
}

/// The picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSpec {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// None: whoever asks decides (extension, Accept, then PNG).
    pub format: Option<ImageFormat>,
    /// Visibility samples a pixel: 1 or 4.
    pub samples: u32,
    /// What is behind the mesh; alpha 0 is transparent.
    pub background: Rgba,
}
