//! The raw mesh: the form in which every importer delivers a mesh, in the file's units and with
//! polygons split into triangles. `normalise` then turns it into the final `Mesh`.

use crate::import::ImportReport;
use crate::mesh::material::{FileCamera, ImageSource};
use crate::mesh::{LineOrPoint, MaterialSlot, UpAxis};
use bytes::Bytes;

/// A mesh before it is normalised: in file units, nothing welded.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct RawMesh {
    /// Positions in file space, one per vertex. May hold NaN and infinities: normalisation drops
    /// the faces that use them.
    pub positions: Vec<[f64; 3]>,
    /// True if the file stores them as f32, which is coarse far from the origin.
    pub is_f32: bool,
    /// Normals, one per vertex, any length; or empty.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per vertex, (0, 0) the upper left corner of the image and v down;
    /// or empty.
    pub uvs: Vec<[f32; 2]>,
    /// The same for textures that want a second set; or empty.
    pub second_uvs: Vec<[f32; 2]>,
    /// Linear RGBA, one per vertex; or empty.
    pub colors: Vec<[f32; 4]>,
    /// Vertex indices; every one is below `positions.len()`: the importer has checked.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles that share no vertices, in place of `positions` and `triangles`.
    #[cfg_attr(feature = "isolate", serde(skip))]
    pub soup: Option<Soup>,
    /// As [`crate::mesh::Mesh::edge_masks`], one per triangle.
    pub edge_masks: Vec<u8>,
    /// Index into `materials`, one per triangle.
    pub triangle_materials: Vec<u32>,
    /// Line segments and points by vertex index, checked like the triangles.
    pub lines_and_points: Vec<LineOrPoint>,
    /// The file's materials; may be empty if every index above is 0.
    pub materials: Vec<MaterialSlot>,
    /// The images that the materials refer to, still encoded.
    pub images: Vec<ImageSource>,
    /// The file's cameras.
    #[cfg_attr(feature = "isolate", serde(skip))]
    pub cameras: Vec<FileCamera>,
    /// The axis that points up.
    pub up: UpAxis,
    /// Format, counts and warnings so far.
    pub report: ImportReport,
}

impl RawMesh {
    /// True if vertices have more than a position.
    pub fn has_attributes(&self) -> bool {
        let has_uvs = !(self.uvs.is_empty() && self.second_uvs.is_empty());
        has_uvs || !(self.normals.is_empty() && self.colors.is_empty())
    }
}

/// Triangles that share no vertices, left where they lie in the file: records with nine f32,
/// little-endian. Vertex `3 t + k` is corner `k` of triangle `t`.
#[derive(Clone, Debug)]
pub struct Soup {
    records: Bytes,
    record_bytes: usize,
    offset: usize,
}

impl Soup {
    /// Triangles in whole records of `record_bytes`, whose corners begin at `offset` in each.
    pub fn new(records: Bytes, record_bytes: usize, offset: usize) -> Self {
        Self { records, record_bytes, offset }
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.records.len() / self.record_bytes
    }

    /// The bits of the coordinates of a triangle's corners.
    #[inline(always)]
    pub fn corners(&self, triangle: usize) -> [[u32; 3]; 3] {
        let begin = triangle * self.record_bytes + self.offset;
        let bytes = &self.records[begin..begin + 36];
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        [[word(0), word(4), word(8)], [word(12), word(16), word(20)], [word(24), word(28), word(32)]]
    }
}

/// Appends the values of an attribute for the vertices from `before` to `after`. If `new` is empty
/// while earlier vertices have the attribute, these vertices get `missing`; and the other way
/// round.
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
