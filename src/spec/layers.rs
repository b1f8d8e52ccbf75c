//! The layers of a look: surface, wire, outline, topology.
//!
//! A layer that is `Some` is drawn. Units are in the names.

use super::color::Rgba;

/// What is drawn of a part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Layers {
    /// The filled surface, if any.
    pub surface: Option<Surface>,
    /// Lines along the mesh's edges, if any.
    pub wire: Option<Wire>,
    /// The line around the shape, if any.
    pub outline: Option<Outline>,
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

/// Where flat shading gets its normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlatNormals {
    /// The triangle's own corners, in f64.
    Face,
    /// Screen-space derivatives of the position in blocks of 2 x 2 pixels, as a GPU's `dFdx` gives them.
    Derivative,
}

/// What to show instead of the surface's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DebugView {
    /// The colour.
    None,
    /// The three barycentric coordinates as red, green, blue.
    Barycentric,
    /// The smallest barycentric coordinate as grey, white at 1/3.
    MinBarycentric,
    /// Distance to the triangle's nearest drawn edge as grey: black on it, white from 8 px on.
    EdgeDistance,
    /// The normal on the viewer's side, in the camera's axes, as `0.5 + 0.5 n`.
    Normal,
    /// A checker of texture coordinates, eight squares a unit, tinted by the coordinates.
    Uv,
    /// Front faces blue, back faces red, lit.
    FaceOrientation,
    /// Vertex colours, unlit; grey where there are none.
    VertexColor,
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
    /// Where [`Shading::Flat`] gets its normals.
    pub normals: FlatNormals,
    /// Overrides the file's own base colours and their textures; None keeps them (or a calm grey where there are none).
    pub color: Option<Rgba>,
    /// 0 to 1; None: the file's, or 0.
    pub metallic: Option<f32>,
    /// 0 to 1; None: the file's, or 0.6.
    pub roughness: Option<f32>,
    /// Light that the surface gives off; None: the file's.
    pub emissive: Option<Rgba>,
    /// Multiplies the file's own opacity, 0 to 1.
    pub opacity: f32,
    /// Whether the file's textures are shown.
    pub textures: bool,
    /// Shown instead of all this.
    pub debug: DebugView,
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
    /// `smoothstep(t d, (t + s) d, m)` with `m = min_i b_i` and `d = fwidth(m)`: shows artefacts near corners.
    FwidthMin,
    /// `smoothstep(0, 0.1 t, min_i b_i)`: as wide as its triangle is large.
    Barycentric,
    /// Coloured where any `b_i < 0.02 t`: no smoothing at all.
    Threshold,
}

/// Which edges a wire follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireEdges {
    /// Every triangle's edges.
    Triangles,
    /// Edges of the file's polygons: no triangulation diagonals.
    Polygons,
    /// Edges whose faces meet at more than `feature_angle_deg`, and those without exactly two faces.
    Feature,
    /// Edges with one face.
    Boundary,
}

/// What becomes of edges behind a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hidden {
    /// Not drawn.
    Hide,
    /// Drawn as if nothing lay in front.
    Show,
    /// Drawn faintly.
    Fade,
}

/// Lines along the mesh's edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wire {
    /// The technique.
    pub method: WireMethod,
    /// Line colour.
    pub color: Rgba,
    /// `exact`: full width, pixels, 0 to 100. Else t, in multiples of what the method measures in, 0 to 10.
    pub thickness: f32,
    /// `exact`: extra ramp, pixels. `fwidth` and `fwidth-min`: s, width of the smoothstep in multiples of `d`. 0 to 10.
    pub smoothing: f32,
    /// 0 to 1.
    pub opacity: f32,
    /// Whether the surface's light falls on the wire too.
    pub lit: bool,
    /// Which edges.
    pub edges: WireEdges,
    /// For [`WireEdges::Feature`]: the smallest angle between two faces' normals that makes an edge, 0 to 180.
    pub feature_angle_deg: f64,
    /// What becomes of hidden edges.
    pub hidden: Hidden,
}

/// Unit of an outline's thickness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineUnit {
    /// Model units, as they are at the depth of the silhouette.
    Object,
    /// Pixels, on screen.
    Px,
}

/// How an outline is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineMethod {
    /// What an inverted hull is for: a border around the surface, in one colour, that what lies before it hides.
    Hull,
    /// The true silhouette and boundary edges, as lines of exact width.
    Contour,
}

/// The line around the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// How it is made.
    pub method: OutlineMethod,
    /// Line colour.
    pub color: Rgba,
    /// In `unit`. None: 3 px; or in object units, 0.03 for a model whose longest side is 2, and in proportion for others.
    pub thickness: Option<f32>,
    /// Unit of `thickness`.
    pub unit: OutlineUnit,
}

/// Edges that say how the mesh hangs together, each kind in its own colour; None is not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Topology {
    /// Edges of polygons.
    pub polygon: Option<Rgba>,
    /// Edges whose faces meet at more than `crease_angle_deg`.
    pub crease: Option<Rgba>,
    /// Edges with one face.
    pub open: Option<Rgba>,
    /// Edges with more than two faces, or with two that disagree which side is out.
    pub nonmanifold: Option<Rgba>,
    /// See `crease`, 0 to 180.
    pub crease_angle_deg: f64,
    /// Full width of polygon edges, pixels; the others are drawn wider.
    pub thickness: f32,
}
