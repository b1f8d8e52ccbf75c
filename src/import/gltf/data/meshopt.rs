//! EXT_meshopt_compression and KHR_meshopt_compression: a view's bytes, packed by the meshoptimizer
//! codec.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_meshopt_compression>
//!
//! The `meshopt` crate unpacks, which is exact. The filters that follow are our own, because those
//! of the crate use a square root that differs between processors.

use super::meshopt_filters as filters;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::document::schema::Meshopt;

/// The unpacked bytes of view `index`, which declares `view_bytes` of them.
pub fn decode(
    index: usize,
    packed: &Meshopt,
    is_khr: bool,
    from: &[u8],
    view_bytes: u64,
    cx: &mut Context<'_>,
) -> Result<Vec<u8>, MeshError> {
    let broken =
        |what: &str| MeshError::broken(format!("the compressed data of buffer view {index} of the glTF file {what}"));
    let (count, stride) = (packed.count.0, packed.byte_stride.0);
    let size = count.checked_mul(stride).filter(|&size| size == view_bytes);
    let Some(size) = size else {
        return Err(broken(&format!("has {count} elements of {stride} bytes, and the view has {view_bytes} bytes")));
    };
    let is_attributes = packed.mode == "ATTRIBUTES";
    let is_good_stride =
        if is_attributes { stride % 4 == 0 && (4..=256).contains(&stride) } else { [2, 4].contains(&stride) };
    if !is_good_stride {
        return Err(broken(&format!(
            "has a stride of {stride} bytes, which is not allowed in the mode {:.20}",
            packed.mode
        )));
    }
    let filter = packed.filter.as_deref().unwrap_or("NONE");
    if filter != "NONE" && !is_attributes {
        return Err(broken("has a filter, which goes with attributes alone"));
    }
    // Paid for twice: as the codec returns it, and as bytes.
    cx.budget.spend("compressed glTF data", size, 2)?;
    cx.deadline.check()?;
    let count = count as usize;
    let unpacked = match (packed.mode.as_str(), stride) {
        ("ATTRIBUTES", _) => rows(from, count, stride / 4),
        ("TRIANGLES", _) if !count.is_multiple_of(3) => {
            return Err(broken("has indices that do not make up whole triangles"));
        }
        ("TRIANGLES", 2) => meshopt::decode_index_buffer::<u16>(from, count).ok().map(|v| shorts(&v)),
        ("TRIANGLES", _) => meshopt::decode_index_buffer::<u32>(from, count).ok().map(|v| words(&v)),
        ("INDICES", 2) => meshopt::decode_index_sequence::<u16>(from, count).ok().map(|v| shorts(&v)),
        ("INDICES", _) => meshopt::decode_index_sequence::<u32>(from, count).ok().map(|v| words(&v)),
        _ => return Err(broken("has an unknown mode")),
    };
    let mut bytes = unpacked.ok_or_else(|| broken("cannot be decompressed"))?;
    cx.deadline.check()?;
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
