//! PLY, the polygon file format (Greg Turk, "The PLY Polygon File Format", 1994), in all three
//! encodings, with common additions: texture coordinates per corner (`texcoord`), textures
//! (`comment TextureFile`, `texnumber`), triangle strips (`tristrips`).
//!
//! The [`header`] may declare any properties of any types in any order, so it is compiled to a
//! [`layout`], the steps through a record. [`source`] walks the records of a [`text`] or [`binary`]
//! body. [`vertices`], [`faces`] and [`edges`] keep what they need, [`assemble`] makes a mesh of
//! it, [`textures`] its materials, and [`conversion`] decodes colours.

mod assemble;
mod binary;
mod conversion;
mod edges;
mod faces;
mod header;
mod layout;
mod source;
#[cfg(test)]
mod tests;
mod text;
mod textures;
mod vertices;

pub use header::is_ply;

use self::binary::Binary;
use self::edges::Edges;
use self::faces::Faces;
use self::header::{Element, Encoding, Header};
use self::source::{Meter, Source, pass_over};
use self::text::Text;
use self::vertices::Vertices;
use super::raw::RawMesh;
use super::{Format, MeshError};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::import::report::counted_warnings;
use crate::warning::Warning;

/// Reads a PLY file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let header = header::parse(bytes)?;
    check_counts(&header, bytes.len())?;
    let at = header.body_at;
    let mut body = match header.encoding {
        Encoding::Text => read_body(&mut Text::new(bytes, at, header.newline), &header, cx)?,
        Encoding::LittleEndian => read_body(&mut Binary::<false>::new(bytes, at), &header, cx)?,
        Encoding::BigEndian => read_body(&mut Binary::<true>::new(bytes, at), &header, cx)?,
    };
    let mut raw = RawMesh::default();
    raw.report.format = Format::Ply;
    raw.report.warnings = body.warnings();
    let generator =
        metadata::first_comment(&bytes[..at], b"comment", |comment| header::texture_file(comment).is_some());
    raw.report.metadata = FileMetadata::by(generator);
    let textures = assemble::assemble(body.vertices, &mut body.faces, &mut raw, cx)?;
    if body.faces.arities.is_empty() {
        body.edges.apply(&mut raw, cx)?;
    }
    textures::apply(&header.textures, &textures, &mut raw, cx)?;
    Ok(raw)
}

/// Everything read from the body.
#[derive(Debug, Default)]
struct Body {
    vertices: Vertices,
    faces: Faces,
    edges: Edges,
    trailing_bytes: usize,
}

/// Refuses counts of records that the file is too short for, before anything is allocated.
fn check_counts(header: &Header, file_bytes: usize) -> Result<(), MeshError> {
    let mut left = (file_bytes - header.body_at) as u64;
    if header.encoding == Encoding::Text {
        left += 1; // nothing needs to follow the last number
    }
    for element in &header.elements {
        let needed = element.count.saturating_mul(element.record_bytes_min(header.encoding));
        let Element { name, count, .. } = element;
        if needed > left {
            return Err(MeshError::broken(format!(
                "the PLY header says {count} records of \"{}\", which need {needed} bytes at least, and {left} are left \
                 for them from byte {} on",
                header::word(name.as_bytes()),
                file_bytes as u64 - left.min(file_bytes as u64)
            )));
        }
        left -= needed;
    }
    Ok(())
}

fn read_body<S: Source>(source: &mut S, header: &Header, cx: &mut Context<'_>) -> Result<Body, MeshError> {
    // Faces may come first, so the number of vertices is taken from the header.
    let of_vertices = header.elements.iter().find(|element| element.name == "vertex");
    let count = of_vertices.map_or(0, |element| element.count);
    let count = u32::try_from(count).ok().filter(|&count| count < u32::MAX);
    let count = count.ok_or_else(|| MeshError::broken("the PLY file has more than 4 billion vertices"))?;
    let mut body = Body::default();
    let mut meter = Meter::default();
    for element in &header.elements {
        cx.deadline.check()?;
        match element.name.as_str() {
            "vertex" => body.vertices = vertices::read(source, element, &mut meter, cx)?,
            "face" => body.faces.read(source, element, count, &mut meter, cx)?,
            "tristrips" => body.faces.read_strips(source, element, count, &mut meter, cx)?,
            "edge" => body.edges.read(source, element, count, &mut meter, cx)?,
            _ => pass_over(source, element, &mut meter, cx)?,
        }
    }
    body.trailing_bytes = source.trailing_bytes();
    Ok(body)
}

impl Body {
    /// One warning for each kind of content that is not drawn.
    fn warnings(&self) -> Vec<Warning> {
        // Beside faces, edges mostly repeat edges of the faces and would be drawn over them.
        let edges = if self.faces.arities.is_empty() { 0 } else { self.edges.ends.len() as u64 };
        let all = [
            (edges, "lines_ignored", "edges are drawn where there are no faces (edges in the file:"),
            (
                self.faces.short_faces,
                "short_faces_ignored",
                "faces with fewer than three corners are not drawn (faces in the file:",
            ),
            (
                self.faces.odd_uvs,
                "texcoords_ignored",
                "lists of texture coordinates that are not two numbers a corner are passed over (faces in the file:",
            ),
            (self.trailing_bytes as u64, "trailing_bytes", "what comes after the last PLY element is ignored (bytes:"),
        ];
        counted_warnings(all).collect()
    }
}
