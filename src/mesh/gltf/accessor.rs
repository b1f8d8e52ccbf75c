//! Reading accessors: every offset and count is checked, in 64 bits, and paid for, before any data is touched.

use super::buffers::{Buffers, View};
use crate::mesh::MeshError;
use crate::mesh::import::Context;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Root, accessor};

/// Reads accessors of one file.
pub struct Reader<'a> {
    root: &'a Root,
    buffers: Buffers<'a>,
}

/// How integers become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integers {
    /// As the accessor's `normalized` says.
    AsDeclared,
    /// From 0 to 1, always: colours.
    Normalised,
}

impl<'a> Reader<'a> {
    /// A reader of `root`'s accessors.
    pub fn new(root: &'a Root, bin: Option<&'a [u8]>) -> Self {
        Self { root, buffers: Buffers::new(root, bin) }
    }

    /// The bytes of a buffer view.
    pub fn view(&mut self, index: usize, cx: &mut Context<'_>) -> Result<View<'a>, MeshError> {
        self.buffers.view(index, cx)
    }

    /// The declared type of an accessor, and how many elements it has.
    pub fn shape(&self, index: usize) -> Result<(Type, u64), MeshError> {
        let accessor = self.accessor(index)?;
        match accessor.type_ {
            Checked::Valid(kind) => Ok((kind, accessor.count.0)),
            Checked::Invalid => Err(broken(index, "has an unknown type")),
        }
    }

    /// Fails if an accessor has no data because that is compressed.
    pub fn check_not_compressed(&self, index: usize) -> Result<(), MeshError> {
        let accessor = self.accessor(index)?;
        let is_empty = accessor.buffer_view.is_none() && accessor.sparse.is_none();
        match super::document::compression(self.root) {
            Some(error) if is_empty => Err(error),
            _ => Ok(()),
        }
    }

    /// Vectors with `N` components. The accessor must be of the `expected` type, which has `N` components.
    pub fn vectors<const N: usize>(
        &mut self,
        index: usize,
        expected: Type,
        integers: Integers,
        cx: &mut Context<'_>,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        let layout = self.layout(index, expected)?;
        let accessor = self.accessor(index)?;
        let normalised = accessor.normalized || integers == Integers::Normalised;
        let component = layout.component;
        let size = component_bytes(component);
        cx.budget.spend("glTF vertices", layout.count, N as u64 * 8)?;
        let mut out = vec![[0.0; N]; layout.count as usize];
        let decode = |bytes: &[u8]| -> [f64; N] {
            std::array::from_fn(|k| decode_number(&bytes[k * size..(k + 1) * size], component, normalised))
        };
        self.each(index, &layout, cx, |at, bytes| out[at] = decode(bytes))?;
        Ok(out)
    }

    /// Unsigned scalars: vertex indices.
    pub fn indices(&mut self, index: usize, cx: &mut Context<'_>) -> Result<Vec<u32>, MeshError> {
        let layout = self.layout(index, Type::Scalar)?;
        if !matches!(layout.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(broken(index, "holds vertex indices, which must be unsigned integers"));
        }
        cx.budget.spend("glTF indices", layout.count, 4)?;
        let mut out = vec![0; layout.count as usize];
        self.each(index, &layout, cx, |at, bytes| out[at] = decode_unsigned(bytes))?;
        Ok(out)
    }

    fn accessor(&self, index: usize) -> Result<&'a Accessor, MeshError> {
        self.root
            .accessors
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no accessor {index} in the glTF file")))
    }

    fn layout(&self, index: usize, expected: Type) -> Result<Layout, MeshError> {
        let accessor = self.accessor(index)?;
        let (kind, count) = self.shape(index)?;
        if kind != expected {
            return Err(broken(index, &format!("is {kind:?} where {expected:?} is needed")));
        }
        let Checked::Valid(accessor::GenericComponentType(component)) = accessor.component_type else {
            return Err(broken(index, "has an unknown component type"));
        };
        let element_bytes = component_bytes(component) as u64 * kind.multiplicity() as u64;
        Ok(Layout { component, element_bytes, count })
    }

    /// Hands every element's bytes to `take`: those of the buffer view, then those that the sparse part replaces.
    fn each(
        &mut self,
        index: usize,
        layout: &Layout,
        cx: &mut Context<'_>,
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<(), MeshError> {
        cx.deadline.check()?;
        let accessor = self.accessor(index)?;
        // Without a view all elements are zero, and the sparse part may replace some.
        if let Some(view) = accessor.buffer_view {
            let view = self.buffers.view(view.value(), cx)?;
            let stride = view.stride_bytes.unwrap_or(layout.element_bytes);
            let offset = accessor.byte_offset.map_or(0, |o| o.0);
            let what = format!("accessor {index}");
            for (at, bytes) in elements(&what, view.bytes(), offset, stride, layout.element_bytes, layout.count)? {
                take(at, bytes);
            }
        }
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        if sparse.count.0 > layout.count {
            let detail = format!("replaces {} of its {} elements", sparse.count.0, layout.count);
            return Err(broken(index, &detail));
        }
        let Checked::Valid(accessor::IndexComponentType(component)) = sparse.indices.component_type else {
            return Err(broken(index, "has sparse indices of an unknown type"));
        };
        let size = component_bytes(component) as u64;
        let what = format!("the sparse part of accessor {index}");
        let targets = self.buffers.view(sparse.indices.buffer_view.value(), cx)?;
        let targets = elements(&what, targets.bytes(), sparse.indices.byte_offset.0, size, size, sparse.count.0)?
            .map(|(_, bytes)| decode_unsigned(bytes))
            .collect::<Vec<_>>();
        let values = self.buffers.view(sparse.values.buffer_view.value(), cx)?;
        let (offset, size) = (sparse.values.byte_offset.0, layout.element_bytes);
        let values = elements(&what, values.bytes(), offset, size, size, sparse.count.0)?;
        for (target, (_, bytes)) in targets.into_iter().zip(values) {
            if u64::from(target) >= layout.count {
                return Err(broken(index, &format!("has a sparse index {target}, and {} elements", layout.count)));
            }
            take(target as usize, bytes);
        }
        Ok(())
    }
}

struct Layout {
    component: ComponentType,
    element_bytes: u64,
    count: u64,
}

/// The bytes of each of `count` elements, after checking that all of them lie in `bytes`.
fn elements<'v>(
    what: &str,
    bytes: &'v [u8],
    offset: u64,
    stride: u64,
    size: u64,
    count: u64,
) -> Result<impl Iterator<Item = (usize, &'v [u8])> + use<'v>, MeshError> {
    if stride < size {
        return Err(MeshError::broken(format!(
            "{what} of the glTF file has elements of {size} bytes, {stride} bytes apart"
        )));
    }
    let end = match count.checked_sub(1) {
        None => Some(0),
        Some(last) => stride.checked_mul(last).and_then(|n| n.checked_add(size)?.checked_add(offset)),
    };
    if end.is_none_or(|end| end > bytes.len() as u64) {
        return Err(MeshError::broken(format!(
            "{what} of the glTF file has {count} elements of {size} bytes from byte {offset}, and its buffer view has {} bytes",
            bytes.len()
        )));
    }
    // An empty accessor may have any offset.
    let data = bytes.get(offset as usize..).unwrap_or_default();
    let (stride, size) = (stride as usize, size as usize);
    Ok((0..count as usize).map(move |i| (i, &data[i * stride..i * stride + size])))
}

fn component_bytes(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

fn decode_unsigned(b: &[u8]) -> u32 {
    match *b {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    }
}

fn decode_number(b: &[u8], component: ComponentType, normalised: bool) -> f64 {
    let (value, one) = match (component, b) {
        (ComponentType::F32, &[a, b, c, d]) => return f64::from(f32::from_le_bytes([a, b, c, d])),
        (ComponentType::I8, &[a]) => (f64::from(a.cast_signed()), 127.0),
        (ComponentType::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U8, _) => (f64::from(decode_unsigned(b)), 255.0),
        (ComponentType::U16, _) => (f64::from(decode_unsigned(b)), 65535.0),
        _ => (f64::from(decode_unsigned(b)), 4294967295.0),
    };
    if normalised { (value / one).max(-1.0) } else { value }
}

fn broken(index: usize, what: &str) -> MeshError {
    MeshError::broken(format!("accessor {index} of the glTF file {what}"))
}
