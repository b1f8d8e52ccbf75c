//! The normal form of meshes: turns a [`RawMesh`], which is as the file has it, into a [`Mesh`].
//! Positions in f64 become f32 in a box whose sides are at most 1, triangles with a NaN, an
//! infinity or no area are dropped, and equal positions are welded (made one).
//!
//! Positions are scaled to that box by powers of two alone. This rounds nothing, so a file scaled
//! by a power of two gives the same mesh in that box.

pub(crate) mod attributes;
mod faces;
mod geometry;
mod hasher;
mod local;
mod number;
pub(crate) mod pow2;
pub(crate) mod precision;
#[cfg(test)]
mod tests;
mod weld;
use self::attributes::Attributes;
use self::faces::{Bounds, Faces};
use self::geometry::{Geometry, Indexed};
use self::number::{Numbered, is_collapsed, number};
use self::pow2::{Pow2, exponent, is_usable, max_abs};
use super::raw::RawMesh;
use super::{ImportReport, MeshError, MeshFault};
use crate::import::context::Context;
use crate::limits::Stopped;
use crate::mesh::vector::sub;
use crate::mesh::{LineOrPoint, MaterialSlot, Mesh, ToFile, primitives};
use crate::parallel::{map, map_items};
use crate::pluralise::pluralise;

/// Brings an imported mesh into its normal form.
pub fn normalise(mut raw: RawMesh, cx: &mut Context<'_>) -> Result<(Mesh, ImportReport), MeshError> {
    let mut soup = raw.soup.take();
    let [triangle_count, vertex_count] = match &soup {
        Some(soup) => [soup.triangles(), 3 * soup.triangles()],
        None => [raw.triangles.len(), raw.positions.len()],
    };
    cx.check_triangles(triangle_count as u64 + primitives::triangles(&raw.lines_and_points))?;
    cx.budget.spend("the triangles", triangle_count as u64, BYTES_PER_TRIANGLE)?;
    cx.budget.spend("lines and points", raw.lines_and_points.len() as u64, BYTES_PER_LINE_OR_POINT)?;
    if vertex_count > VERTICES_MAX {
        return Err(MeshError::new(MeshFault::Unsupported, "the mesh has more than a billion corners or vertices"));
    }
    cx.budget.spend("the welded vertices", vertex_count as u64, number::BYTES_PER_VERTEX)?;

    if soup.is_none() && raw.report.loose_vertices.is_none() {
        let of_lines = raw.lines_and_points.iter().flat_map(|one| one.ends);
        let used = raw.triangles.iter().flatten().copied().chain(of_lines);
        raw.report.loose_vertices = cx.loose(raw.positions.len(), used)?;
    }
    let has_attributes = raw.has_attributes();
    let (mut mesh, kept, triangles) = match &mut soup {
        Some(soup) => {
            let (mesh, kept) = shape(soup, None, &mut raw, cx)?;
            (mesh, kept, Vec::new())
        }
        None => {
            let (positions, triangles) = (std::mem::take(&mut raw.positions), std::mem::take(&mut raw.triangles));
            let survey = faces::survey(&positions, cx.deadline)?;
            let mut indexed = Indexed { positions, triangles, is_usable: survey.is_usable };
            // All vertices are likely used. If their largest decides, the faces are picked once.
            let guess = (!survey.is_f32).then(|| scale_exponent(survey.largest));
            let (mesh, kept) = shape(&mut indexed, guess, &mut raw, cx)?;
            (mesh, kept, indexed.triangles)
        }
    };
    if has_attributes {
        let of_soup = |triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2];
        mesh.attribute_triangles = match (&soup, &kept) {
            (None, None) => triangles,
            (None, Some(kept)) => map_items(kept, |&triangle| triangles[triangle as usize]),
            (Some(soup), None) => (0..soup.triangles() as u32).map(of_soup).collect(),
            (Some(_), Some(kept)) => map_items(kept, |&triangle| of_soup(triangle)),
        };
    }
    mesh.edge_masks = pick(std::mem::take(&mut raw.edge_masks), kept.as_deref());
    mesh.triangle_materials = pick(std::mem::take(&mut raw.triangle_materials), kept.as_deref());
    cx.deadline.check()?;
    let Attributes { normals, uvs, second_uvs, colors } = attributes::repair(&mut raw, vertex_count, &mesh);
    if normals.is_empty() && uvs.is_empty() && second_uvs.is_empty() && colors.is_empty() {
        (mesh.attribute_triangles, mesh.line_point_attributes) = (Vec::new(), Vec::new());
    }
    (mesh.normals, mesh.uvs, mesh.second_uvs, mesh.colors) = (normals, uvs, second_uvs, colors);
    mesh.materials = raw.materials;
    let largest = |piece: &[u32]| piece.iter().copied().fold(0, u32::max);
    let of_triangles = map(mesh.triangle_materials.chunks(POSITIONS_PER_PIECE).collect(), largest).into_iter().max();
    let of_lines_and_points = mesh.lines_and_points.iter().map(|one| one.material).max();
    let slots = of_triangles.max(of_lines_and_points).unwrap_or(0) as usize + 1;
    while mesh.materials.len() < slots {
        mesh.materials.push(MaterialSlot::default());
    }
    (mesh.images, mesh.cameras) = (raw.images, raw.cameras);
    mesh.up = raw.up;
    Ok((mesh, raw.report))
}

/// Positions, triangles, normals, lines and bounds of the mesh, and the triangle of each face
/// unless all triangles are faces. `guess` is the likely exponent of the power of two that positions
/// are divided by, None if f32 has them all.
fn shape<G: Geometry>(
    geometry: &mut G,
    guess: Option<i32>,
    raw: &mut RawMesh,
    cx: &Context<'_>,
) -> Result<(Mesh, Option<Vec<u32>>), MeshError> {
    let mut faces = faces::pick(geometry, guess.map(|exponent| Pow2::new(-exponent)), cx.deadline)?;
    if raw.is_f32 && (guess.is_none() || faces::have_f32(geometry, cx.deadline)?) {
        raw.report.warnings.extend(precision::warning(&faces.usable));
    }
    let vertices = geometry.indexed().map(|indexed| indexed.positions.as_slice()).unwrap_or_default();
    let vertex = |v: u32| vertices.get(v as usize).copied().unwrap_or([f64::NAN; 3]);
    raw.report.dropped_lines_and_points = drop_bad(vertex, &mut raw.lines_and_points);
    let of_lines = raw.lines_and_points.iter().flat_map(|one| one.ends).map(vertex);
    let around_lines = of_lines.fold(Bounds::EMPTY, Bounds::with);
    // The largest magnitude becomes about 1. After that no relevant product over- or underflows.
    let file_exponent = scale_exponent(faces.usable.union(around_lines).largest());
    let down = Pow2::new(-file_exponent);
    if guess.is_some_and(|guess| guess != file_exponent) {
        faces = faces::pick(geometry, Some(down), cx.deadline)?;
    }
    raw.report.dropped_nonfinite_faces = faces.nonfinite;
    raw.report.dropped_degenerate_faces = faces.degenerate;
    raw.report.degenerate_places = faces::degenerate(geometry, &faces, DEGENERATE_PLACES_MAX);
    if faces.normals.is_empty() && raw.lines_and_points.is_empty() {
        return Err(empty(&raw.report));
    }
    let unit_box = UnitBox::around(faces.bounds.union(around_lines).scaled(down));
    let (mut mesh, kept) = weld(geometry, faces, down, &unit_box, raw, cx)?;
    if mesh.triangles.is_empty() && mesh.lines_and_points.is_empty() {
        return Err(empty(&raw.report));
    }
    mesh.bounds = bounds(&mesh.positions);
    mesh.to_file = unit_box.to_file(file_exponent);
    Ok((mesh, kept))
}

/// The exponent of the power of two that positions up to `largest` are divided by.
fn scale_exponent(largest: f64) -> i32 {
    if largest > 0.0 && largest.is_finite() { exponent(largest) } else { 0 }
}

/// The items of the kept triangles.
fn pick<T: Copy + Send + Sync>(all: Vec<T>, kept: Option<&[u32]>) -> Vec<T> {
    match kept {
        None => all,
        Some(kept) => map_items(kept, |&triangle| all[triangle as usize]),
    }
}

/// Positions handed to a thread at a time.
const POSITIONS_PER_PIECE: usize = 65_536;
/// Most faces without area whose corners are kept for reports.
const DEGENERATE_PLACES_MAX: usize = 20;
/// Most vertices, or corners of triangles that share none. Welding marks numbers with a bit.
const VERTICES_MAX: usize = 1 << 30;
/// Memory beside the raw mesh: a triangle's normal, its distinct corners in its piece, its number
/// among all and among those that are left, two index triples, a mask and a material.
const BYTES_PER_TRIANGLE: u64 = 12 + 12 + 4 + 8 + 12 + 12 + 1 + 4;
/// Two index pairs and a material.
const BYTES_PER_LINE_OR_POINT: u64 = 8 + 8 + 4;
/// The map from (scaled) file space to the unit box.
struct UnitBox {
    centre: [f64; 3],
    exponent: i32,
    down: Pow2,
}

impl UnitBox {
    fn around(Bounds { low, high }: Bounds) -> Self {
        let size = max_abs(&sub(high, low));
        // A single point has no size.
        let exponent = if size > 0.0 { exponent(size) } else { 0 };
        Self { centre: std::array::from_fn(|k| low[k] * 0.5 + high[k] * 0.5), exponent, down: Pow2::new(-exponent) }
    }

    #[inline(always)]
    fn to_unit(&self, p: [f64; 3]) -> [f32; 3] {
        let [x, y, z] = self.down.of3(sub(p, self.centre));
        // No negative zero, so that equal positions have equal bits, and no subnormals, which some
        // GPUs flush.
        let tidy = |c: f32| if c.abs() < f32::MIN_POSITIVE { 0.0 } else { c };
        [tidy(x as f32), tidy(y as f32), tidy(z as f32)]
    }

    fn to_file(&self, file_exponent: i32) -> ToFile {
        ToFile {
            centre: Pow2::new(file_exponent).of3(self.centre),
            scale: Pow2::new(file_exponent).of(Pow2::new(self.exponent).of(1.0)),
        }
    }
}

/// Welds positions, numbered in the order of their first use. Drops triangles and segments whose
/// corners became equal.
fn weld<G: Geometry>(
    geometry: &mut G,
    mut faces: Faces<G::Key>,
    down: Pow2,
    unit_box: &UnitBox,
    raw: &mut RawMesh,
    cx: &Context<'_>,
) -> Result<(Mesh, Option<Vec<u32>>), Stopped> {
    let position = |p: [f64; 3]| unit_box.to_unit(down.of3(p));
    let ends = raw.lines_and_points.iter().map(|one| one.ends);
    let has_attributes = raw.has_attributes();
    let Numbered { positions, mut triangles, ends, collapsed } =
        number(geometry, &mut faces, ends, position, has_attributes, cx.deadline)?;
    raw.report.dropped_collapsed_faces = collapsed;
    if collapsed > 0 {
        let left: Vec<usize> = (0..triangles.len()).filter(|&face| !is_collapsed(&triangles[face])).collect();
        faces.kept = Some(left.iter().map(|&face| faces.triangle(face) as u32).collect());
        faces.normals = left.iter().map(|&face| faces.normals[face]).collect();
        triangles.retain(|triangle| !is_collapsed(triangle));
    }
    let mut mesh = Mesh { positions, triangles, face_normals: faces.normals, ..Mesh::default() };
    for (one, ends) in raw.lines_and_points.iter().zip(ends) {
        if ends[0] == ends[1] && !one.is_point() {
            raw.report.dropped_lines_and_points += 1;
            continue;
        }
        mesh.lines_and_points.push(LineOrPoint { ends, ..*one });
        if has_attributes {
            mesh.line_point_attributes.push(one.ends);
        }
    }
    if raw.report.dropped_collapsed_faces + raw.report.dropped_lines_and_points > 0 {
        drop_unused(&mut mesh);
    }
    Ok((mesh, faces.kept))
}

/// Removes positions that only dropped primitives used.
fn drop_unused(mesh: &mut Mesh) {
    const UNSEEN: u32 = u32::MAX;
    let mut new_of_old = vec![UNSEEN; mesh.positions.len()];
    let mut positions = Vec::with_capacity(mesh.positions.len());
    let of_lines_and_points = mesh.lines_and_points.iter_mut().flat_map(|one| &mut one.ends);
    for v in mesh.triangles.iter_mut().flatten().chain(of_lines_and_points) {
        let new = &mut new_of_old[*v as usize];
        if *new == UNSEEN {
            *new = positions.len() as u32;
            positions.push(mesh.positions[*v as usize]);
        }
        *v = *new;
    }
    mesh.positions = positions;
}

fn bounds(positions: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let empty = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let with = |[low, high]: [[f32; 3]; 2], [l, h]: [&[f32; 3]; 2]| {
        [std::array::from_fn(|k| low[k].min(l[k])), std::array::from_fn(|k| high[k].max(h[k]))]
    };
    let around = |piece: &[[f32; 3]]| piece.iter().fold(empty, |bounds, p| with(bounds, [p, p]));
    let pieces = map(positions.chunks(POSITIONS_PER_PIECE).collect(), around);
    pieces.iter().fold(empty, |bounds, [low, high]| with(bounds, [low, high]))
}

fn empty(report: &ImportReport) -> MeshError {
    let faces: u64 = report.polygons_by_arity.iter().sum();
    let (nonfinite, degenerate) = (report.dropped_nonfinite_faces, report.dropped_degenerate_faces);
    let collapsed = report.dropped_collapsed_faces;
    let (vertices, faces) = (pluralise(report.file_vertices, "vertex", "vertices"), pluralise(faces, "face", "faces"));
    let mut detail = format!("the {} file has nothing to draw: {vertices} and {faces}", report.format);
    if nonfinite + degenerate + collapsed > 0 {
        let has = |count| pluralise(count, "has", "have");
        let (nonfinite, degenerate) = (has(nonfinite), has(degenerate));
        detail += &format!(", of whose triangles {nonfinite} a NaN or infinite corner and {degenerate} no area");
    }
    if collapsed > 0 {
        let are = pluralise(collapsed, "is", "are");
        detail += &format!("; {are} thinner than 24 bits can tell beside the size of the whole");
    }
    for warning in &report.warnings {
        detail += "; ";
        detail += &warning.detail;
    }
    MeshError::new(MeshFault::Empty, detail)
}

/// Drops lines and points with an unusable end, and segments without a length. Returns their
/// number.
fn drop_bad(vertex: impl Fn(u32) -> [f64; 3], lines_and_points: &mut Vec<LineOrPoint>) -> u64 {
    let before = lines_and_points.len();
    lines_and_points.retain(|one| {
        let [a, b] = one.ends.map(&vertex);
        is_usable(&a) && is_usable(&b) && (one.is_point() || a != b)
    });
    (before - lines_and_points.len()) as u64
}
