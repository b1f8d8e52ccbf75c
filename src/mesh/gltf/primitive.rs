//! A primitive: its triangles and vertices, decoded once however many nodes show it.

use super::accessor::{Integers, Reader};
use super::materials::Materials;
use super::ngons;
use super::transform::Affine;
use super::warn_once;
use crate::mesh::import::Context;
use crate::mesh::polygon::ALL_EDGES;
use crate::mesh::raw::{RawMesh, extend_attribute};
use crate::mesh::{MeshError, Warning, counted};
use gltf::json::accessor::Type;
use gltf::json::mesh::{self, Mode, Semantic};
use gltf::json::validation::Checked;

/// Decoded data of one primitive.
#[derive(Debug, Default)]
pub struct Primitive {
    positions: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    uvs: Vec<[f64; 2]>,
    colors: Vec<[f64; 4]>,
    triangles: Vec<[u32; 3]>,
    /// As [`RawMesh::edge_masks`]; empty where every edge is a polygon's.
    edge_masks: Vec<u8>,
    /// As [`crate::mesh::ImportReport::polygons_by_arity`].
    polygons_by_arity: [u64; 13],
    material: Option<usize>,
}

/// Where a primitive comes from.
pub struct Source<'a> {
    /// How errors speak of it.
    pub what: String,
    /// The document's part.
    pub json: &'a mesh::Primitive,
    /// Whether the order of its triangles tells its polygons.
    pub has_ngons: bool,
}

impl Primitive {
    /// Decodes a primitive. None if it has nothing that is drawn.
    pub fn read(
        source: &Source<'_>,
        reader: &mut Reader<'_>,
        materials: &mut Materials<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Option<Self>, MeshError> {
        let (what, json) = (&source.what, source.json);
        let Checked::Valid(mode) = json.mode else {
            return Err(MeshError::broken(format!("{what} of the glTF file has an unknown mode")));
        };
        let ignored = match mode {
            Mode::Points => Some(("points_ignored", "points are not drawn")),
            Mode::Lines | Mode::LineLoop | Mode::LineStrip => Some(("lines_ignored", "lines are not drawn")),
            _ => None,
        };
        if let Some((code, detail)) = ignored {
            warn_once(warnings, code, format!("{detail}, such as {what}"));
            return Ok(None);
        }
        let attribute = |semantic| json.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(position) = attribute(Semantic::Positions) else {
            warn_once(warnings, "no_positions", format!("{what} has no positions and is not drawn"));
            return Ok(None);
        };
        reader.check_not_compressed(position)?;
        let material = json.material.map(|m| m.value());
        let uv_set = match material {
            Some(index) => materials.uv_set(what, index, reader, warnings, cx)?,
            None => None,
        };
        let positions: Vec<[f64; 3]> = reader.vectors(position, Type::Vec3, Integers::AsDeclared, cx)?;
        let count = positions.len();
        let mut out = Self { positions, material, ..Self::default() };
        if let Some(index) = attribute(Semantic::Normals) {
            out.normals = reader.vectors(index, Type::Vec3, Integers::AsDeclared, cx)?;
            same_count(what, "NORMAL", count, out.normals.len())?;
        }
        let set = uv_set.unwrap_or(0);
        if let Some(index) = attribute(Semantic::TexCoords(set)) {
            out.uvs = reader.vectors(index, Type::Vec2, Integers::AsDeclared, cx)?;
            same_count(what, &format!("TEXCOORD_{set}"), count, out.uvs.len())?;
        } else if uv_set.is_some() {
            let detail = format!("{what} has a texture and no TEXCOORD_{set} that says where it goes");
            warn_once(warnings, "uvs_missing", detail);
        }
        if let Some(index) = attribute(Semantic::Colors(0)) {
            out.colors = read_colors(reader, index, cx)?;
            same_count(what, "COLOR_0", count, out.colors.len())?;
        }
        let indices = match json.indices {
            Some(index) => Some(reader.indices(index.value(), cx)?),
            None => None,
        };
        if let Some(bad) = indices.iter().flatten().find(|&&i| i as usize >= count) {
            return Err(MeshError::broken(format!(
                "{what} of the glTF file has the vertex index {bad}, and {}",
                counted(count, "vertex", "vertices")
            )));
        }
        out.triangles = triangles(mode, indices.as_deref(), count, cx)?;
        if source.has_ngons && mode == Mode::Triangles {
            cx.budget.spend("glTF polygons", out.triangles.len() as u64, 1)?;
            (out.edge_masks, out.polygons_by_arity) = ngons::edge_masks(&out.triangles);
        } else {
            out.polygons_by_arity[3] = out.triangles.len() as u64;
        }
        Ok(Some(out))
    }

    /// Adds an instance, moved by `transform`.
    pub fn append(
        &self,
        raw: &mut RawMesh,
        transform: &Affine,
        default_material: usize,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let before = raw.positions.len();
        let after = before + self.positions.len();
        cx.deadline.check()?;
        cx.check_triangles(raw.triangles.len() as u64 + self.triangles.len() as u64)?;
        // Lists double when they grow.
        cx.budget.spend("glTF vertices", self.positions.len() as u64, 2 * (24 + 12 + 8 + 16))?;
        cx.budget.spend("glTF triangles", self.triangles.len() as u64, 2 * (12 + 1 + 4))?;
        if after >= u32::MAX as usize {
            return Err(MeshError::broken("the glTF file has more than 4 billion vertices, with its instances"));
        }
        raw.positions.extend(self.positions.iter().map(|p| transform.point(*p)));
        let matrix = transform.normal_matrix();
        let normals = self.normals.iter().map(|n| turn(&matrix, n));
        extend_attribute(&mut raw.normals, before, after, [0.0; 3], normals);
        extend_attribute(&mut raw.uvs, before, after, [0.0; 2], self.uvs.iter().map(|t| t.map(|c| c as f32)));
        extend_attribute(&mut raw.colors, before, after, [1.0; 4], self.colors.iter().map(|c| c.map(|v| v as f32)));

        let base = before as u32;
        let mirrored = transform.is_mirroring();
        raw.triangles.extend(self.triangles.iter().map(|&[a, b, c]| {
            let [b, c] = if mirrored { [c, b] } else { [b, c] };
            [a + base, b + base, c + base]
        }));
        raw.edge_masks.extend(self.edge_masks.iter().map(|&m| if mirrored { ngons::mirrored(m) } else { m }));
        raw.edge_masks.resize(raw.triangles.len(), ALL_EDGES);
        raw.triangle_materials.resize(raw.triangles.len(), self.material.unwrap_or(default_material) as u32);
        raw.report.file_vertices += self.positions.len() as u64;
        for (all, own) in raw.report.polygons_by_arity.iter_mut().zip(self.polygons_by_arity) {
            *all += own;
        }
        Ok(())
    }

    /// The index of its material.
    pub fn material(&self) -> Option<usize> {
        self.material
    }
}

fn same_count(what: &str, name: &str, positions: usize, values: usize) -> Result<(), MeshError> {
    if positions == values {
        return Ok(());
    }
    Err(MeshError::broken(format!("{what} of the glTF file has {positions} positions and {values} values of {name}")))
}

fn read_colors(reader: &mut Reader<'_>, index: usize, cx: &mut Context<'_>) -> Result<Vec<[f64; 4]>, MeshError> {
    if reader.shape(index)?.0 == Type::Vec3 {
        let colors: Vec<[f64; 3]> = reader.vectors(index, Type::Vec3, Integers::Normalised, cx)?;
        cx.budget.spend("glTF colours", colors.len() as u64, 32)?;
        return Ok(colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect());
    }
    reader.vectors(index, Type::Vec4, Integers::Normalised, cx)
}

/// The triangles of a list, strip or fan. Indices that do not make up a whole triangle are left over.
fn triangles(
    mode: Mode,
    indices: Option<&[u32]>,
    vertices: usize,
    cx: &mut Context<'_>,
) -> Result<Vec<[u32; 3]>, MeshError> {
    let n = indices.map_or(vertices, <[u32]>::len);
    let count = if mode == Mode::Triangles { n / 3 } else { n.saturating_sub(2) };
    cx.check_triangles(count as u64)?;
    cx.budget.spend("glTF triangles", count as u64, 12)?;
    let at = |i: usize| indices.map_or(i as u32, |list| list[i]);
    Ok((0..count)
        .map(|i| match mode {
            Mode::TriangleStrip => [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)],
            Mode::TriangleFan => [at(i + 1), at(i + 2), at(0)],
            _ => [at(3 * i), at(3 * i + 1), at(3 * i + 2)],
        })
        .collect())
}

/// A turned unit normal, or zero if it has no direction. Unit already here: after a scale of 1e-30, f32 could not hold it.
fn turn(m: &[[f64; 3]; 3], n: &[f64; 3]) -> [f32; 3] {
    let v: [f64; 3] = std::array::from_fn(|r| m[r][0] * n[0] + m[r][1] * n[1] + m[r][2] * n[2]);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 && length.is_finite() { v.map(|c| (c / length) as f32) } else { [0.0; 3] }
}
