//! STL, binary and ASCII, with the two conventions for colours in binary files ([`color`]). The
//! stored normals are ignored: they follow from the corners, or are wrong.

mod color;

use self::color::{Colors, is_flagged};
use super::polygon::ALL_EDGES;
use super::raw::{RawMesh, Soup};
use super::{Format, MeshError, text};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::mesh::{MaterialSlot, UpAxis};
use crate::parallel::map;
use crate::pluralise::pluralise;
use crate::warning::Warning;

/// Bytes before the triangles: an 80-byte header and a count.
const HEADER_BYTES: usize = 84;
/// Bytes per triangle: a normal, three corners and two attribute bytes.
const TRIANGLE_BYTES: usize = 50;
/// Triangles handed to a thread at a time.
const TRIANGLES_PER_PIECE: usize = 16_384;

/// Reads either kind of file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    if !is_exact_binary(bytes) && is_ascii(bytes) {
        read_ascii(text::trim_start(bytes), cx)
    } else {
        read_binary(bytes, cx)
    }
}

/// True if the length is exactly what the count in the header requires. Other data practically
/// never fits.
pub fn is_exact_binary(bytes: &[u8]) -> bool {
    declared_bytes(bytes) == Some(bytes.len() as u64)
}

/// True if the bytes look like a binary STL that was cut off or has trailing bytes: the count
/// roughly fits the length.
pub fn is_plausible_binary(bytes: &[u8]) -> bool {
    let len = bytes.len() as u64;
    if uncounted(bytes).is_some() {
        return true;
    }
    match declared_bytes(bytes) {
        Some(declared) if declared > HEADER_BYTES as u64 => {
            if declared > len {
                declared / 16 <= len
            } else {
                len - declared <= 512.max(len / 8)
            }
        }
        _ => false,
    }
}

/// The number of triangles in a file whose count was never filled in, as streaming writers leave
/// it: the count is 0 or all ones, whole triangles follow, and the first is plausible.
fn uncounted(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEADER_BYTES)?;
    let body = bytes.get(HEADER_BYTES..).filter(|body| body.len().is_multiple_of(TRIANGLE_BYTES))?;
    let first: Vec<f32> =
        body.get(12..48)?.chunks_exact(4).map(|c| f32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect();
    let is_plausible = first.iter().all(|v| *v == 0.0 || (1e-20..1e20).contains(&v.abs()));
    let is_unset = count == [0; 4] || count == [0xFF; 4];
    (is_unset && is_plausible && first.iter().any(|v| *v != 0.0)).then_some((body.len() / TRIANGLE_BYTES) as u64)
}

/// True if the bytes begin as an ASCII STL and go on as one.
pub fn is_ascii(bytes: &[u8]) -> bool {
    let text = text::trim_start(bytes);
    let begins = text.len() >= 5 && text[..5].eq_ignore_ascii_case(b"solid");
    if !begins || text.get(5).is_some_and(|b| !b.is_ascii_whitespace()) {
        return false;
    }
    let head = &text[..text.len().min(4096)];
    head.split(|b| b.is_ascii_whitespace())
        .any(|w| w.eq_ignore_ascii_case(b"facet") || w.eq_ignore_ascii_case(b"endsolid"))
}

fn declared_bytes(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEADER_BYTES)?;
    let count = u32::from_le_bytes(count.try_into().ok()?);
    Some(HEADER_BYTES as u64 + TRIANGLE_BYTES as u64 * u64::from(count))
}

fn read_binary(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let Some(declared) = declared_bytes(bytes) else {
        return Err(MeshError::broken(format!(
            "the STL file is {} long, and its header alone is {HEADER_BYTES}",
            pluralise(bytes.len(), "byte", "bytes")
        )));
    };
    let mut raw = new_mesh(Format::StlBinary);
    let declared = match uncounted(bytes) {
        None => declared,
        Some(count) => {
            let detail = format!(
                "the STL header does not say how many triangles follow, which are {count} by the file's length"
            );
            raw.report.warnings.push(Warning { code: "count_missing", detail });
            bytes.len() as u64
        }
    };
    let count = (declared - HEADER_BYTES as u64) / TRIANGLE_BYTES as u64;
    if declared > bytes.len() as u64 {
        return Err(MeshError::broken(format!(
            "the STL header at byte 80 says {}, which needs {declared} bytes, and the file has {}",
            pluralise(count, "triangle", "triangles"),
            bytes.len()
        )));
    }
    raw.report.metadata = FileMetadata::by(metadata::tidy(&bytes[..80]));
    if declared < bytes.len() as u64 {
        raw.report.warnings.push(Warning {
            code: "trailing_bytes",
            detail: format!(
                "ignored: {} after the last STL triangle",
                pluralise(bytes.len() as u64 - declared, "byte", "bytes")
            ),
        });
    }
    raw.is_f32 = true;
    cx.check_triangles(count)?;
    if count > u64::from(u32::MAX / 3) {
        return Err(MeshError::broken("the STL file has more than 4 billion corners"));
    }
    cx.budget.spend("the STL triangles", count, 1 + 4)?;
    // The triangles stay where they are.
    let body = cx.bundle.entry().bytes.slice(HEADER_BYTES..declared as usize);
    raw.soup = Some(Soup::new(body.clone(), TRIANGLE_BYTES, 12));
    cx.deadline.check()?;
    paint(&mut raw, &bytes[..80], &body, cx)?;
    finish(raw, count as usize)
}

/// Gives each triangle's three vertices the colour in its attribute bytes.
fn paint(raw: &mut RawMesh, header: &[u8], body: &[u8], cx: &mut Context<'_>) -> Result<(), MeshError> {
    let any_is_flagged = || {
        let pieces = body.chunks(TRIANGLES_PER_PIECE * TRIANGLE_BYTES).collect();
        map(pieces, |piece: &[u8]| attributes(piece).any(is_flagged)).contains(&true)
    };
    let Some(colors) = Colors::of(header, any_is_flagged) else { return Ok(()) };
    cx.deadline.check()?;
    let count = (body.len() / TRIANGLE_BYTES) as u64;
    cx.budget.spend("the colours of STL triangles", 3 * count, 16)?;
    raw.colors.reserve_exact(3 * count as usize);
    raw.colors.extend(attributes(body).flat_map(|attribute| [colors.color(attribute); 3]));
    // Vertex colours are final: white takes the place of the grey of files without colours.
    raw.materials = vec![MaterialSlot { base_color: Some([1.0; 4]), ..MaterialSlot::default() }];
    Ok(())
}

/// The attribute bytes of triangles.
fn attributes(triangles: &[u8]) -> impl Iterator<Item = u16> {
    triangles.as_chunks::<TRIANGLE_BYTES>().0.iter().map(|triangle| u16::from_le_bytes([triangle[48], triangle[49]]))
}

/// Reads ASCII word by word: exporters disagree on lines and indentation, but every corner is
/// `vertex x y z`.
fn read_ascii(text: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let mut raw = new_mesh(Format::StlAscii);
    // Files without line feeds have the line ends of old Macs.
    let newline = if text.contains(&b'\n') { b'\n' } else { b'\r' };
    raw.report.metadata = FileMetadata::by(metadata::tidy(name(text, newline)));
    // An upper bound from the shortest possible text of a triangle.
    let count_max = text.len() as u64 / 30 + 1;
    cx.budget.spend("the STL triangles", count_max, 3 * 24 + 12 + 1 + 4)?;
    let mut corners = 0_usize;
    let mut ended = false;
    let mut met = 0_u64;
    for (number, line) in text.split(|&b| b == newline).enumerate() {
        let mut words = line.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        // After "solid" and "endsolid" comes a name of any words. It ends with the line, or where
        // facets begin.
        let mut is_name = false;
        while let Some(word) = words.next() {
            if met.is_multiple_of(65_536) {
                cx.deadline.check()?;
            }
            met += 1;
            if is_name {
                let begins = word.eq_ignore_ascii_case(b"facet")
                    && words.clone().next().is_some_and(|word| word.eq_ignore_ascii_case(b"normal"));
                (is_name, ended) = (!begins, ended && !begins);
            } else if word.eq_ignore_ascii_case(b"vertex") {
                let mut position = [0.0; 3];
                for value in &mut position {
                    *value = parse(words.next()).ok_or_else(|| bad_line(number, "a vertex needs three numbers"))?;
                }
                raw.positions.push(position);
                corners += 1;
            } else if word.eq_ignore_ascii_case(b"endfacet") {
                if corners != 3 {
                    return Err(bad_line(number, &format!("a facet needs three vertices, and this one has {corners}")));
                }
                corners = 0;
                push_triangle(&mut raw);
            } else if word.eq_ignore_ascii_case(b"solid") || word.eq_ignore_ascii_case(b"endsolid") {
                ended = word.len() == 8;
                is_name = true;
            }
        }
    }
    if corners != 0 || !ended {
        return Err(MeshError::broken("the STL text has no \"endsolid\" at its end: it seems to be cut off"));
    }
    let count = raw.triangles.len();
    cx.check_triangles(count as u64)?;
    finish(raw, count)
}

/// The name after the first word, up to the end of the line or to a facet on the same line.
fn name(text: &[u8], newline: u8) -> &[u8] {
    let line = text.split(|&b| b == newline).next().and_then(|line| line.get(5..)).unwrap_or_default();
    let head = &line[..line.len().min(4096)];
    let facet = head.windows(13).position(|window| window.eq_ignore_ascii_case(b" facet normal"));
    &line[..facet.unwrap_or(line.len())]
}

fn parse(word: Option<&[u8]>) -> Option<f64> {
    text::number(word?)
}

fn bad_line(index: usize, what: &str) -> MeshError {
    MeshError::broken(format!("line {} of the STL text: {what}", index + 1))
}

fn new_mesh(format: Format) -> RawMesh {
    let mut raw = RawMesh { up: UpAxis::Z, ..RawMesh::default() };
    raw.report.format = format;
    raw
}

fn push_triangle(raw: &mut RawMesh) {
    let end = raw.positions.len() as u32;
    raw.triangles.push([end - 3, end - 2, end - 1]);
}

fn finish(mut raw: RawMesh, count: usize) -> Result<RawMesh, MeshError> {
    raw.edge_masks = vec![ALL_EDGES; count];
    raw.triangle_materials = vec![0; count];
    raw.report.file_vertices = 3 * count as u64;
    raw.report.polygons_by_arity[3] = count as u64;
    Ok(raw)
}
