//! EXT_meshopt_compression and KHR_meshopt_compression: the decompression of buffer views that the
//! meshoptimizer codec has packed.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_meshopt_compression>
//!
//! The `meshopt` crate unpacks, which is exact. The filters that are then applied to the unpacked
//! values are our own, because some filters of the crate use a square root that differs between
//! processors.

use super::meshopt_filters as filters;
use crate::guard::{Panicked, guarded};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::document::schema::Meshopt;

/// The decoder's name.
pub const DECODER: &str = "meshoptimizer";

/// What became of a view's bytes: None if they are broken.
pub type Unpacked = Result<Option<Vec<u8>>, Panicked>;

/// The bytes of view `index`, which declares `view_bytes` of them. `unpacked` are those that were unpacked before.
pub fn decode(
    index: usize,
    json: &Meshopt,
    is_khr: bool,
    from: &[u8],
    view_bytes: u64,
    unpacked: Option<Unpacked>,
    cx: &mut Context<'_>,
) -> Result<Vec<u8>, MeshError> {
    let broken = |what: &str| broken(index, what);
    let packed = shape(index, json, view_bytes)?;
    let filter = json.filter.as_deref().unwrap_or("NONE");
    if filter != "NONE" && packed.mode != Mode::Attributes {
        return Err(broken("has a filter, which goes with attributes alone"));
    }
    // Paid for twice: as the codec returns it, and as bytes.
    cx.budget.spend("compressed glTF data", packed.bytes(), 2)?;
    cx.deadline.check()?;
    let unpacked = match unpacked {
        Some(unpacked) => unpacked,
        None => guarded(DECODER, || unpack(packed, from)),
    };
    let mut bytes = unpacked?.ok_or_else(|| broken("cannot be decompressed"))?;
    cx.deadline.check()?;
    let stride = packed.stride;
    match (filter, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4 | 8) => filters::octahedral(&mut bytes, stride as usize / 4),
        ("QUATERNION", 8) => filters::quaternion(&mut bytes),
        ("EXPONENTIAL", _) => filters::exponential(&mut bytes),
        ("COLOR", 4 | 8) if is_khr => filters::color(&mut bytes, stride as usize / 4),
        _ => return Err(broken(&format!("has the filter {filter:.20}, which does not go with {stride} bytes"))),
    }
    Ok(bytes)
}

/// What a view holds.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct Packed {
    /// Its kind.
    pub mode: Mode,
    /// Its elements.
    pub count: usize,
    /// Bytes of an element.
    pub stride: u64,
}

impl Packed {
    /// Its bytes, unpacked.
    pub fn bytes(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride)
    }
}

/// Checks what view `index` declares of its packed data.
pub fn shape(index: usize, json: &Meshopt, view_bytes: u64) -> Result<Packed, MeshError> {
    let broken = |what: &str| broken(index, what);
    let (count, stride) = (json.count.0, json.byte_stride.0);
    if count.checked_mul(stride).is_none_or(|size| size != view_bytes) {
        return Err(broken(&format!("has {count} elements of {stride} bytes, and the view has {view_bytes} bytes")));
    }
    let is_attributes = json.mode == "ATTRIBUTES";
    let is_good_stride =
        if is_attributes { stride % 4 == 0 && (4..=256).contains(&stride) } else { [2, 4].contains(&stride) };
    if !is_good_stride {
        return Err(broken(&format!(
            "has a stride of {stride} bytes, which is not allowed in the mode {:.20}",
            json.mode
        )));
    }
    let mode = match json.mode.as_str() {
        "ATTRIBUTES" => Mode::Attributes,
        "TRIANGLES" if !count.is_multiple_of(3) => {
            return Err(broken("has indices that do not make up whole triangles"));
        }
        "TRIANGLES" => Mode::Triangles,
        "INDICES" => Mode::Indices,
        _ => return Err(broken("has an unknown mode")),
    };
    Ok(Packed { mode, count: count as usize, stride })
}

fn broken(index: usize, what: &str) -> MeshError {
    MeshError::broken(format!("the compressed data of buffer view {index} of the glTF file {what}"))
}

/// What is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// Vertices.
    Attributes,
    /// Indices of triangles.
    Triangles,
    /// Other indices.
    Indices,
}

/// Unpacks elements, which were checked and paid for.
pub fn unpack(packed: Packed, from: &[u8]) -> Option<Vec<u8>> {
    let Packed { mode, count, stride } = packed;
    match (mode, stride) {
        (Mode::Attributes, _) => rows(from, count, stride / 4),
        (Mode::Triangles, 2) => meshopt::decode_index_buffer::<u16>(from, count).ok().map(|v| shorts(&v)),
        (Mode::Triangles, _) => meshopt::decode_index_buffer::<u32>(from, count).ok().map(|v| words(&v)),
        (Mode::Indices, 2) => meshopt::decode_index_sequence::<u16>(from, count).ok().map(|v| shorts(&v)),
        (Mode::Indices, _) => meshopt::decode_index_sequence::<u32>(from, count).ok().map(|v| words(&v)),
    }
}

/// An element type for the codec, which is generic over types of the element's size.
#[derive(Clone, Copy)]
struct Row<const WORDS: usize>([u32; WORDS]);

impl<const WORDS: usize> Default for Row<WORDS> {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

fn rows_of<const WORDS: usize>(from: &[u8], count: usize) -> Option<Vec<u8>> {
    let rows = meshopt::decode_vertex_buffer::<Row<WORDS>>(from, count).ok()?;
    let mut bytes = Vec::with_capacity(count * WORDS * 4);
    for row in &rows {
        bytes.extend(row.0.iter().flat_map(|word| word.to_ne_bytes()));
    }
    Some(bytes)
}

/// Elements of up to 64 words.
fn rows(from: &[u8], count: usize, words: u64) -> Option<Vec<u8>> {
    macro_rules! by_size {
        ($($n:literal)*) => {
            match words { $($n => rows_of::<$n>(from, count),)* _ => None }
        };
    }
    by_size!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
             33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
