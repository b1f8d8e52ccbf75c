//! OFF, the object file format of Geomview (its manual, "OFF: Object File Format"): text or binary,
//! with prefixes for normals, colours and texture coordinates, and with colours per face.
//!
//! [`header`] reads the keyword, [`text`] (which [`words`] splits into words) and [`binary`] read
//! the two encodings of the numbers, [`vertices`] and [`faces`] keep them, and [`colors`] decodes
//! colours.

mod binary;
mod colors;
mod faces;
mod header;
mod text;
mod vertices;
mod words;

pub use header::is_off;

use self::binary::Binary;
use self::faces::Faces;
use self::header::Header;
use self::text::Text;
use super::raw::RawMesh;
use super::{Format, MeshError};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::import::report::counted_warnings;
use crate::mesh::MaterialSlot;

/// Declared numbers of vertices and faces.
#[derive(Clone, Copy, Debug)]
struct Counts {
    vertices: u32,
    faces: u64,
}

/// A number of the file.
#[derive(Clone, Copy, Debug)]
struct Number {
    value: f64,
    /// True if it is written as a whole number. Whole numbers and fractions in colours have a scale
    /// each.
    is_whole: bool,
}

/// A body in either encoding.
trait Source {
    /// The number of vertices and faces.
    fn counts(&mut self) -> Result<Counts, MeshError>;
    /// The fewest bytes of a vertex of `numbers` numbers, and of a face.
    fn bytes_min(&self, numbers: u64) -> [u64; 2];
    /// Bytes that are left.
    fn left(&self) -> u64;
    /// Appends a vertex's numbers: those that the header declares, and the rest of the line.
    fn vertex(&mut self, header: &Header, out: &mut Vec<Number>) -> Result<(), MeshError>;
    /// Appends a face's vertices, and its colour's components.
    fn face(&mut self, corners: &mut Vec<f64>, color: &mut Vec<Number>, cx: &mut Context<'_>) -> Result<(), MeshError>;
    /// An error about the record last read.
    fn broken(&self, what: &str) -> MeshError;
    /// Bytes after the last record, without white space.
    fn trailing_bytes(&mut self) -> usize;
}

/// Reads an OFF file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let header = header::parse(bytes)?;
    if header.is_binary {
        return read_from(&mut Binary::new(bytes, header.body_at), &header, cx);
    }
    let mut raw = read_from(&mut Text::new(bytes, header.body_at), &header, cx)?;
    raw.report.metadata = FileMetadata::by(metadata::first_comment(bytes, b"#", |_| false));
    Ok(raw)
}

fn read_from(source: &mut impl Source, header: &Header, cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let counts = source.counts()?;
    check_counts(source, header, counts)?;
    let mut raw = RawMesh { is_f32: header.is_binary, ..RawMesh::default() };
    raw.report.format = Format::Off;
    raw.report.file_vertices = u64::from(counts.vertices);
    vertices::read(source, header, counts, &mut raw, cx)?;
    let mut faces = Faces::new(&raw, counts);
    faces.read(source, &mut raw, cx)?;
    let short_faces = faces.finish(&mut raw, cx)?;
    let notes = [
        (
            short_faces,
            "short_faces_ignored",
            "faces without corners, or with two that are one, are not drawn (faces in the file:",
        ),
        (source.trailing_bytes() as u64, "trailing_bytes", "what comes after the last OFF face is ignored (bytes:"),
    ];
    raw.report.warnings.extend(counted_warnings(notes));
    // Colours in the file are what to show, not a tint for the grey of files without colours.
    let base_color = if raw.colors.is_empty() { None } else { Some([1.0; 4]) };
    raw.materials = vec![MaterialSlot { base_color, ..MaterialSlot::default() }];
    Ok(raw)
}

/// Refuses counts that the file is too short for, before anything is made of them.
fn check_counts(source: &impl Source, header: &Header, counts: Counts) -> Result<(), MeshError> {
    let [vertex, face] = source.bytes_min(header.numbers_min() as u64);
    let needed = (u64::from(counts.vertices) * vertex).saturating_add(counts.faces.saturating_mul(face));
    let left = source.left();
    if needed > left {
        return Err(MeshError::broken(format!(
            "the OFF file says that it has {} vertices and {} faces, which need {needed} bytes at least, and {left} follow",
            counts.vertices, counts.faces
        )));
    }
    Ok(())
}
