//! What to draw, already decided. Back-ends only fill: they see slices and numbers, never a mesh or a scene.
//!
//! [`build()`] makes a [`DrawPlan`] from a mesh and a spec; everything that a scene does not need is left out there, and
//! each omission is written down in [`DrawPlan::skips`].

mod build;
mod wires;

pub use build::build;

/// Everything a back-end needs for one picture.
///
/// Screen space: x right, y down, in units of 1/256 pixel from the picture's centre. Depth is reversed: larger is nearer,
/// 0 is infinitely far or nothing.
#[derive(Debug)]
pub struct DrawPlan<'a> {
    /// Columns, at most 4096.
    pub width_px: u32,
    /// Rows, at most 4096.
    pub height_px: u32,
    /// Visibility samples a pixel: 1 or 4.
    pub samples: u32,
    /// Positions in the unit box.
    pub positions: &'a [[f32; 3]],
    /// Triangles over `positions`. An id in the visibility buffer is an index here, plus `triangles.len()` for the hull.
    pub triangles: &'a [[u32; 3]],
    /// Unit box to screen.
    pub projection: Projection,
    /// The filled surface; None where a look has none.
    pub surface: Option<SurfacePass<'a>>,
    /// The pushed-out back faces; None where a look has none.
    pub hull: Option<HullPass<'a>>,
    /// Lines of exact width; None where a look has none.
    pub lines: Option<LinePass>,
    /// Premultiplied linear RGBA behind everything.
    pub background: [f32; 4],
    /// What this scene did not need, and why.
    pub skips: Vec<Skip>,
}

/// Row vectors: `screen = (X.p, Y.p) / W.p`, `depth = Z.p / W.p` for `p = (x, y, z, 1)`.
///
/// W is the distance in front of the eye in perspective (near plane at `near_w`) and constantly 1 in an orthographic view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// To 1/256 pixels right of the centre, times W.
    pub x: [f32; 4],
    /// To 1/256 pixels below the centre, times W.
    pub y: [f32; 4],
    /// To reversed depth, times W.
    pub z: [f32; 4],
    /// To W.
    pub w: [f32; 4],
    /// Smallest W that is drawn.
    pub near_w: f32,
    /// Whether triangles may reach behind the near plane or far outside the picture. Where the mesh's box is known to lie
    /// inside, no triangle is ever tested for clipping.
    pub clip: bool,
    /// Unit vector from the mesh towards the viewer, unit-box axes.
    pub to_viewer: [f32; 3],
    /// The picture's up direction, unit-box axes.
    pub screen_up: [f32; 3],
    /// The picture's right direction, unit-box axes.
    pub screen_right: [f32; 3],
}

/// Which side of triangles a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Faces {
    /// Both.
    Both,
    /// Counter-clockwise on screen.
    Front,
    /// Clockwise on screen.
    Back,
}

/// The filled surface.
#[derive(Debug)]
pub struct SurfacePass<'a> {
    /// Which faces are drawn.
    pub faces: Faces,
    /// How a visible sample gets its normal.
    pub normals: Normals<'a>,
    /// Linear RGBA, by material index.
    pub material_colors: Vec<[f32; 4]>,
    /// Material index a triangle; empty where there is one material.
    pub triangle_materials: &'a [u32],
    /// 0 to 1.
    pub metallic: f32,
    /// 0 to 1.
    pub roughness: f32,
    /// Headlight strength.
    pub intensity: f32,
    /// Ambient share, 0 to 1.
    pub ambient: f32,
    /// Unit vector towards the headlight, unit-box axes.
    pub to_light: [f32; 3],
    /// Unit vector halfway between the light and the viewer: the normal that shines most.
    pub halfway: [f32; 3],
    /// Wires drawn in the same breath as the surface, from barycentrics.
    pub fwidth: Option<FwidthWire<'a>>,
}

/// Where normals come from.
#[derive(Debug)]
pub enum Normals<'a> {
    /// Unlit: none are read.
    None,
    /// A unit normal a triangle.
    Face(&'a [[f32; 3]]),
    /// Interpolated between corners.
    Vertex {
        /// Unit normals.
        values: std::borrow::Cow<'a, [[f32; 3]]>,
        /// Three indices into `values` a triangle.
        triangles: &'a [[u32; 3]],
    },
}

/// `min_i smoothstep(t d_i, (t + s) d_i, b_i)` over the drawn edges, with `d = |db/dx| + |db/dy|` a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FwidthWire<'a> {
    /// Premultiplied linear RGBA, opacity included.
    pub color: [f32; 4],
    /// t
    pub thickness: f32,
    /// s
    pub smoothing: f32,
    /// Which edges of each triangle are drawn (bit i: corner i to i + 1); empty where all are.
    pub edge_masks: &'a [u8],
}

/// The inverted hull: back faces only, each vertex pushed out along its normal.
#[derive(Debug)]
pub struct HullPass<'a> {
    /// Premultiplied linear RGBA.
    pub color: [f32; 4],
    /// A unit normal a position.
    pub normals: std::borrow::Cow<'a, [[f32; 3]]>,
    /// How far.
    pub offset: HullOffset,
}

/// How far a hull vertex moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HullOffset {
    /// Along the normal, in units of the box.
    Object(f32),
    /// On screen along the projected normal, in pixels.
    Px(f32),
}

/// Lines along edges, of one width and colour.
#[derive(Debug)]
pub struct LinePass {
    /// Each edge once.
    pub edges: Vec<Edge>,
    /// Full width, pixels.
    pub width_px: f32,
    /// Extra ramp, pixels.
    pub smoothing_px: f32,
    /// Premultiplied linear RGBA, opacity included.
    pub color: [f32; 4],
    /// Whether edges behind a surface are left out. Needs the visibility buffer.
    pub hide_behind_surface: bool,
    /// Whether an edge whose faces all look away can be left out: true for closed surfaces.
    pub skip_back_edges: bool,
}

/// An edge and the first two faces it belongs to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Edge {
    /// Indices into the positions.
    pub vertices: [u32; 2],
    /// Triangle indices; [`Edge::NO_FACE`] where there is no second face.
    pub faces: [u32; 2],
}

impl Edge {
    /// No triangle.
    pub const NO_FACE: u32 = u32::MAX;
}

/// Something that was left out because this scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skip {
    /// What: "vertex normals".
    pub what: &'static str,
    /// Why: "flat shading reads face normals".
    pub why: &'static str,
}

/// Coverage in 1/1023 to ink: `-4096 log2(1 - c)`, so that the ink of lines that cross adds up as if they were independent,
/// in integers, whatever the order. Full coverage is 24 halvings.
pub fn ink_table() -> [u32; 1024] {
    std::array::from_fn(|q| match q {
        1023 => INK_FULL,
        _ => libm::round(-4096.0 * libm::log2(1.0 - q as f64 / 1023.0)) as u32,
    })
}

/// Ink of full coverage.
pub const INK_FULL: u32 = 24 * 4096;

/// Sample positions inside a pixel, in 1/16 pixel from its upper left corner: the standard rotated grid for 4.
pub fn sample_offsets(samples: u32) -> &'static [[i32; 2]] {
    match samples {
        1 => &[[8, 8]],
        _ => &[[6, 2], [14, 6], [2, 10], [10, 14]],
    }
}
