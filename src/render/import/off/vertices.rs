//! The vertices of an OFF file, text or binary: positions, normals, texture coordinates and
//! colours, as far as the file has them.

use super::colors::{COLOR_BYTES, Colors};
use super::header::Header;
use super::{Counts, Number, Source};
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::raw::RawMesh;

/// Vertices between two deadline checks.
const VERTICES_PER_POLL: u32 = 65_536;

/// Reads the vertices into `raw`. Their count was checked against the length of the file.
pub fn read(
    source: &mut impl Source,
    header: &Header,
    counts: Counts,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<(), MeshError> {
    let count = counts.vertices as usize;
    let room = |is_there: bool| if is_there { count } else { 0 };
    cx.budget.spend("the OFF vertices", count as u64, 24)?;
    cx.budget.spend("the normals of OFF vertices", room(header.has_normals) as u64, 12)?;
    cx.budget.spend("the texture coordinates of OFF vertices", room(header.has_uvs) as u64, 8)?;
    raw.positions.reserve_exact(count);
    raw.normals.reserve_exact(room(header.has_normals));
    raw.uvs.reserve_exact(room(header.has_uvs));
    let mut colors = None;
    let mut numbers = Vec::new();
    for i in 0..counts.vertices {
        if i % VERTICES_PER_POLL == 0 {
            cx.deadline.check()?;
        }
        numbers.clear();
        source.vertex(header, &mut numbers)?;
        let color = color(header, &numbers).map_err(|what| source.broken(&what))?;
        let value = |at: usize| numbers[at].value;
        raw.positions.push([value(0), value(1), value(2)]);
        if header.has_normals {
            let at = if header.colors_first { numbers.len() - header.after_color() } else { 3 };
            raw.normals.push([value(at) as f32, value(at + 1) as f32, value(at + 2) as f32]);
        }
        if header.has_uvs {
            // In the file v runs up, in a mesh down.
            let [u, v] = [2, 1].map(|from_end| value(numbers.len() - from_end));
            raw.uvs.push([u as f32, (1.0 - v) as f32]);
        }
        // Some files have colours on a few lines only, without C in the keyword.
        if !color.is_empty() && colors.is_none() {
            cx.budget.spend("the colours of OFF vertices", count as u64, 16 + COLOR_BYTES)?;
            let all = colors.insert(Colors::default());
            all.reserve(count);
            (0..i).for_each(|_| all.push_white());
        }
        if let Some(colors) = &mut colors {
            colors.push(color);
        }
    }
    raw.colors = colors.map_or_else(Vec::new, |colors| colors.linear().collect());
    Ok(())
}

/// The numbers of a vertex's colour: as many as the header declares, or three or four undeclared
/// ones.
fn color<'n>(header: &Header, numbers: &'n [Number]) -> Result<&'n [Number], String> {
    let color = &numbers[header.before_color()..numbers.len() - header.after_color()];
    let is_one = match color.len() {
        0 => !header.has_colors,
        3 | 4 => true,
        _ => false,
    };
    if is_one {
        return Ok(color);
    }
    let needed = header.numbers_min();
    let more = if header.has_colors { ", or one more for alpha" } else { "" };
    Err(format!("a vertex has {needed} numbers{more}, and here are {}", numbers.len()))
}
