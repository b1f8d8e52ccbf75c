//! What an importer fills in, before normalisation.

use crate::import::ImportReport;
use crate::mesh::material::{FileCamera, ImageSource};
use crate::mesh::{LineOrPoint, MaterialSlot, UpAxis};

/// A mesh as the file has it: file units, f64, nothing welded, nothing dropped.
#[derive(Clone, Debug, Default)]
pub struct RawMesh {
    /// Positions in file space, one a vertex. May hold NaN and infinities: normalisation drops the faces that use them.
    pub positions: Vec<[f64; 3]>,
    /// Whether the file stores those as f32: then what is far from the origin is coarse.
    pub is_f32: bool,
    /// Normals, one a vertex, any length; or empty.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one a vertex, (0, 0) the upper left corner of the image and v down; or empty.
    pub uvs: Vec<[f32; 2]>,
    /// Linear RGBA, one a vertex; or empty.
    pub colors: Vec<[f32; 4]>,
    /// Vertex indices; every one is below `positions.len()`: the importer has checked.
    pub triangles: Vec<[u32; 3]>,
    /// As [`crate::mesh::Mesh::edge_masks`], one a triangle.
    pub edge_masks: Vec<u8>,
    /// Index into `materials`, one a triangle.
    pub triangle_materials: Vec<u32>,
    /// Line segments and points, by vertex; as checked as the triangles.
    pub lines_and_points: Vec<LineOrPoint>,
    /// The file's materials; may be empty if every index above is 0.
    pub materials: Vec<MaterialSlot>,
    /// The images that the materials refer to, still encoded.
    pub images: Vec<ImageSource>,
    /// The file's cameras.
    pub cameras: Vec<FileCamera>,
    /// The axis that points up.
    pub up: UpAxis,
    /// Format, counts and warnings so far.
    pub report: ImportReport,
}

/// Appends one part's values of an attribute, for the vertices from `before` to `after`. A part that has none of it gives no
/// values; where other parts do, its vertices get `missing`.
pub fn extend_attribute<T: Copy>(
    all: &mut Vec<T>,
    before: usize,
    after: usize,
    missing: T,
    new: impl ExactSizeIterator<Item = T>,
) {
    if new.len() == after - before && after > before {
        all.resize(before, missing);
        all.extend(new);
    } else if !all.is_empty() {
        all.resize(after, missing);
    }
}

/// The sRGB transfer function (IEC 61966-2-1), continued beyond 1: for formats that store colours as displayed.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}
