//! The [`Mesh`] that every importer ends in, and what can be asked of it: [`normals`], [`edges`], [`topology`], [`measure`].

pub mod edges;
pub mod material;
pub mod measure;
pub mod normals;
pub mod primitives;
pub mod topology;
pub(crate) mod union_find;
pub(crate) mod vector;

pub use material::MaterialSlot;
pub use primitives::LineOrPoint;

use material::{FileCamera, ImageSource};

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
    /// Set once `loose` has been given an area for one view: where what the file has ends in the arrays.
    pub thickened: Option<Thickened>,
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
}

/// How many of a mesh's positions and triangles are the file's own; what follows them draws its lines and points in one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thickened {
    /// Positions of the file.
    pub positions: usize,
    /// Triangles of the file.
    pub triangles: usize,
}

impl Mesh {
    /// The file's own positions.
    pub fn own_positions(&self) -> &[[f32; 3]] {
        let end = self.thickened.map_or(self.positions.len(), |own| own.positions);
        self.positions.get(..end).unwrap_or(&self.positions)
    }

    /// The file's own triangles: these have edges, outlines and a topology.
    pub fn own_triangles(&self) -> &[[u32; 3]] {
        let end = self.thickened.map_or(self.triangles.len(), |own| own.triangles);
        self.triangles.get(..end).unwrap_or(&self.triangles)
    }
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
