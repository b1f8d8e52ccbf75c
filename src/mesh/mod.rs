//! The [`Mesh`] that every importer ends in, and what can be asked of it: [`normals`], [`edges`], [`topology`], [`measure`].

pub mod edges;
pub mod material;
pub mod measure;
mod metadata;
pub mod normals;
pub mod primitives;
pub mod topology;
pub(crate) mod union_find;

pub use material::MaterialSlot;
pub use metadata::FileMetadata;
pub use primitives::LineOrPoint;

use crate::import::Format;
use crate::warning::Warning;
use material::{FileCamera, ImageSource};
use serde::Serialize;

/// A triangle mesh in its normal form.
///
/// Positions lie in a box of at most 1 unit a side around the origin, in f32. [`Mesh::to_file`] leads back to the file's
/// own space. Positions are welded: no two are equal, so that indices alone tell which triangles are neighbours.
/// Attributes (normals, UVs, colours) have their own index, because a file may give one position several normals.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Welded positions in the unit box. Finite.
    pub positions: Vec<[f32; 3]>,
    /// Three indices into `positions` a triangle, counter-clockwise seen from the front, no two equal. In file order.
    pub triangles: Vec<[u32; 3]>,
    /// A unit normal a triangle, computed in f64 from the file's own positions. Zero where the face has no area.
    pub face_normals: Vec<[f32; 3]>,
    /// A polygon edge mask a triangle: bit `i` is set where the edge from corner `i` to corner `i + 1` is an edge of the
    /// file's polygon, clear where triangulation made it up.
    pub edge_masks: Vec<u8>,
    /// Index into `materials` a triangle.
    pub triangle_materials: Vec<u32>,
    /// The file's materials; at least one.
    pub materials: Vec<MaterialSlot>,
    /// The images that the materials refer to, still encoded.
    pub images: Vec<ImageSource>,
    /// The file's cameras, in the order of the scene.
    pub cameras: Vec<FileCamera>,
    /// Three indices into the attribute arrays a triangle. Empty where there is no attribute at all.
    pub attribute_triangles: Vec<[u32; 3]>,
    /// Line segments and points, their ends indices into `positions`; none is shorter than 24 bits can tell.
    pub lines_and_points: Vec<LineOrPoint>,
    /// Two indices into the attribute arrays each. Empty where there is no attribute at all.
    pub line_point_attributes: Vec<[u32; 2]>,
    /// Unit vertex normals of the file; empty where it has none.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, (0, 0) the upper left corner of the image and v down; empty where the file has none.
    pub uvs: Vec<[f32; 2]>,
    /// Linear RGBA vertex colours; empty where the file has none.
    pub colors: Vec<[f32; 4]>,
    /// Bounds of `positions`: minimum and maximum.
    pub bounds: [[f32; 3]; 2],
    /// The way back to the file's space.
    pub to_file: ToFile,
    /// The axis that points up in the format's convention.
    pub up: UpAxis,
    /// What the importer saw, dropped and repaired.
    pub report: ImportReport,
}

/// `file = centre + scale * unit`. The scale is a power of two, so going there and back rounds nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToFile {
    /// Middle of the file's bounding box, in file units.
    pub centre: [f64; 3],
    /// File units in a unit of the box.
    pub scale: f64,
}

impl Default for ToFile {
    fn default() -> Self {
        Self { centre: [0.0; 3], scale: 1.0 }
    }
}

/// Which way is up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +X
    X,
    /// -X
    NegX,
    /// +Y: glTF and, by custom, OBJ.
    #[default]
    Y,
    /// -Y
    NegY,
    /// +Z: STL, by custom.
    Z,
    /// -Z
    NegZ,
}

/// What an importer saw, dropped and repaired. `inspect` prints it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImportReport {
    /// Format, as sniffed.
    pub format: Format,
    /// Vertices in the file, before welding.
    pub file_vertices: u64,
    /// What the file's meshes say that they have, whether shown, hidden or shown many times; None where the format counts nothing of
    /// its own: all but glTF.
    pub content: Option<FileContent>,
    /// Polygons in the file: `polygons_by_arity[k]` counts those with `k` corners (12 and more share the last place).
    pub polygons_by_arity: [u64; 13],
    /// Faces dropped because a corner is NaN or infinite.
    pub dropped_nonfinite_faces: u64,
    /// Faces dropped because two corners are the same point or all lie on a line: exactly, in the file's own numbers.
    pub dropped_degenerate_faces: u64,
    /// Faces dropped because welding made two of their corners one: so small beside the whole mesh that 24 bits cannot tell
    /// them apart.
    pub dropped_collapsed_faces: u64,
    /// Line segments and points dropped: with NaN or infinite ends, or segments without a length.
    pub dropped_lines_and_points: u64,
    /// Things a user should know; each with a stable code.
    pub warnings: Vec<Warning>,
    /// What the file says of itself.
    pub metadata: FileMetadata,
}

/// How much the meshes of a file hold by their own account, each counted once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FileContent {
    /// Parts that are drawn with one material each.
    pub draw_calls: u64,
    /// Their vertices.
    pub vertices: u64,
    /// Their triangles.
    pub triangles: u64,
    /// Their line segments.
    #[serde(rename = "lines")]
    pub segments: u64,
    /// Their points.
    pub points: u64,
}
