//! Puts the parts of an OBJ text together to a raw mesh.

mod faces;
mod names;
mod vertices;

pub use names::Names;

use rapidhash::RapidHashSet;

use super::parse::Part;
use super::skipped::Skipped;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::parallel::concat;
use crate::import::raw::RawMesh;

/// Bytes of a library beside its name: in lists and sets that double as they grow.
const LIBRARY_BYTES: u64 = 160;

/// Names and counts of a text, beside its mesh.
#[derive(Debug, Default)]
pub struct Summary {
    /// `usemtl` names, in order of first use. A triangle's material is 1 more, or 0 without one.
    pub materials: Vec<Vec<u8>>,
    /// Arguments of `mtllib` lines, each once.
    pub libraries: Vec<Vec<u8>>,
    /// Counts of skipped lines.
    pub skipped: Skipped,
}

/// The lists of a text, whole.
#[derive(Debug, Default)]
struct Lists {
    positions: Vec<[f64; 3]>,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
}

/// Fills in vertices and triangles.
pub fn assemble(mut parts: Vec<Part<'_>>, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<Summary, MeshError> {
    check_indices(&parts)?;
    cx.check_triangles(parts.iter().map(|part| part.triangles).sum())?;
    let mut summary = Summary::default();
    parts.iter().for_each(|part| summary.skipped.add(&part.skipped));
    summary.libraries = libraries_of(&parts, cx)?;
    let names = Names::of(&parts, cx)?;
    let lists = Lists {
        positions: concat(parts.iter_mut().map(|part| std::mem::take(&mut part.positions)).collect()),
        colors: concat(parts.iter_mut().map(|part| std::mem::take(&mut part.colors)).collect()),
        uvs: concat(parts.iter_mut().map(|part| std::mem::take(&mut part.uvs)).collect()),
        normals: concat(parts.iter_mut().map(|part| std::mem::take(&mut part.normals)).collect()),
    };
    cx.deadline.check()?;
    raw.report.file_vertices = lists.positions.len() as u64;
    vertices::fill(&mut parts, &names, lists, raw, cx)?;
    faces::fill(&parts, &names, raw, cx)?;
    summary.materials = names.all;
    Ok(summary)
}

/// The distinct arguments of `mtllib` lines, in the text's order.
fn libraries_of(parts: &[Part<'_>], cx: &mut Context<'_>) -> Result<Vec<Vec<u8>>, MeshError> {
    let mut seen = RapidHashSet::default();
    let mut libraries = Vec::new();
    for part in parts {
        cx.deadline.check()?;
        for line in part.libraries.iter().map(AsRef::as_ref) {
            if !seen.contains(line) {
                cx.budget.spend("the OBJ file's libraries", 1, LIBRARY_BYTES + 2 * line.len() as u64)?;
                seen.insert(line);
                libraries.push(line.to_vec());
            }
        }
    }
    Ok(libraries)
}

/// Refuses indices beyond what the text has. Without any texture coordinates or normals, indices
/// of them mean nothing.
fn check_indices(parts: &[Part<'_>]) -> Result<(), MeshError> {
    let mut lines_before = 0;
    let mut largest = [(0, 0); 3];
    let mut counts = [0_u64; 3];
    for part in parts {
        for (all, own) in largest.iter_mut().zip(part.largest) {
            if own.0 > all.0 {
                *all = (own.0, lines_before + own.1);
            }
        }
        lines_before += part.lines;
        let own = [part.positions.len(), part.uvs.len(), part.normals.len()];
        counts = std::array::from_fn(|k| counts[k] + own[k] as u64);
    }
    if counts.iter().any(|count| *count >= u64::from(u32::MAX)) {
        return Err(MeshError::broken("the OBJ file has more than 4 billion vertices"));
    }
    for (k, what) in ["vertex", "texture coordinate", "normal"].into_iter().enumerate() {
        let ((index, line), count) = (largest[k], counts[k]);
        if index > count && (k == 0 || count > 0) {
            let detail =
                format!("line {line} of the OBJ file: the {what} index {index} is out of range: there are {count}");
            return Err(MeshError::broken(detail));
        }
    }
    Ok(())
}
