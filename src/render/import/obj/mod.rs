//! Wavefront OBJ. The text is cut into parts (`cut`), which several threads parse at the same time
//! (`parse`) and which are then put together (`assemble`). An error in a line names the line.
//! Before parsing, the memory that it takes is estimated from the text and spent from the job's
//! budget.
//!
//! MTL files, which describe materials, are read by [`mtl`]; [`materials`] makes the mesh's
//! materials and images from them.

mod assemble;
mod cut;
mod face;
mod lines;
mod map;
mod materials;
mod mtl;
mod parse;
mod skipped;
mod sniff;
#[cfg(test)]
mod tests;

pub use sniff::is_obj;

use self::assemble::{Room, Summary, assemble};
use self::cut::PART_BYTES;
use self::face::Counts;
use self::parse::{Part, PartError, Places, Rules, parse};
use super::raw::RawMesh;
use super::{Format, MeshError, text};
use crate::import::FileMetadata;
use crate::import::context::Context;
use crate::import::metadata;
use crate::mesh::MaterialSlot;
use crate::parallel;
use crate::srgb::srgb_to_linear;

/// Bytes that a number or a keyword becomes, at most. A `v` line of four words takes 96 bytes: three
/// f64 in the room for all parts, and three times as much where parts are parsed again into lists of
/// their own, which double as they grow. All other lines take less.
const BYTES_PER_WORD: u64 = 24;

/// Reads an OBJ file.
pub fn read(bytes: &[u8], cx: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    let text = text::to_utf8(bytes, cx.budget)?;
    let mut raw = RawMesh::default();
    raw.report.format = Format::Obj;
    raw.report.metadata = FileMetadata::by(metadata::first_comment(&text, b"#", |_| false));
    let summary = read_text(&text, PART_BYTES, true, &mut raw, cx)?;
    // What is said of skipped lines comes first.
    raw.report.warnings.splice(0..0, summary.skipped.warnings());
    linearise(&mut raw.colors);
    let slots = materials::read(&summary.materials, &summary.libraries, &mut raw, cx)?;
    // Slot 0 is for faces before the first `usemtl`, and is dropped without such faces.
    let line_or_point_unnamed = raw.lines_and_points.iter().any(|one| one.material == 0);
    let uses_unnamed = raw.triangle_materials.contains(&0) || line_or_point_unnamed || slots.is_empty();
    raw.materials = std::iter::once(MaterialSlot::default()).chain(slots).skip(usize::from(!uses_unnamed)).collect();
    if !uses_unnamed {
        raw.triangle_materials.iter_mut().for_each(|m| *m -= 1);
        raw.lines_and_points.iter_mut().for_each(|one| one.material -= 1);
    }
    Ok(raw)
}

/// Reads all of a text, in parts of about `part_bytes`.
fn read_text(
    text: &[u8],
    part_bytes: usize,
    is_quick: bool,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<Summary, MeshError> {
    let newline = lines::newline(text);
    let text = lines::without_mark(text);
    let pieces = cut::cut(text, newline, part_bytes);
    let census = parallel::map(pieces.clone(), |piece| cut::census(piece, newline));
    cx.budget.spend("the OBJ file", census.iter().map(|part| part.words).sum(), BYTES_PER_WORD)?;
    let deadline = cx.deadline;
    deadline.check()?;
    let is_colored = parse::has_colored_vertex(text, newline, || deadline.check().is_ok()).unwrap_or(false);
    let rules = Rules { newline, is_colored, before: None, is_quick, deadline };
    let mut room = Room::new(census, is_colored);
    let tasks = pieces.iter().copied().zip(room.places()).enumerate().collect();
    let mut parts = parallel::map(tasks, |(i, (piece, places))| {
        parse(piece, places, Rules { before: (i == 0).then(Counts::default), ..rules })
    });
    if parts.iter().any(|part| matches!(part, Err(PartError::NeedsCounts))) {
        parts = with_counts(&pieces, parts, rules);
    }
    let mut lines_before = 0;
    let mut all = Vec::with_capacity(parts.len());
    for part in parts {
        let part = part.map_err(|fault| fault.error(lines_before))?;
        lines_before += part.lines;
        all.push(part);
    }
    assemble(all, room, raw, cx)
}

/// Parses the parts again that need the counts of those before them.
fn with_counts<'t>(
    pieces: &[&'t [u8]],
    parts: Vec<Result<Part<'t>, PartError>>,
    rules: Rules<'_>,
) -> Vec<Result<Part<'t>, PartError>> {
    let counts = parallel::map(parts.iter().zip(pieces).collect(), |(part, piece)| match part {
        Ok(part) => part.counts(),
        Err(_) => parse::count(piece, rules.newline, || rules.deadline.check().is_ok()),
    });
    let mut sum = Counts::default();
    let mut befores = Vec::with_capacity(counts.len());
    for own in counts {
        befores.push(sum);
        sum = sum + own;
    }
    parallel::map(parts.into_iter().zip(pieces).zip(befores).collect(), |((part, piece), before)| match part {
        Err(PartError::NeedsCounts) => parse(piece, Places::default(), Rules { before: Some(before), ..rules }),
        other => other,
    })
}

/// Converts colours, which by convention are sRGB from 0 to 1 or, from some exporters, from 0 to
/// 255.
fn linearise(colors: &mut [[f32; 4]]) {
    let scale = if colors.iter().any(|c| c[..3].iter().any(|&v| v > 1.0 && v.is_finite())) { 255.0 } else { 1.0 };
    for component in colors.iter_mut().flat_map(|c| &mut c[..3]) {
        *component = srgb_to_linear(f64::from(*component) / scale) as f32;
    }
}
