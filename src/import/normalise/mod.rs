//! Turns a [`RawMesh`] into a [`Mesh`]: conversion from f64, the policy on NaN, and welding.
//!
//! Everything up to the unit box scales by powers of two alone, so that a file scaled by a power of
//! two gives the same mesh.

pub(crate) mod attributes;
pub(crate) mod pow2;
pub(crate) mod precision;
pub(crate) mod weld;
use self::attributes::Attributes;
use self::pow2::{Pow2, exponent, is_usable, max_abs};
use self::weld::PositionSet;
use super::raw::RawMesh;
use super::{ImportReport, Imported, MeshError, MeshFault};
use crate::import::context::Context;
use crate::mesh::vector::{cross, dot, sub};
use crate::mesh::{LineOrPoint, MaterialSlot, Mesh, ToFile, primitives};
use crate::pluralise::pluralise;

/// Brings an imported mesh into its normal form.
pub fn normalise(mut raw: RawMesh, cx: &mut Context<'_>) -> Result<Imported, MeshError> {
    cx.check_triangles(raw.triangles.len() as u64 + primitives::triangles(&raw.lines_and_points))?;
    cx.budget.spend("the triangles", raw.triangles.len() as u64, BYTES_PER_TRIANGLE)?;
    cx.budget.spend("lines and points", raw.lines_and_points.len() as u64, BYTES_PER_LINE_OR_POINT)?;
    cx.budget.spend("the welded vertices", raw.positions.len() as u64, BYTES_PER_VERTEX)?;

    raw.report.warnings.extend(precision::warning(&raw));
    cx.deadline.check()?;
    raw.report.dropped_lines_and_points = drop_bad(&mut raw);
    let file_exponent = scale_down(&mut raw);
    let faces = pick_faces(&mut raw);
    cx.deadline.check()?;
    if faces.is_empty() && raw.lines_and_points.is_empty() {
        return Err(empty(&raw.report));
    }
    let unit_box = UnitBox::around(&raw, &faces);
    let mut mesh = weld(&mut raw, &faces, &unit_box);
    cx.deadline.check()?;
    if mesh.triangles.is_empty() && mesh.lines_and_points.is_empty() {
        return Err(empty(&raw.report));
    }
    mesh.bounds = bounds(&mesh.positions);
    mesh.to_file = unit_box.to_file(file_exponent);
    let Attributes { normals, uvs, colors } = attributes::repair(&mut raw, &mesh);
    if normals.is_empty() && uvs.is_empty() && colors.is_empty() {
        (mesh.attribute_triangles, mesh.line_point_attributes) = (Vec::new(), Vec::new());
    }
    (mesh.normals, mesh.uvs, mesh.colors) = (normals, uvs, colors);
    mesh.materials = raw.materials;
    let of_lines_and_points = mesh.lines_and_points.iter().map(|one| one.material);
    let slots = mesh.triangle_materials.iter().copied().chain(of_lines_and_points).max().unwrap_or(0) as usize + 1;
    while mesh.materials.len() < slots {
        mesh.materials.push(MaterialSlot::default());
    }
    (mesh.images, mesh.cameras) = (raw.images, raw.cameras);
    mesh.up = raw.up;
    Ok(Imported { mesh, report: raw.report })
}

/// Memory beside the raw mesh: a face, its normal, two index triples, a mask and a material.
const BYTES_PER_TRIANGLE: u64 = 20 + 12 + 12 + 12 + 1 + 4;
/// Two index pairs and a material.
const BYTES_PER_LINE_OR_POINT: u64 = 8 + 8 + 4;
/// A welded position, its place in the raw mesh's map, and its slots in the set as that grows.
const BYTES_PER_VERTEX: u64 = 12 + 4 + 16;

/// A face that will be drawn: its place in the raw mesh and its unit normal.
struct Face {
    triangle: u32,
    normal: [f32; 3],
}

/// Scales all positions so that the largest used magnitude is about 1, and returns the exponent.
/// After this no relevant product over- or underflows.
fn scale_down(raw: &mut RawMesh) -> i32 {
    let mut largest = 0.0_f64;
    for triangle in &raw.triangles {
        let corners = triangle.map(|v| &raw.positions[v as usize]);
        if corners.iter().all(|p| is_usable(p)) {
            largest = corners.iter().fold(largest, |m, p| m.max(max_abs(p)));
        }
    }
    for v in raw.lines_and_points.iter().flat_map(|one| one.ends) {
        largest = largest.max(max_abs(&raw.positions[v as usize]));
    }
    if largest == 0.0 {
        return 0;
    }
    let e = exponent(largest);
    let down = Pow2::new(-e);
    for p in &mut raw.positions {
        // Unusable positions must stay recognisable.
        *p = if is_usable(p) { down.of3(*p) } else { [f64::NAN; 3] };
    }
    e
}

/// The faces that have an area. Counts the others.
fn pick_faces(raw: &mut RawMesh) -> Vec<Face> {
    let mut faces = Vec::with_capacity(raw.triangles.len());
    for (i, triangle) in (0..).zip(&raw.triangles) {
        let corners = triangle.map(|v| raw.positions[v as usize]);
        if !corners.iter().all(is_usable) {
            raw.report.dropped_nonfinite_faces += 1;
        } else if let Some(normal) = face_normal(corners) {
            faces.push(Face { triangle: i, normal: normal.map(|c| c as f32) });
        } else {
            raw.report.dropped_degenerate_faces += 1;
        }
    }
    faces
}

/// The unit normal, or none if the area is exactly zero. Good for edges of any length.
fn face_normal([a, b, c]: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let (e, f) = (sub(b, a), sub(c, a));
    let n = cross(e, f);
    let length2 = dot(n, n);
    if length2 > 1e-200 {
        return Some(n.map(|x| x / length2.sqrt()));
    }
    // Tiny edges or a sliver: products may have underflowed.
    let (e, f) = (rescale(e)?, rescale(f)?);
    let n = rescale(cross(e, f))?;
    let length = dot(n, n).sqrt();
    Some(n.map(|x| x / length))
}

fn rescale(v: [f64; 3]) -> Option<[f64; 3]> {
    let size = max_abs(&v);
    (size > 0.0).then(|| Pow2::new(-exponent(size)).of3(v))
}

/// The map from (scaled) file space to the unit box.
struct UnitBox {
    centre: [f64; 3],
    exponent: i32,
    down: Pow2,
}

impl UnitBox {
    fn around(raw: &RawMesh, faces: &[Face]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let of_faces = faces.iter().flat_map(|face| raw.triangles[face.triangle as usize]);
        for v in of_faces.chain(raw.lines_and_points.iter().flat_map(|one| one.ends)) {
            let p = raw.positions[v as usize];
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let size = max_abs(&sub(high, low));
        // A single point has no size.
        let exponent = if size > 0.0 { exponent(size) } else { 0 };
        Self { centre: std::array::from_fn(|k| low[k] * 0.5 + high[k] * 0.5), exponent, down: Pow2::new(-exponent) }
    }

    fn to_unit(&self, p: [f64; 3]) -> [f32; 3] {
        self.down.of3(sub(p, self.centre)).map(|c| {
            let c = c as f32;
            // No negative zero, so that equal positions have equal bits, and no subnormals, which
            // some GPUs flush.
            if c.abs() < f32::MIN_POSITIVE { 0.0 } else { c }
        })
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
fn weld(raw: &mut RawMesh, faces: &[Face], unit_box: &UnitBox) -> Mesh {
    const UNSEEN: u32 = u32::MAX;
    let mut mesh = Mesh::default();
    let mut welded_of_raw = vec![UNSEEN; raw.positions.len()];
    // A closed mesh has half as many vertices as triangles.
    let mut set = PositionSet::with_capacity(raw.positions.len().min(faces.len() / 2 + 2));
    reserve(&mut mesh, faces.len());
    let has_attributes = !(raw.normals.is_empty() && raw.uvs.is_empty() && raw.colors.is_empty());
    let mut welded = |v: u32| {
        let known = &mut welded_of_raw[v as usize];
        if *known == UNSEEN {
            *known = set.number(unit_box.to_unit(raw.positions[v as usize]));
        }
        *known
    };
    for face in faces {
        let i = face.triangle as usize;
        let corners = raw.triangles[i].map(&mut welded);
        if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
            raw.report.dropped_collapsed_faces += 1;
            continue;
        }
        mesh.triangles.push(corners);
        mesh.face_normals.push(face.normal);
        mesh.edge_masks.push(raw.edge_masks[i]);
        mesh.triangle_materials.push(raw.triangle_materials[i]);
        if has_attributes {
            mesh.attribute_triangles.push(raw.triangles[i]);
        }
    }
    for one in &raw.lines_and_points {
        let ends = one.ends.map(&mut welded);
        if ends[0] == ends[1] && !one.is_point() {
            raw.report.dropped_lines_and_points += 1;
            continue;
        }
        mesh.lines_and_points.push(LineOrPoint { ends, ..*one });
        if has_attributes {
            mesh.line_point_attributes.push(one.ends);
        }
    }
    mesh.positions = set.positions;
    if raw.report.dropped_collapsed_faces + raw.report.dropped_lines_and_points > 0 {
        drop_unused(&mut mesh);
    }
    mesh
}

fn reserve(mesh: &mut Mesh, faces: usize) {
    mesh.triangles.reserve_exact(faces);
    mesh.face_normals.reserve_exact(faces);
    mesh.edge_masks.reserve_exact(faces);
    mesh.triangle_materials.reserve_exact(faces);
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
    positions.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], p| {
        [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
    })
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
fn drop_bad(raw: &mut RawMesh) -> u64 {
    let before = raw.lines_and_points.len();
    let positions = &raw.positions;
    raw.lines_and_points.retain(|one| {
        let [a, b] = one.ends.map(|v| &positions[v as usize]);
        is_usable(a) && is_usable(b) && (one.is_point() || a != b)
    });
    (before - raw.lines_and_points.len()) as u64
}
