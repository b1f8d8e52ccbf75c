//! The geometry of an FBX scene. A mesh is added once for each visible node that shows it, with the
//! transform of that node applied. Line objects are added in the same way.

use super::visibility::{Visibilities, Visibility};
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::corners::{CornerSet, Polygons};
use crate::import::raw::RawMesh;
use crate::import::report::counted_warnings;
use crate::mesh::LineOrPoint;
use crate::mesh::primitives::{POINT_TRIANGLES, SEGMENT_TRIANGLES};
use crate::srgb::srgb_to_linear;
use rapidhash::RapidHashMap;
use ufbx::{Matrix, Mesh, Node, Scene};

/// Bytes per vertex in a raw mesh.
const VERTEX_BYTES: u64 = 24 + 12 + 8 + 16;

/// Rotation matrices are rounded to this fraction of a unit: finer than positions show, coarser
/// than the differences between the sines of different machines. Quarter turns become exact.
const STEPS: f64 = (1_u64 << 44) as f64;

/// The materials of triangles, by their ids in the file.
#[derive(Debug, Default)]
pub struct Used {
    /// `typed_id` of each slot's material. None for faces without a material.
    pub materials: Vec<Option<u32>>,
    slots: RapidHashMap<Option<u32>, u32>,
}

impl Used {
    fn slot(&mut self, material: Option<u32>) -> u32 {
        let next = self.materials.len() as u32;
        let slot = *self.slots.entry(material).or_insert(next);
        if slot == next {
            self.materials.push(material);
        }
        slot
    }
}

/// Fills in the geometry and returns its materials.
pub fn read(scene: &Scene, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<Used, MeshError> {
    let mut used = Used::default();
    let visibilities = Visibilities::of(scene, cx)?;
    let shown = |node: &&Node| node.mesh.is_some() && visibilities.at(node) == Visibility::Shown;
    let count = |visibility: Visibility| {
        scene.nodes.into_iter().filter(|node| node.mesh.is_some() && visibilities.at(node) == visibility).count()
    };
    // All instances are counted before the first is added.
    let of_node = |node: &Node| node.mesh.as_ref().map_or(0, |mesh| triangles_of(mesh));
    let triangles = scene.nodes.into_iter().filter(shown).map(of_node).fold(0, u64::saturating_add);
    cx.check_triangles(triangles)?;
    let mut part = Part::default();
    for node in scene.nodes.into_iter().filter(shown) {
        cx.deadline.check()?;
        if let Some(mesh) = &node.mesh {
            part.read(mesh, node, &mut used, raw, cx)?;
        }
    }
    part.polygons.finish(raw, cx)?;
    curves(scene, &visibilities, &mut used, raw, cx)?;
    let notes = [
        (
            count(Visibility::Hidden) as u64,
            "hidden_ignored",
            "meshes that the file hides are not drawn (meshes in the file:",
        ),
        (
            count(Visibility::OtherDetailLevel) as u64,
            "levels_ignored",
            "of a mesh in several levels of detail the first is drawn (meshes of other levels in the file:",
        ),
        (part.short_faces, "short_faces_ignored", "faces without corners are not drawn (faces in the file:"),
    ];
    raw.report.warnings.extend(counted_warnings(notes));
    Ok(used)
}

fn triangles_of(mesh: &Mesh) -> u64 {
    let (lines, points) = (mesh.num_line_faces as u64, mesh.num_point_faces as u64);
    mesh.num_triangles as u64 + lines * SEGMENT_TRIANGLES + points * POINT_TRIANGLES
}

#[derive(Default)]
struct Part {
    polygons: Polygons,
    set: CornerSet,
    corners: Vec<u32>,
    short_faces: u64,
}

impl Part {
    fn read(
        &mut self,
        mesh: &Mesh,
        node: &Node,
        used: &mut Used,
        raw: &mut RawMesh,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let place = Placement::of(&node.geometry_to_world);
        let attributes = Attributes::of(mesh);
        raw.report.file_vertices += mesh.vertices.len() as u64;
        raw.report.add_loose(cx.loose(mesh.vertices.len(), mesh.vertex_position.indices.iter().copied())?);
        self.set.clear();
        attributes.begin(raw, cx)?;
        for (number, face) in mesh.faces.iter().enumerate() {
            let (begin, count) = (face.index_begin as usize, face.num_indices as usize);
            // The library returns points and lines as faces.
            if count == 0 {
                self.short_faces += 1;
                continue;
            }
            self.polygons.pay(count.max(3), cx)?;
            self.set.pay(count, VERTEX_BYTES, cx)?;
            self.corners.clear();
            for index in begin..begin.saturating_add(count) {
                let key = attributes.key(index).ok_or_else(|| broken(mesh, number))?;
                let (vertex, is_new) = self.set.vertex(key, raw.positions.len());
                if is_new {
                    attributes.push(key, &place, raw).ok_or_else(|| broken(mesh, number))?;
                }
                self.corners.push(vertex);
            }
            let material = mesh.face_material.get(number).and_then(|&slot| material(mesh, node, slot));
            let material = used.slot(material);
            if let [a] | [a, _] = self.corners[..] {
                raw.lines_and_points.push(LineOrPoint { ends: [a, self.corners[count - 1]], material });
                continue;
            }
            if place.is_mirroring {
                self.corners.reverse();
            }
            self.polygons.add(raw, &self.corners, material);
        }
        self.set.pay_all(VERTEX_BYTES, cx)?;
        complete(raw);
        Ok(())
    }
}

/// Line objects, which belong to no mesh, at each node that refers to them.
fn curves(
    scene: &Scene,
    visibilities: &Visibilities,
    used: &mut Used,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<(), MeshError> {
    for curve in &scene.line_curves {
        for node in curve.element.instances.into_iter().filter(|node| visibilities.at(node) == Visibility::Shown) {
            cx.deadline.check()?;
            let place = Placement::of(&node.geometry_to_world);
            let base = raw.positions.len();
            let (points, indices) = (curve.control_points.len(), curve.point_indices.len());
            let lines = (raw.lines_and_points.len() + indices) as u64;
            cx.check_triangles((raw.triangles.len() as u64).saturating_add(lines * SEGMENT_TRIANGLES))?;
            cx.budget.spend("the lines of the FBX file", points as u64, 2 * VERTEX_BYTES)?;
            cx.budget.spend("the lines of the FBX file", indices as u64, 2 * size_of::<LineOrPoint>() as u64)?;
            raw.report.file_vertices += points as u64;
            raw.positions.extend(curve.control_points.iter().map(|p| place.points.point([p.x, p.y, p.z])));
            let material = used.slot(None);
            for segment in curve.segments.iter() {
                let begin = segment.index_begin as usize;
                let segment = begin.checked_add(segment.num_indices as usize);
                let Some(own) = segment.and_then(|end| curve.point_indices.get(begin..end)) else { continue };
                let is_there = |pair: &&[u32]| pair[0] != pair[1] && pair.iter().all(|&v| (v as usize) < points);
                let ends = own.windows(2).filter(is_there).map(|pair| [pair[0], pair[1]].map(|v| v + base as u32));
                raw.lines_and_points.extend(ends.map(|ends| LineOrPoint { ends, material }));
            }
        }
    }
    complete(raw);
    Ok(())
}

/// Fills up attributes that only some meshes have.
fn complete(raw: &mut RawMesh) {
    let count = raw.positions.len();
    if !raw.normals.is_empty() {
        raw.normals.resize(count, [0.0; 3]);
    }
    if !raw.uvs.is_empty() {
        raw.uvs.resize(count, [0.0; 2]);
    }
    if !raw.colors.is_empty() {
        raw.colors.resize(count, [1.0; 4]);
    }
}

/// Each node may assign other materials to the same mesh.
fn material(mesh: &Mesh, node: &Node, slot: u32) -> Option<u32> {
    let materials = if node.materials.is_empty() { &mesh.materials } else { &node.materials };
    materials.get(slot as usize).map(|material| material.element.typed_id)
}

fn broken(mesh: &Mesh, face: usize) -> MeshError {
    let name: String = mesh.element.name.chars().take(60).collect();
    MeshError::broken(format!("face {face} of the FBX mesh \"{name}\" refers to a vertex that is not there"))
}

/// The matrix that puts a mesh into the scene, for points and for normals.
struct Placement {
    points: Affine,
    normals: [[f64; 3]; 3],
    is_mirroring: bool,
}

impl Placement {
    fn of(m: &Matrix) -> Self {
        let rows = [[m.m00, m.m01, m.m02], [m.m10, m.m11, m.m12], [m.m20, m.m21, m.m22]];
        let points = Affine { linear: rounded(rows), translation: [m.m03, m.m13, m.m23] };
        Self { normals: points.normal_matrix(), is_mirroring: points.is_mirroring(), points }
    }
}

fn rounded(rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let largest = rows.iter().flatten().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    if !(largest.is_normal() && largest < 1e100 && largest > 1e-100) {
        return rows;
    }
    // Scaled by a power of two near the largest entry, which itself rounds nothing.
    let unit = f64::from_bits(largest.to_bits() & 0x7FF0_0000_0000_0000);
    rows.map(|row| row.map(|v| (v / unit * STEPS).round_ties_even() / STEPS * unit + 0.0))
}

/// The attributes of a mesh, each with its own indices.
struct Attributes<'a> {
    mesh: &'a Mesh,
    has_normals: bool,
    has_uvs: bool,
    has_colors: bool,
}

impl<'a> Attributes<'a> {
    fn of(mesh: &'a Mesh) -> Self {
        let (has_normals, has_uvs) = (mesh.vertex_normal.exists, mesh.vertex_uv.exists);
        Self { mesh, has_normals, has_uvs, has_colors: mesh.vertex_color.exists }
    }

    /// The indices of a corner.
    fn key(&self, index: usize) -> Option<[u32; 4]> {
        let of = |has: bool, indices: &[u32]| if has { indices.get(index).copied() } else { Some(0) };
        Some([
            *self.mesh.vertex_position.indices.get(index)?,
            of(self.has_normals, &self.mesh.vertex_normal.indices)?,
            of(self.has_uvs, &self.mesh.vertex_uv.indices)?,
            of(self.has_colors, &self.mesh.vertex_color.indices)?,
        ])
    }

    /// Fills up, for the vertices so far, attributes that only this mesh has.
    fn begin(&self, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.budget.spend("the vertices of the file", raw.positions.len() as u64, self.missing_bytes(raw))?;
        let count = raw.positions.len();
        if self.has_normals {
            raw.normals.resize(count, [0.0; 3]);
        }
        if self.has_uvs {
            raw.uvs.resize(count, [0.0; 2]);
        }
        if self.has_colors {
            raw.colors.resize(count, [1.0; 4]);
        }
        Ok(())
    }

    fn missing_bytes(&self, raw: &RawMesh) -> u64 {
        let missing = |has: bool, is_empty: bool, bytes: u64| if has && is_empty { bytes } else { 0 };
        missing(self.has_normals, raw.normals.is_empty(), 12)
            + missing(self.has_uvs, raw.uvs.is_empty(), 8)
            + missing(self.has_colors, raw.colors.is_empty(), 16)
    }

    fn push(&self, [position, normal, uv, color]: [u32; 4], place: &Placement, raw: &mut RawMesh) -> Option<()> {
        let p = self.mesh.vertex_position.values.get(position as usize)?;
        raw.positions.push(place.points.point([p.x, p.y, p.z]));
        if self.has_normals {
            let n = self.mesh.vertex_normal.values.get(normal as usize)?;
            let n = place.normals.map(|row| row[0] * n.x + row[1] * n.y + row[2] * n.z);
            let largest = n.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
            // Made unit here, because f32 might not hold it at the node's scale.
            raw.normals.push(n.map(|v| if largest > 0.0 { (v / largest) as f32 } else { 0.0 }));
        }
        if self.has_uvs {
            let uv = self.mesh.vertex_uv.values.get(uv as usize)?;
            // In the file v runs up, in a mesh down.
            raw.uvs.push([uv.x as f32, (1.0 - uv.y) as f32]);
        }
        if self.has_colors {
            let c = self.mesh.vertex_color.values.get(color as usize)?;
            let [r, g, b] = [c.x, c.y, c.z].map(|v| srgb_to_linear(v) as f32);
            raw.colors.push([r, g, b, c.w as f32]);
        }
        Some(())
    }
}
