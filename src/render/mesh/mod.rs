//! The [`Mesh`], the one form into which files of all formats are turned, and what is computed from it:
//! [`normals`], [`creases`], [`edges`], [`topology`].
//!
//! **Invariant**: nothing in this folder, and nothing that works with a mesh later, depends on the file
//! format.

pub mod creases;
pub mod edges;
pub mod material;
pub mod normals;
pub mod primitives;
pub mod topology;
pub mod union_find;
pub mod vector;

pub use material::MaterialSlot;
pub use primitives::LineOrPoint;

use material::{FileCamera, ImageContent, ImageSource};

/// A triangle mesh in its normal form.
///
/// Positions are f32 in a box around the origin whose sides are at most 1. [`Mesh::to_file`] leads
/// back to the file's own space. Positions are welded: no two are equal, so indices alone say which
/// triangles are neighbours. Attributes (normals, UVs, colours) have an index of their own, because
/// a file may give one position several normals.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Welded positions in the unit box. Finite.
    pub positions: Vec<[f32; 3]>,
    /// Three indices into `positions` per triangle, counter-clockwise seen from the front, no two
    /// equal. In file order.
    pub triangles: Vec<[u32; 3]>,
    /// A unit normal per triangle, computed in f64 from the file's own positions. Zero where the
    /// face has no area.
    pub face_normals: Vec<[f32; 3]>,
    /// A polygon edge mask per triangle. Bit `i` is set where the edge from corner `i` to corner
    /// `i + 1` is an edge of the file's polygon, and clear where triangulation added it.
    pub edge_masks: Vec<u8>,
    /// An index into `materials` per triangle.
    pub triangle_materials: Vec<u32>,
    /// The file's materials; at least one.
    pub materials: Vec<MaterialSlot>,
    /// The images that the materials refer to, still encoded.
    pub images: Vec<ImageSource>,
    /// The file's cameras, in the order of the scene.
    pub cameras: Vec<FileCamera>,
    /// Three indices into the attribute arrays per triangle. Empty where the mesh has no
    /// attributes.
    pub attribute_triangles: Vec<[u32; 3]>,
    /// Line segments and points. Their ends are indices into `positions`; segments too short for
    /// f32 were dropped.
    pub lines_and_points: Vec<LineOrPoint>,
    /// Two indices into the attribute arrays per line or point. Empty where the mesh has no
    /// attributes.
    pub line_point_attributes: Vec<[u32; 2]>,
    /// Unit vertex normals of the file; empty where it has none.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, (0, 0) the upper left corner of the image and v down; empty where the
    /// file has none.
    pub uvs: Vec<[f32; 2]>,
    /// The texture coordinates of textures that want a second set
    /// ([`TextureRef::is_second_uvs`](material::TextureRef::is_second_uvs)); empty where none does.
    pub second_uvs: Vec<[f32; 2]>,
    /// Linear RGBA vertex colours; empty where the file has none.
    pub colors: Vec<[f32; 4]>,
    /// Bounds of `positions`: minimum and maximum.
    pub bounds: [[f32; 3]; 2],
    /// The way back to the file's space.
    pub to_file: ToFile,
    /// The axis that points up, by the file or by the custom of its format.
    pub up: UpAxis,
}

impl Mesh {
    /// Memory of its lists, names and images, bytes.
    pub fn bytes(&self) -> u64 {
        let of_positions = size_of_val(&self.positions[..]) + size_of_val(&self.triangles[..]);
        let of_faces =
            size_of_val(&self.face_normals[..]) + self.edge_masks.len() + size_of_val(&self.triangle_materials[..]);
        let of_corners = size_of_val(&self.attribute_triangles[..]) + size_of_val(&self.line_point_attributes[..]);
        let of_uvs = size_of_val(&self.uvs[..]) + size_of_val(&self.second_uvs[..]);
        let of_attributes = size_of_val(&self.normals[..]) + of_uvs + size_of_val(&self.colors[..]);
        let of_others =
            size_of_val(&self.lines_and_points[..]) + size_of_val(&self.materials[..]) + size_of_val(&self.cameras[..]);
        let of_image = |image: &ImageSource| match &image.content {
            ImageContent::Encoded(bytes) => bytes.len(),
            ImageContent::Absent => 0,
        };
        let of_images: usize =
            self.images.iter().map(|image| size_of::<ImageSource>() + image.name.len() + of_image(image)).sum();
        let of_names: usize = self.materials.iter().map(|material| material.name.len()).sum::<usize>()
            + self.cameras.iter().map(|camera| camera.name.len()).sum::<usize>();
        (of_positions + of_faces + of_corners + of_attributes + of_others + of_images + of_names) as u64
    }
}

/// The way from the unit box to the file's space: `file = centre + scale * unit`. The scale is a
/// power of two, so that scaling rounds nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToFile {
    /// The middle of the file's bounding box, in file units.
    pub centre: [f64; 3],
    /// File units per unit of the box.
    pub scale: f64,
}

impl Default for ToFile {
    fn default() -> Self {
        Self { centre: [0.0; 3], scale: 1.0 }
    }
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum UpAxis {
    /// +X.
    X,
    /// -X.
    NegX,
    /// +Y: glTF and, by custom, OBJ.
    #[default]
    Y,
    /// -Y.
    NegY,
    /// +Z: STL, by custom.
    Z,
    /// -Z.
    NegZ,
}

impl UpAxis {
    /// The unit vector along it, in the file's coordinates.
    pub fn direction(self) -> [f64; 3] {
        match self {
            Self::X => [1.0, 0.0, 0.0],
            Self::NegX => [-1.0, 0.0, 0.0],
            Self::Y => [0.0, 1.0, 0.0],
            Self::NegY => [0.0, -1.0, 0.0],
            Self::Z => [0.0, 0.0, 1.0],
            Self::NegZ => [0.0, 0.0, -1.0],
        }
    }
}
