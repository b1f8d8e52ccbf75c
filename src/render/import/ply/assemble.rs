//! The assembly of a PLY mesh from the vertices and faces of the file. Polygons are split into
//! triangles. A mesh has its attributes at vertices, so a vertex is copied where the corners of faces
//! at it differ in texture coordinates or colour.

use super::conversion::WHITE;
use super::faces::{Faces, NO_TEXTURE};
use super::vertices::Vertices;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::polygon::{ALL_EDGES, Triangulator};
use crate::import::raw::RawMesh;
use crate::warning::Warning;
use bytemuck::allocation::try_cast_vec;

/// Corners between two deadline checks.
const CORNERS_PER_POLL: usize = 65_536;
/// Bytes of an added vertex, in lists that double as they grow.
const VERTEX_BYTES: u64 = 2 * (24 + 12 + 8 + 16);

/// Fills in vertices, triangles and counts. Returns the index of a texture per triangle, or nothing
/// if no face has one.
pub fn assemble(
    vertices: Vertices,
    faces: &mut Faces,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<Vec<u32>, MeshError> {
    raw.report.file_vertices = vertices.positions.len() as u64;
    let Vertices { positions, is_f32, normals, uvs, colors } = vertices;
    raw.is_f32 = is_f32;
    (raw.positions, raw.normals, raw.uvs, raw.colors) = (positions, normals, uvs, colors);
    let is_needed = Splitter::is_needed_for(faces, raw);
    // An upper bound: every polygon has two triangles fewer than corners.
    let triangles = faces.corners.len() - 2 * faces.arities.len();
    if !is_needed && faces.textures.is_empty() && faces.arities.are_triangles() {
        Splitter::new(faces, raw, cx)?;
        cx.check_triangles(triangles as u64)?;
        cx.budget.spend("the PLY triangles", triangles as u64, 12 + 1 + 4 + 4)?;
        cx.deadline.check()?;
        raw.triangles = match try_cast_vec(std::mem::take(&mut faces.corners)) {
            Ok(triangles) => triangles,
            Err((_, corners)) => corners.chunks_exact(3).map(|face| [face[0], face[1], face[2]]).collect(),
        };
        raw.edge_masks = vec![ALL_EDGES; triangles];
        raw.triangle_materials = vec![0; triangles];
        raw.report.polygons_by_arity[3] += triangles as u64;
        return Ok(Vec::new());
    }
    let mut splitter = Splitter::new(faces, raw, cx)?;
    cx.check_triangles(triangles as u64)?;
    cx.budget.spend("the PLY triangles", triangles as u64, 12 + 1 + 4 + 4)?;
    raw.triangles.reserve_exact(triangles);
    raw.edge_masks.reserve_exact(triangles);
    let mut textures = Vec::with_capacity(if faces.textures.is_empty() { 0 } else { triangles });
    let mut triangulator = Triangulator::default();
    let mut own = Vec::new();
    let (mut at, mut polled) = (0, 0);
    for (face, arity) in faces.arities.iter().enumerate() {
        let corners = &faces.corners[at..at + arity as usize];
        if at - polled >= CORNERS_PER_POLL {
            cx.deadline.check()?;
            splitter.pay(raw, cx)?;
            polled = at;
        }
        splitter.pay_ahead(corners.len(), cx)?;
        let corners = if splitter.is_needed() {
            own.clear();
            own.extend(corners.iter().zip(at..).map(|(&vertex, corner)| splitter.vertex(vertex, corner, face, raw)));
            &own
        } else {
            corners
        };
        at += arity as usize;
        raw.report.polygons_by_arity[corners.len().min(12)] += 1;
        triangulator.split(corners, &raw.positions, &mut |triangle, mask| {
            raw.triangles.push(triangle);
            raw.edge_masks.push(mask);
        });
        if !faces.textures.is_empty() {
            textures.resize(raw.triangles.len(), faces.textures.get(face).copied().unwrap_or(NO_TEXTURE));
        }
    }
    splitter.pay(raw, cx)?;
    raw.triangle_materials = vec![0; raw.triangles.len()];
    raw.report.warnings.extend(triangulator.warning());
    Ok(textures)
}

/// Gives vertices of their own to corners that have their own texture coordinates or colours. A
/// corner shares the vertex last made for the same vertex of the file, if the values are equal; a
/// full search would find more but cost a table.
struct Splitter<'a> {
    faces: &'a Faces,
    has_uvs: bool,
    has_colors: bool,
    /// The vertex last made for each vertex of the file.
    last: Vec<u32>,
    /// Vertices that are paid for.
    paid: usize,
}

const UNSEEN: u32 = u32::MAX;

impl<'a> Splitter<'a> {
    fn new(faces: &'a Faces, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let count = raw.positions.len();
        // Texture coordinates of corners win over those of vertices; MeshLab writes both.
        let has_uvs = !faces.uvs.is_empty();
        let has_colors = !faces.colors.is_empty() && raw.colors.is_empty();
        if !faces.colors.is_empty() && !has_colors {
            raw.report.warnings.push(Warning {
                code: "face_colors_ignored",
                detail: "vertices and faces both have colours, and those of the vertices are drawn".into(),
            });
        }
        let mut splitter = Self { faces, has_uvs, has_colors, last: Vec::new(), paid: count };
        if splitter.is_needed() {
            cx.budget.spend("PLY corners with attributes of their own", count as u64, 4 + VERTEX_BYTES)?;
            splitter.last = vec![UNSEEN; count];
            if has_uvs {
                raw.uvs = vec![[0.0; 2]; count];
            }
            if has_colors {
                raw.colors = vec![WHITE; count];
            }
        }
        Ok(splitter)
    }

    /// True if corners of `faces` have attributes of their own.
    fn is_needed_for(faces: &Faces, raw: &RawMesh) -> bool {
        !faces.uvs.is_empty() || !faces.colors.is_empty() && raw.colors.is_empty()
    }

    fn is_needed(&self) -> bool {
        self.has_uvs || self.has_colors
    }

    /// The vertex for a corner of a face.
    fn vertex(&mut self, vertex: u32, corner: usize, face: usize, raw: &mut RawMesh) -> u32 {
        let uv = self.has_uvs.then(|| self.faces.uvs.get(corner).copied().unwrap_or_default());
        let color = self.has_colors.then(|| self.faces.colors.get(face).copied().unwrap_or(WHITE));
        let last = &mut self.last[vertex as usize];
        if *last == UNSEEN {
            *last = vertex;
        } else {
            let at = *last as usize;
            let is_same = uv.is_none_or(|uv| raw.uvs[at] == uv) && color.is_none_or(|color| raw.colors[at] == color);
            if is_same {
                return *last;
            }
            *last = raw.positions.len() as u32;
            copy(&mut raw.positions, vertex);
            copy(&mut raw.normals, vertex);
            copy(&mut raw.uvs, vertex);
            copy(&mut raw.colors, vertex);
        }
        let at = *last as usize;
        if let Some(uv) = uv {
            raw.uvs[at] = uv;
        }
        if let Some(color) = color {
            raw.colors[at] = color;
        }
        *last
    }

    /// Pays for the corners of a polygon that is too large to pay for afterwards.
    fn pay_ahead(&mut self, corners: usize, cx: &mut Context<'_>) -> Result<(), MeshError> {
        if self.is_needed() && corners > CORNERS_PER_POLL {
            cx.budget.spend("PLY corners with attributes of their own", corners as u64, VERTEX_BYTES)?;
            self.paid += corners;
        }
        Ok(())
    }

    fn pay(&mut self, raw: &RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let count = raw.positions.len();
        let unpaid = count.saturating_sub(self.paid);
        cx.budget.spend("PLY corners with attributes of their own", unpaid as u64, VERTEX_BYTES)?;
        self.paid += unpaid;
        if count >= u32::MAX as usize {
            return Err(MeshError::broken("the PLY file has more than 4 billion vertices, its corners' own included"));
        }
        Ok(())
    }
}

/// Appends a copy of a vertex's value, if vertices have the attribute.
fn copy<T: Copy>(all: &mut Vec<T>, vertex: u32) {
    if let Some(&value) = all.get(vertex as usize) {
        all.push(value);
    }
}
