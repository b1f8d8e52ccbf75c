//! The reader of glTF accessors, which are typed arrays in the binary data of a file. Memory is counted
//! against the job's limit before it is allocated, and each range of bytes is checked, in arithmetic of
//! 64 bits, before elements are read from it.

use super::attribute::{Component, INDICES, Kind, Rule, decode_unsigned};
use super::buffers::{Buffers, View};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::document::schema::{Accessor, Document, Sparse};
use crate::parallel::map;

/// Elements without data that even the smallest file may declare.
const ZEROS_MAX: u64 = 1 << 16;
/// Elements decoded by a thread at a time.
const ELEMENTS_PER_PIECE: usize = 32_768;

/// Reads accessors of one file.
pub struct Reader<'a> {
    doc: &'a Document,
    buffers: Buffers<'a>,
    is_quantised: bool,
}

/// The declared type and count of an accessor's elements.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Their type.
    pub kind: Kind,
    /// The type of their components.
    pub component: Component,
    /// True if integers stand for -1 to 1, or 0 to 1.
    pub normalised: bool,
    /// Their number.
    pub count: u64,
}

impl<'a> Reader<'a> {
    /// A reader of `doc`'s accessors; `bin` is the binary chunk of a GLB.
    pub fn new(doc: &'a Document, bin: Option<&'a [u8]>) -> Self {
        Self { doc, buffers: Buffers::new(doc, bin), is_quantised: doc.uses("KHR_mesh_quantization") }
    }

    /// The bytes of a buffer view, decompressed.
    pub fn view(&mut self, index: usize, cx: &mut Context<'_>) -> Result<View<'a>, MeshError> {
        self.buffers.view(index, cx)
    }

    /// The declaration of an accessor, if its use allows it.
    pub fn shape(&self, index: usize, rule: &Rule) -> Result<Shape, MeshError> {
        let accessor = self.accessor(index)?;
        let what = format!("accessor {index}");
        let kind = Kind::of(&accessor.kind).ok_or_else(|| broken(index, "has an unknown type"))?;
        let component =
            Component::of(accessor.component_type.0).ok_or_else(|| broken(index, "has an unknown component type"))?;
        rule.check(&what, kind, (component, accessor.normalized), self.is_quantised)?;
        Ok(Shape { kind, component, normalised: accessor.normalized, count: accessor.count.0 })
    }

    /// The number of an accessor's elements, of any type.
    pub fn count(&self, index: usize) -> Result<u64, MeshError> {
        Ok(self.accessor(index)?.count.0)
    }

    /// Vectors with `N` components. Where a rule allows several types, an accessor of another size
    /// fails here.
    pub fn vectors<const N: usize>(
        &mut self,
        index: usize,
        rule: &Rule,
        cx: &mut Context<'_>,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        let shape = self.shape(index, rule)?;
        if shape.kind.components() != N {
            return Err(broken(index, &format!("is {:?}, and {N} components are needed", shape.kind)));
        }
        let size = shape.component.bytes();
        cx.budget.spend("glTF vertices", shape.count, N as u64 * 8)?;
        self.check_zeros(index, cx)?;
        let mut out = vec![[0.0; N]; shape.count as usize];
        if shape.component == Component::F32 {
            // The same without a decision for each number.
            let decode = |bytes: &[u8]| {
                let words = bytes.as_chunks::<4>().0.first_chunk::<N>();
                words.map_or([0.0; N], |words| words.map(|word| f64::from(f32::from_le_bytes(word))))
            };
            self.fill(index, &shape, &mut out, decode, cx)?;
            return Ok(out);
        }
        let decode = |bytes: &[u8]| {
            std::array::from_fn(|k| shape.component.decode(&bytes[k * size..(k + 1) * size], shape.normalised))
        };
        self.fill(index, &shape, &mut out, decode, cx)?;
        Ok(out)
    }

    /// Vertex indices.
    pub fn indices(&mut self, index: usize, cx: &mut Context<'_>) -> Result<Vec<u32>, MeshError> {
        let shape = self.shape(index, &INDICES)?;
        if let Some(view) = self.accessor(index)?.buffer_view
            && self.doc.buffer_views[view.0].byte_stride.is_some_and(|stride| stride.0 != 0)
        {
            return Err(broken(index, "holds vertex indices, and its buffer view has a stride"));
        }
        cx.budget.spend("glTF indices", shape.count, 4)?;
        self.check_zeros(index, cx)?;
        let mut out = vec![0; shape.count as usize];
        match shape.component {
            Component::U16 => {
                self.fill(index, &shape, &mut out, |b| u32::from(u16::from_le_bytes([b[0], b[1]])), cx)?;
            }
            Component::U32 => {
                self.fill(index, &shape, &mut out, |b| b.first_chunk().map_or(0, |b| u32::from_le_bytes(*b)), cx)?;
            }
            _ => self.fill(index, &shape, &mut out, decode_unsigned, cx)?,
        }
        Ok(out)
    }

    fn accessor(&self, index: usize) -> Result<&'a Accessor, MeshError> {
        self.doc
            .accessors
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no accessor {index} in the glTF file")))
    }

    /// Limits accessors without data, which stand for zeros, to as many elements as the files have
    /// bytes: no mesh has more vertices.
    fn check_zeros(&self, index: usize, cx: &Context<'_>) -> Result<(), MeshError> {
        let accessor = self.accessor(index)?;
        let count = accessor.count.0;
        if accessor.buffer_view.is_some() || count <= ZEROS_MAX {
            return Ok(());
        }
        let most = ZEROS_MAX.saturating_add(cx.bundle.bytes_len());
        if count <= most {
            return Ok(());
        }
        Err(broken(index, &format!("has {count} elements and no data, in files that have room for {most}")))
    }

    /// Fills in what `decode` makes of every element's bytes: those of the buffer view, then the
    /// sparse replacements.
    fn fill<T: Send>(
        &mut self,
        index: usize,
        shape: &Shape,
        out: &mut [T],
        decode: impl Fn(&[u8]) -> T + Sync + Send,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        cx.deadline.check()?;
        let accessor = self.accessor(index)?;
        let what = format!("accessor {index}");
        let component = shape.component.bytes() as u64;
        let size = component * shape.kind.components() as u64;
        // Without a view all elements are zero, and the sparse part may replace some.
        if let Some(view) = accessor.buffer_view {
            let view = self.buffers.view(view.0, cx)?;
            let stride = view.stride_bytes.unwrap_or(size);
            let span = Span { offset: accessor.byte_offset.0, stride, size, component, count: shape.count };
            let data = span.data(&what, &view)?;
            let (stride, size) = (stride as usize, size as usize);
            let pieces = (0..).step_by(ELEMENTS_PER_PIECE).zip(out.chunks_mut(ELEMENTS_PER_PIECE)).collect();
            map(pieces, |(begin, out): (usize, &mut [T])| {
                let data = &data[begin * stride..];
                match size {
                    // Elements that follow each other, of the most frequent sizes.
                    4 if stride == 4 => fill_packed::<T, 4>(out, data, &decode),
                    8 if stride == 8 => fill_packed::<T, 8>(out, data, &decode),
                    12 if stride == 12 => fill_packed::<T, 12>(out, data, &decode),
                    _ => {
                        // The last element may end before its stride does.
                        for (place, bytes) in out.iter_mut().zip(data.chunks(stride)) {
                            *place = decode(&bytes[..size]);
                        }
                    }
                }
            });
        }
        match &accessor.sparse {
            Some(sparse) => {
                self.replace(index, sparse, shape.count, [component, size], cx, |at, bytes| out[at] = decode(bytes))
            }
            None => Ok(()),
        }
    }

    /// The sparse part: ascending indices, and the elements that replace those.
    fn replace(
        &mut self,
        index: usize,
        sparse: &Sparse,
        count: u64,
        [component, size]: [u64; 2],
        cx: &mut Context<'_>,
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<(), MeshError> {
        let replaced = sparse.count.0;
        if replaced > count {
            return Err(broken(index, &format!("replaces {replaced} of its {count} elements")));
        }
        let target = Component::of(sparse.indices.component_type.0)
            .filter(|c| matches!(c, Component::U8 | Component::U16 | Component::U32))
            .ok_or_else(|| broken(index, "has sparse indices that are not unsigned integers"))?
            .bytes() as u64;
        let what = format!("the sparse part of accessor {index}");
        let targets = self.buffers.view(sparse.indices.buffer_view.0, cx)?;
        let offset = sparse.indices.byte_offset.0;
        let span = Span { offset, stride: target, size: target, component: target, count: replaced };
        let targets = span.elements(&what, &targets)?.map(decode_unsigned);
        cx.budget.spend("glTF indices", replaced, 4)?;
        let targets: Vec<u32> = targets.collect();
        let values = self.buffers.view(sparse.values.buffer_view.0, cx)?;
        let span = Span { offset: sparse.values.byte_offset.0, stride: size, size, component, count: replaced };
        let values = span.elements(&what, &values)?;
        let mut next = 0;
        for (target, bytes) in targets.into_iter().zip(values) {
            if u64::from(target) >= count {
                return Err(broken(index, &format!("has a sparse index {target}, and {count} elements")));
            }
            if u64::from(target) < next {
                return Err(broken(index, &format!("has a sparse index {target} that is not greater than the last")));
            }
            next = u64::from(target) + 1;
            take(target as usize, bytes);
        }
        Ok(())
    }
}

/// The layout of elements in a view. All in bytes but the count.
#[derive(Clone, Copy)]
struct Span {
    offset: u64,
    stride: u64,
    size: u64,
    component: u64,
    count: u64,
}

impl Span {
    /// The bytes of each element, after the check of [`Self::data`].
    fn elements<'v>(
        self,
        what: &str,
        view: &'v View<'_>,
    ) -> Result<impl Iterator<Item = &'v [u8]> + use<'v>, MeshError> {
        let data = self.data(what, view)?;
        let (stride, size) = (self.stride as usize, self.size as usize);
        Ok((0..self.count as usize).map(move |i| &data[i * stride..i * stride + size]))
    }

    /// The bytes from the first element on, after a check that all lie in the view and are aligned.
    fn data<'v>(self, what: &str, view: &'v View<'_>) -> Result<&'v [u8], MeshError> {
        let Self { offset, stride, size, component, count } = self;
        let bytes = view.bytes();
        if stride < size {
            let detail = format!("has elements of {size} bytes, {stride} bytes apart");
            return Err(MeshError::broken(format!("{what} of the glTF file {detail}")));
        }
        let end = match count.checked_sub(1) {
            None => Some(0),
            Some(last) => stride.checked_mul(last).and_then(|n| n.checked_add(size)?.checked_add(offset)),
        };
        if end.is_none_or(|end| end > bytes.len() as u64) {
            let has = bytes.len();
            let detail =
                format!("has {count} elements of {size} bytes from byte {offset}, and its buffer view has {has} bytes");
            return Err(MeshError::broken(format!("{what} of the glTF file {detail}")));
        }
        let aligned = [offset, view.offset_bytes + offset, stride].iter().all(|bytes| bytes.is_multiple_of(component));
        if !aligned {
            let at = view.offset_bytes + offset;
            let detail = format!("has components of {component} bytes that begin at byte {at} of their buffer");
            return Err(MeshError::broken(format!(
                "{what} of the glTF file {detail}, which is not a multiple of that"
            )));
        }
        // An empty accessor may have any offset.
        Ok(bytes.get(offset as usize..).unwrap_or_default())
    }
}

/// Fills in what `decode` makes of elements of `SIZE` bytes that follow each other. The compiler knows
/// the size, so that this is about as fast as a copy.
fn fill_packed<T, const SIZE: usize>(out: &mut [T], data: &[u8], decode: impl Fn(&[u8]) -> T) {
    for (place, bytes) in out.iter_mut().zip(data.as_chunks::<SIZE>().0) {
        *place = decode(bytes);
    }
}

fn broken(index: usize, what: &str) -> MeshError {
    MeshError::broken(format!("accessor {index} of the glTF file {what}"))
}
