//! The bytes of glTF buffers and buffer views. A buffer is decoded, and a view decompressed, when
//! something first needs it. Unused ones (a texture's buffer, a file outside the upload) therefore
//! cost nothing.
//!
//! Decompression in another process is the exception: each order to it costs a process, so the
//! first view that is needed is sent together with others.

use super::meshopt;
use crate::import::context::Context;
use crate::import::gltf::document::schema::{Buffer, BufferView, Document};
use crate::import::{MeshError, MeshFault, text};
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::rc::Rc;

/// All buffers of a file.
pub struct Buffers<'a> {
    doc: &'a Document,
    bin: Option<&'a [u8]>,
    decoded: Vec<Option<Rc<Cow<'a, [u8]>>>>,
    /// By the index of their view.
    decompressed: BTreeMap<usize, Rc<Cow<'a, [u8]>>>,
    /// Views that another process has unpacked and none has asked for yet.
    unpacked: BTreeMap<usize, meshopt::Unpacked>,
}

/// A buffer view, checked to lie in its buffer.
pub struct View<'a> {
    buffer: Rc<Cow<'a, [u8]>>,
    start: usize,
    length: usize,
    /// Its offset in the buffer, for alignment checks.
    pub offset_bytes: u64,
    /// Bytes from one element to the next, if the view declares a stride.
    pub stride_bytes: Option<u64>,
}

impl View<'_> {
    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.buffer[self.start..self.start + self.length]
    }
}

impl<'a> Buffers<'a> {
    /// The buffers of `doc`; `bin` is the binary chunk of a GLB.
    pub fn new(doc: &'a Document, bin: Option<&'a [u8]>) -> Self {
        Self {
            doc,
            bin,
            decoded: vec![None; doc.buffers.len()],
            decompressed: BTreeMap::new(),
            unpacked: BTreeMap::new(),
        }
    }

    /// The view with the given index.
    pub fn view(&mut self, index: usize, cx: &mut Context<'_>) -> Result<View<'a>, MeshError> {
        let doc = self.doc;
        let view: &BufferView = doc
            .buffer_views
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no buffer view {index} in the glTF file")))?;
        let stride_bytes = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0);
        let compressed = view.extensions.ext_meshopt.as_ref().or(view.extensions.khr_meshopt.as_ref());
        if let Some(packed) = compressed {
            let buffer = match self.decompressed.get(&index) {
                Some(done) => Rc::clone(done),
                None => {
                    let what = format!("the compressed data of buffer view {index}");
                    let from = self.span(&what, packed.buffer.0, packed.byte_offset.0, packed.byte_length.0, cx)?;
                    let has_colors = view.extensions.khr_meshopt.is_some();
                    self.unpack_apart(index, cx)?;
                    let unpacked = self.unpacked.remove(&index);
                    let length = view.byte_length.0;
                    let bytes = meshopt::decode(index, packed, has_colors, from.bytes(), length, unpacked, cx)?;
                    let bytes = Rc::new(Cow::Owned(bytes));
                    self.decompressed.insert(index, Rc::clone(&bytes));
                    bytes
                }
            };
            let length = buffer.len();
            return Ok(View { buffer, start: 0, length, offset_bytes: 0, stride_bytes });
        }
        let what = format!("buffer view {index}");
        let view = self.span(&what, view.buffer.0, view.byte_offset.0, view.byte_length.0, cx)?;
        Ok(View { stride_bytes, ..view })
    }

    /// Has view `index` unpacked in another process, if there is one, and with it others that may be asked for.
    #[cfg(all(feature = "meshopt", feature = "isolate"))]
    fn unpack_apart(&mut self, index: usize, cx: &mut Context<'_>) -> Result<(), MeshError> {
        use super::meshopt_apart;
        let Some(isolation) = crate::import::isolate::isolation().filter(|_| !self.unpacked.contains_key(&index))
        else {
            return Ok(());
        };
        let mut views = Vec::new();
        let mut total_bytes = 0_u64;
        let others = (0..self.doc.buffer_views.len()).filter(|&other| other != index);
        for number in std::iter::once(index).chain(others) {
            let view = &self.doc.buffer_views[number];
            let json = view.extensions.ext_meshopt.as_ref().or(view.extensions.khr_meshopt.as_ref());
            let is_done = self.decompressed.contains_key(&number) || self.unpacked.contains_key(&number);
            let Some(json) = json.filter(|_| !is_done) else { continue };
            // What is wrong with a view is said when it is asked for.
            let Ok(packed) = meshopt::shape(number, json, view.byte_length.0) else { continue };
            let total = total_bytes.saturating_add(packed.bytes());
            if number != index && total > meshopt_apart::AHEAD_BYTES_MAX {
                continue;
            }
            let Ok(from) = self.span("", json.buffer.0, json.byte_offset.0, json.byte_length.0, cx) else { continue };
            total_bytes = total;
            views.push((number, packed, from));
        }
        if views.first().is_none_or(|(number, ..)| *number != index) {
            return Ok(());
        }
        // As it comes, and as it is kept.
        cx.budget.spend("compressed glTF data", total_bytes, 2)?;
        let parts: Vec<_> = views.iter().map(|(_, packed, from)| (*packed, from.bytes())).collect();
        let unpacked = meshopt_apart::read(&parts, isolation, cx)?;
        self.unpacked.extend(views.iter().map(|(number, ..)| *number).zip(unpacked));
        Ok(())
    }

    /// No other process unpacks.
    #[cfg(not(all(feature = "meshopt", feature = "isolate")))]
    fn unpack_apart(&mut self, _: usize, _: &mut Context<'_>) -> Result<(), MeshError> {
        Ok(())
    }

    /// Some bytes of a buffer.
    fn span(
        &mut self,
        what: &str,
        buffer: usize,
        start: u64,
        length: u64,
        cx: &mut Context<'_>,
    ) -> Result<View<'a>, MeshError> {
        let buffer = self.buffer(buffer, cx)?;
        if start.checked_add(length).is_none_or(|end| end > buffer.len() as u64) {
            return Err(MeshError::broken(format!(
                "{what} of the glTF file spans bytes {start} to {start} + {length}, and its buffer has {}",
                buffer.len()
            )));
        }
        Ok(View { buffer, start: start as usize, length: length as usize, offset_bytes: start, stride_bytes: None })
    }

    fn buffer(&mut self, index: usize, cx: &mut Context<'_>) -> Result<Rc<Cow<'a, [u8]>>, MeshError> {
        let buffer: &Buffer = self
            .doc
            .buffers
            .get(index)
            .ok_or_else(|| MeshError::broken(format!("there is no buffer {index} in the glTF file")))?;
        if let Some(done) = &self.decoded[index] {
            return Ok(Rc::clone(done));
        }
        let bytes = match (&buffer.uri, self.bin) {
            (Some(uri), _) => match from_uri(uri, &format!("buffer {index}"), cx)? {
                Uri::Bytes(bytes) => Cow::Owned(bytes),
                Uri::Outside(sentence) => return Err(MeshError::new(MeshFault::OutsideBundle, sentence)),
            },
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => {
                let detail = format!("buffer {index} of the glTF file has neither a URI nor a GLB chunk");
                return Err(MeshError::broken(detail));
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

/// The content behind a URI.
#[derive(Debug)]
pub enum Uri {
    /// Its bytes, paid for.
    Bytes(Vec<u8>),
    /// Content that the upload lacks, with a sentence that says what to add.
    Outside(String),
}

/// Resolves the URI of `what` ("buffer 0", "image 3"): decodes a `data:` URI, or finds a file of
/// the bundle. Nothing else is ever opened.
pub fn from_uri(uri: &str, what: &str, cx: &mut Context<'_>) -> Result<Uri, MeshError> {
    let Some(data) = strip_prefix_ignore_case(uri, "data:") else {
        return match cx.bundle.resolve(uri) {
            Ok(Some(file)) => {
                cx.budget.spend("a file of the bundle", file.bytes.len() as u64, 1)?;
                Ok(Uri::Bytes(file.bytes.to_vec()))
            }
            Ok(None) => Ok(Uri::Outside(format!(
                "{what} of the glTF file is \"{}\", and {} it: add it, embed it, or take a GLB",
                printable(uri),
                cx.bundle.origin().lacks()
            ))),
            Err(error) if error.fault == MeshFault::OutsideBundle => Ok(Uri::Outside(error.detail)),
            Err(error) => Err(error),
        };
    };
    let (_, base64) = data
        .split_once(";base64,")
        .ok_or_else(|| MeshError::broken(format!("the data URI of {what} of the glTF file is not base64")))?;
    cx.budget.spend("a data URI of the glTF file", base64.len() as u64, 1)?;
    let lenient = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&base64::alphabet::STANDARD, lenient).decode(base64.trim_ascii()).map(Uri::Bytes).map_err(
        |error| {
            MeshError::broken(format!(
                "the data URI of {what} of the glTF file is not valid base64: {}",
                text::foreign(error)
            ))
        },
    )
}

/// The beginning of a name, short enough for a sentence.
pub fn printable(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(80).collect()
}

fn strip_prefix_ignore_case<'t>(text: &'t str, prefix: &str) -> Option<&'t str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}
