//! The parts of a glTF document that are parsed immediately, used or not: scenes, nodes, meshes,
//! skins, accessors, buffer views and buffers. Most references among them are checked in
//! [`super::check`].

use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

use super::lists::Index;

/// The document, without the lists in [`super::lists::Lists`].
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    pub asset: Asset,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
    pub scene: Option<Index>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<MeshJson>,
    #[serde(default)]
    pub skins: Vec<Skin>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
}

impl Document {
    /// True if the file declares an extension as used.
    pub fn uses(&self, extension: &str) -> bool {
        self.extensions_used.iter().chain(&self.extensions_required).any(|name| name == extension)
    }
}

/// `asset`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Asset {
    pub version: String,
    pub min_version: Option<String>,
}

/// `scene`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Scene {
    pub nodes: Vec<Index>,
}

/// `node`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Node {
    pub name: Option<String>,
    pub children: Vec<Index>,
    pub mesh: Option<Index>,
    pub camera: Option<Index>,
    pub skin: Option<Index>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub weights: Option<Vec<f64>>,
    pub extensions: NodeExtensions,
}

/// Extensions of `node`.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub visibility: Option<Visibility>,
}

/// `EXT_mesh_gpu_instancing`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Instancing {
    pub attributes: BTreeMap<String, Index>,
}

/// `KHR_node_visibility`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Visibility {
    pub visible: Option<bool>,
}

/// `mesh`
///
/// `rename` and `expecting`: error messages that clients see say "Mesh".
#[derive(Debug, Deserialize)]
#[serde(rename = "Mesh", expecting = "struct Mesh")]
pub struct MeshJson {
    pub primitives: Vec<Primitive>,
    pub weights: Option<Vec<f64>>,
}

/// Accessors by the names of attributes.
pub type Attributes = BTreeMap<String, Index>;

/// `mesh.primitive`
#[derive(Debug, Deserialize)]
pub struct Primitive {
    pub attributes: Attributes,
    pub indices: Option<Index>,
    pub material: Option<Index>,
    pub mode: Option<Index>,
    #[serde(default)]
    pub targets: Vec<Attributes>,
    #[serde(default)]
    pub extensions: PrimitiveExtensions,
}

impl Primitive {
    /// The topology of the primitive. Unknown modes are refused elsewhere.
    pub fn mode(&self) -> usize {
        self.mode.map_or(mode::TRIANGLES, |mode| mode.0)
    }
}

/// `mesh.primitive.mode`
pub mod mode {
    pub const POINTS: usize = 0;
    pub const LINES: usize = 1;
    pub const LINE_LOOP: usize = 2;
    pub const LINE_STRIP: usize = 3;
    pub const TRIANGLES: usize = 4;
    pub const TRIANGLE_STRIP: usize = 5;
    pub const TRIANGLE_FAN: usize = 6;
}

/// Extensions of `mesh.primitive`.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct PrimitiveExtensions {
    #[serde(rename = "FB_ngon_encoding")]
    pub ngons: Option<IgnoredAny>,
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub draco: Option<Draco>,
}

/// `KHR_draco_mesh_compression`
#[cfg_attr(not(feature = "draco"), allow(dead_code))] // Only its decoder reads all of it.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Draco {
    pub buffer_view: Index,
    /// Unique ids in the compressed data by the names of attributes.
    pub attributes: BTreeMap<String, Index>,
}

/// `skin`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Skin {
    pub joints: Vec<Index>,
    pub inverse_bind_matrices: Option<Index>,
}

/// `accessor`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Option<Index>,
    #[serde(default)]
    pub byte_offset: Whole,
    pub component_type: Index,
    #[serde(default)]
    pub normalized: bool,
    pub count: Whole,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<Sparse>,
}

/// `accessor.sparse`
#[derive(Debug, Deserialize)]
pub struct Sparse {
    pub count: Whole,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

/// `accessor.sparse.indices`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SparseIndices {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Whole,
    pub component_type: Index,
}

/// `accessor.sparse.values`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SparseValues {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Whole,
}

/// `bufferView`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferView {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Whole,
    pub byte_length: Whole,
    pub byte_stride: Option<Whole>,
    #[serde(default)]
    pub extensions: BufferViewExtensions,
}

/// Extensions of `bufferView`: two names of one codec, of which the second knows one filter more.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct BufferViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub ext_meshopt: Option<Meshopt>,
    #[serde(rename = "KHR_meshopt_compression")]
    pub khr_meshopt: Option<Meshopt>,
}

/// `EXT_meshopt_compression`, `KHR_meshopt_compression`
#[cfg_attr(not(feature = "meshopt"), allow(dead_code))] // Only its decoder reads all of it.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Meshopt {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Whole,
    pub byte_length: Whole,
    pub byte_stride: Whole,
    pub count: Whole,
    pub mode: String,
    pub filter: Option<String>,
}

/// `buffer`
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Buffer {
    pub uri: Option<String>,
    pub byte_length: Whole,
}

/// A count or an offset. `1.0` is a valid integer in JSON.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(try_from = "f64")]
pub struct Whole(pub u64);

impl TryFrom<f64> for Whole {
    type Error = &'static str;

    fn try_from(v: f64) -> Result<Self, Self::Error> {
        // Up to 2^53 every whole number is an exact f64.
        let whole = v as u64;
        if whole as f64 == v && v < 9007199254740992.0 { Ok(Self(whole)) } else { Err("it must be a whole number") }
    }
}
