//! The bytes of buffers and buffer views. Buffers are decoded when first asked for, so that one that nothing drawn needs
//! (a texture's, or a file outside the upload) costs nothing.

use crate::mesh::import::Context;
use crate::mesh::{MeshError, MeshFault};
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::{Root, buffer};
use std::borrow::Cow;
use std::rc::Rc;

/// All buffers of a file.
pub struct Buffers<'a> {
    root: &'a Root,
    bin: Option<&'a [u8]>,
    decoded: Vec<Option<Rc<Cow<'a, [u8]>>>>,
}

/// A buffer view, checked to lie in its buffer.
pub struct View<'a> {
    buffer: Rc<Cow<'a, [u8]>>,
    start: usize,
    length: usize,
    /// Bytes from one element to the next, where the view says so.
    pub stride_bytes: Option<u64>,
}

impl View<'_> {
    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.buffer[self.start..self.start + self.length]
    }
}

impl<'a> Buffers<'a> {
    /// The buffers of `root`; `bin` is the binary chunk of a GLB.
    pub fn new(root: &'a Root, bin: Option<&'a [u8]>) -> Self {
        Self { root, bin, decoded: vec![None; root.buffers.len()] }
    }

    /// The view with the given index.
    pub fn view(&mut self, index: usize, cx: &mut Context<'_>) -> Result<View<'a>, MeshError> {
        let root = self.root;
        let view: &buffer::View = root
            .buffer_views
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no buffer view {index} in the glTF file")))?;
        let buffer = self.buffer(view.buffer.value(), cx)?;
        let start = view.byte_offset.map_or(0, |o| o.0);
        let length = view.byte_length.0;
        if start.checked_add(length).is_none_or(|end| end > buffer.len() as u64) {
            return Err(MeshError::broken(format!(
                "buffer view {index} of the glTF file spans bytes {start} to {start} + {length}, and its buffer has {}",
                buffer.len()
            )));
        }
        let stride_bytes = view.byte_stride.map(|s| s.0 as u64).filter(|&s| s > 0);
        Ok(View { buffer, start: start as usize, length: length as usize, stride_bytes })
    }

    fn buffer(&mut self, index: usize, cx: &mut Context<'_>) -> Result<Rc<Cow<'a, [u8]>>, MeshError> {
        let buffer = self
            .root
            .buffers
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no buffer {index} in the glTF file")))?;
        if let Some(done) = &self.decoded[index] {
            return Ok(Rc::clone(done));
        }
        let bytes = match (&buffer.uri, self.bin) {
            (Some(uri), _) => Cow::Owned(from_uri(uri, index, cx)?),
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => {
                return Err(super::document::compression(self.root).unwrap_or_else(|| {
                    MeshError::broken(format!("buffer {index} of the glTF file has neither a URI nor a GLB chunk"))
                }));
            }
        };
        if buffer.byte_length.0 > bytes.len() as u64 {
            return Err(MeshError::broken(format!(
                "buffer {index} of the glTF file should have {} bytes and has {}",
                buffer.byte_length.0,
                bytes.len()
            )));
        }
        let bytes = Rc::new(bytes);
        self.decoded[index] = Some(Rc::clone(&bytes));
        Ok(bytes)
    }
}

/// Decodes a `data:` URI, or takes the file of the bundle that the URI means. Nothing else is ever opened.
fn from_uri(uri: &str, index: usize, cx: &mut Context<'_>) -> Result<Vec<u8>, MeshError> {
    let Some(data) = strip_prefix_ignore_case(uri, "data:") else {
        if let Some(file) = cx.bundle.resolve(uri)? {
            cx.budget.spend("a glTF buffer", file.bytes.len() as u64, 1)?;
            return Ok(file.bytes.to_vec());
        }
        let name: String = uri.chars().filter(|c| !c.is_control()).take(80).collect();
        return Err(MeshError::new(
            MeshFault::OutsideBundle,
            format!(
                "buffer {index} of the glTF file is \"{name}\", which is not part of the upload: add it, send a GLB, or embed it"
            ),
        ));
    };
    let (_, base64) = data
        .split_once(";base64,")
        .ok_or_else(|| MeshError::broken(format!("the data URI of buffer {index} of the glTF file is not base64")))?;
    cx.budget.spend("a glTF buffer", base64.len() as u64, 1)?;
    let lenient = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&base64::alphabet::STANDARD, lenient).decode(base64.trim_ascii()).map_err(|error| {
        MeshError::broken(format!("the data URI of buffer {index} of the glTF file is not valid base64: {error}"))
    })
}

fn strip_prefix_ignore_case<'t>(text: &'t str, prefix: &str) -> Option<&'t str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}
