//! The layers of a picture, as a request describes them: the filled surface, the wire (lines along the
//! mesh's edges), the outline, and the topology (edges coloured by how faces are connected). A layer that
//! is `Some` is drawn. The size of points is here, too.

use super::color::Rgba;
use super::wire_method::WireMethod;
use super::words::word_enums;

/// The layers of one material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Layers {
    /// The filled surface, if any.
    pub surface: Option<Surface>,
    /// Lines along the mesh's edges, if any.
    pub wire: Option<Wire>,
    /// The line around the shape, if any.
    pub outline: Option<Outline>,
}

word_enums! {
    /// The lighting of a surface.
    pub enum Shading {
        /// One normal per triangle.
        Flat = "flat",
        /// Interpolated vertex normals.
        Smooth = "smooth",
        /// The base colour without any light.
        Unlit = "unlit",
    }

    /// Source of the normals of flat shading.
    pub enum FlatNormals {
        /// The corners of the triangle, in f64.
        Face = "face",
        /// Screen-space derivatives of the position in blocks of 2 x 2 pixels, as a GPU's `dFdx`
        /// gives them.
        Derivative = "derivative",
    }

    /// Data of the mesh, shown instead of the surface's colour.
    pub enum DebugView {
        /// No data: the colour.
        None = "none",
        /// The three barycentric coordinates as red, green, blue.
        Barycentric = "barycentric",
        /// The smallest barycentric coordinate as grey, white at 1/3.
        MinBarycentric = "min-barycentric",
        /// Distance to the triangle's nearest drawn edge as grey: black on it, white from 8 px on.
        EdgeDistance = "edge-distance",
        /// The normal on the viewer's side, in the camera's axes, as `0.5 + 0.5 n`.
        Normal = "normal",
        /// A checker of texture coordinates, eight squares per unit, tinted by the coordinates.
        Uv = "uv",
        /// Front faces blue, back faces red, lit.
        FaceOrientation = "face-orientation",
        /// Vertex colours, unlit; grey where there are none.
        VertexColor = "vertex-color",
        /// Shapes of triangles: dark where they are equilateral, yellow where they are slivers.
        Aspect = "aspect",
        /// Mean length of each triangle's edges: dark is short, yellow long.
        EdgeLength = "edge-length",
        /// Mean curvature: red bends outwards, blue inwards.
        Curvature = "curvature",
        /// Size of the texture on each triangle beside its average: red is stretched, blue is dense.
        UvStretch = "uv-stretch",
        /// The faces as they lie in the texture; turned over ones are orange, overlapping ones red.
        UvLayout = "uv-layout",
    }

    /// Faces that are left out.
    pub enum Cull {
        /// None: both sides are drawn.
        None = "none",
        /// Back faces.
        Back = "back",
        /// Front faces.
        Front = "front",
    }
}

/// The filled surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Its lighting.
    pub shading: Shading,
    /// Source of the normals of [`Shading::Flat`].
    pub normals: FlatNormals,
    /// An edge is a crease, where [`Shading::Smooth`] ends, if its faces' normals differ by more than this:
    /// degrees, 0 to 180. 180: no creases. For meshes that bring no vertex normals.
    pub crease_angle_deg: f64,
    /// Overrides the file's own base colours and their textures; None keeps them (grey where there
    /// are none).
    pub color: Option<Rgba>,
    /// Metallic share, 0 to 1; None: the file's, or 0.
    pub metallic: Option<f32>,
    /// Roughness, 0 to 1; None: the file's, or 0.6.
    pub roughness: Option<f32>,
    /// Light that the surface gives off; None: the file's.
    pub emissive: Option<Rgba>,
    /// Multiplies the file's own opacity, 0 to 1.
    pub opacity: f32,
    /// The share of that opacity where the surface faces the viewer, 0 to 1; at grazing angles it has
    /// all of it.
    pub facing_opacity: f32,
    /// Shows the file's textures.
    pub textures: bool,
    /// Shown instead of the shaded colour.
    pub debug: DebugView,
    /// Faces that are left out.
    pub cull: Cull,
}

impl Default for Surface {
    fn default() -> Self {
        Self {
            shading: Shading::Flat,
            normals: FlatNormals::Face,
            crease_angle_deg: 30.0,
            color: None,
            metallic: None,
            roughness: None,
            emissive: None,
            opacity: 1.0,
            facing_opacity: 1.0,
            textures: true,
            debug: DebugView::None,
            cull: Cull::None,
        }
    }
}

word_enums! {
    /// Edges that a wire follows.
    #[non_exhaustive]
    pub enum WireEdges {
        /// Every triangle's edges.
        Triangles = "triangles",
        /// Edges of the file's polygons: no triangulation diagonals.
        Polygons = "polygons",
        /// Edges whose faces meet at more than `feature_angle_deg`, and those without exactly two
        /// faces.
        Feature = "feature",
        /// Edges with one face.
        Boundary = "boundary",
    }

    /// The treatment of edges behind a surface.
    #[non_exhaustive]
    pub enum Hidden {
        /// Not drawn.
        Hide = "hide",
        /// Drawn as if nothing were in front of them.
        Show = "show",
        /// Drawn faintly.
        Fade = "fade",
    }
}

/// Lines along the mesh's edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wire {
    /// The method of drawing it.
    pub method: WireMethod,
    /// Line colour.
    pub color: Rgba,
    /// How thick the lines are.
    pub thickness: WireThickness,
    /// `exact`: extra ramp, pixels. `fwidth` and `fwidth-min`: s, width of the smoothstep in
    /// multiples of `d`. 0 to 10.
    pub smoothing: f32,
    /// Multiplies the colour's own opacity, 0 to 1.
    pub opacity: f32,
    /// Lights the wire like the surface.
    pub lit: bool,
    /// Edges that it follows.
    pub edges: WireEdges,
    /// For [`WireEdges::Feature`]: the smallest angle between two faces' normals that makes an
    /// edge, 0 to 180.
    pub feature_angle_deg: f64,
    /// For [`WireEdges::Feature`]: edges that are joined at vertices and shorter in all on screen are not
    /// drawn, pixels.
    pub min_length: f32,
    /// The treatment of hidden edges.
    pub hidden: Hidden,
}

/// The thickness of a wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireThickness {
    /// `exact`: 1 pixel where that leaves most of the surface free, and thinner or fainter where edges lie
    /// close on screen. Other methods: 1.
    Auto,
    /// `exact`: full width, pixels, 0 to 100. Other methods: t, in the method's unit, 0 to 10.
    Given(f32),
}

impl WireThickness {
    /// The number that is given, or 1: the most that [`Auto`](Self::Auto) stands for.
    pub fn largest(self) -> f32 {
        match self {
            Self::Auto => 1.0,
            Self::Given(thickness) => thickness,
        }
    }
}

impl Default for Wire {
    fn default() -> Self {
        Self {
            method: WireMethod::Exact,
            color: Rgba::BLACK,
            thickness: WireThickness::Auto,
            smoothing: 0.0,
            opacity: 1.0,
            lit: false,
            edges: WireEdges::Polygons,
            feature_angle_deg: 30.0,
            min_length: 0.0,
            hidden: Hidden::Hide,
        }
    }
}

word_enums! {
    /// Unit of an outline's thickness.
    pub enum OutlineUnit {
        /// Model units, measured at the depth of the silhouette.
        Object = "object",
        /// Pixels on screen.
        Px = "px",
    }

    /// The shape of an outline.
    pub enum OutlineMethod {
        /// A border in one colour around the surface, as an inverted hull gives it. Nearer surfaces
        /// hide it.
        Hull = "hull",
        /// Silhouette and boundary edges, as lines of exact width.
        Contour = "contour",
    }
}

/// The line around the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Its shape.
    pub method: OutlineMethod,
    /// Line colour.
    pub color: Rgba,
    /// In `unit`. None: 3 px, or in object units 3/200 of the model's longest side.
    pub thickness: Option<f32>,
    /// Unit of `thickness`.
    pub unit: OutlineUnit,
    /// Chains of silhouette edges that are shorter on screen are not drawn, unless they border the
    /// background: pixels, 0 to 10000. None: in proportion to the outline's width.
    pub min_length: Option<f32>,
}

impl Default for Outline {
    fn default() -> Self {
        Self {
            method: OutlineMethod::Hull,
            color: Rgba::BLACK,
            thickness: None,
            unit: OutlineUnit::Object,
            min_length: None,
        }
    }
}

/// Point primitives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    /// Diameter with a surface, pixels, 0.5 to 64. Without one, points are wider than the wire's lines in
    /// the proportion of this to 1.5.
    pub size_px: f32,
}

impl Default for Points {
    fn default() -> Self {
        Self { size_px: 3.0 }
    }
}

/// Edges coloured by how the mesh is connected. Kinds whose colour is None are not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Topology {
    /// Edges of polygons.
    pub polygon: Option<Rgba>,
    /// Edges whose faces meet at more than `crease_angle_deg`.
    pub crease: Option<Rgba>,
    /// Edges with one face.
    pub open: Option<Rgba>,
    /// Edges with more than two faces, or with two faces that disagree which side is out.
    pub nonmanifold: Option<Rgba>,
    /// The smallest angle of a crease, 0 to 180.
    pub crease_angle_deg: f64,
    /// Full width of polygon edges, pixels; the others are drawn wider.
    pub thickness: f32,
}

impl Default for Topology {
    /// Faults stand out from each other and from a plain surface; edges of polygons recede.
    fn default() -> Self {
        Self {
            polygon: Some(Rgba::from_srgb8([0x33, 0x3a, 0x44, 0x99])),
            crease: None,
            open: Some(Rgba::from_srgb8([0xf0, 0x5a, 0x1e, 0xff])),
            nonmanifold: Some(Rgba::from_srgb8([0xd0, 0x1c, 0x9b, 0xff])),
            crease_angle_deg: 30.0,
            thickness: 1.0,
        }
    }
}
