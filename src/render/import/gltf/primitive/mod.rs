//! A glTF primitive, which is a part of a mesh with one material: its vertices, triangles, lines
//! and points. It is decoded once, and then added to the whole mesh once for each instance.

#[cfg_attr(not(feature = "draco"), path = "draco_absent.rs")]
pub(crate) mod draco;
pub(crate) mod ngons;
pub(crate) mod shape;
pub(crate) mod triangles;
pub(crate) mod vertices;
use self::shape::{Influences, Shape};
use self::vertices::Vertices;
use super::warn_once;
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute;
use crate::import::gltf::document::schema;
use crate::import::gltf::document::schema::mode;
use crate::import::gltf::material::Materials;
use crate::import::polygon::ALL_EDGES;
use crate::import::raw::{RawMesh, extend_attribute};
use crate::mesh::LineOrPoint;
use crate::mesh::primitives::{POINT_TRIANGLES, SEGMENT_TRIANGLES};
use crate::parallel::{each_piece, map_items};
use crate::warning::Warning;
use std::ops::Range;

/// Decoded data of one primitive.
#[derive(Debug, Default)]
pub struct Primitive {
    /// Its name in errors.
    pub what: String,
    /// One per vertex.
    pub positions: Vec<[f64; 3]>,
    /// One per vertex, or empty.
    pub normals: Vec<[f64; 3]>,
    uvs: Vec<[f64; 2]>,
    /// As [`RawMesh::second_uvs`].
    second_uvs: Vec<[f64; 2]>,
    colors: Vec<[f64; 4]>,
    triangles: Vec<[u32; 3]>,
    /// Ends of line segments. A point has its vertex twice.
    lines_and_points: Vec<[u32; 2]>,
    /// As [`RawMesh::edge_masks`]; empty if every edge belongs to a polygon.
    edge_masks: Vec<u8>,
    /// As [`crate::import::ImportReport::polygons_by_arity`].
    polygons_by_arity: [u64; 13],
    material: Option<usize>,
    /// Accessors of the morph targets.
    pub targets: Vec<Target>,
    /// Sets of joints and weights; empty where the file has no skin.
    pub influences: Vec<Influences>,
}

/// The accessors of one morph target.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Displacements of positions.
    pub positions: Option<usize>,
    /// Displacements of normals.
    pub normals: Option<usize>,
}

/// The document's part of a primitive.
pub struct Source<'a> {
    /// Its name in errors.
    pub what: String,
    /// The JSON.
    pub json: &'a schema::Primitive,
    /// True if the order of its triangles encodes polygons.
    pub has_ngons: bool,
    /// True if the file has skins, so that joints and weights are read.
    pub has_skins: bool,
}

impl Primitive {
    /// Decodes a primitive. None if it has no positions.
    pub fn read(
        source: &Source<'_>,
        reader: &mut Reader<'_>,
        materials: &mut Materials<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Option<Self>, MeshError> {
        let (what, json) = (&source.what, source.json);
        if !json.attributes.contains_key("POSITION") {
            warn_once(warnings, "no_positions", format!("{what} has no positions and is not drawn"));
            return Ok(None);
        }
        let material = json.material.map(|m| m.0);
        let uv_sets = match material {
            Some(index) => materials.uv_sets(what, index, reader, warnings, cx)?,
            None => [None; 2],
        };
        let mut vertices = Vertices::new(source, reader, cx)?;
        let positions = vertices.attribute::<3>("POSITION", &attribute::POSITION, reader, cx)?.unwrap_or_default();
        vertices.count = Some(positions.len());
        let mut out = Self { what: what.clone(), positions, material, ..Self::default() };
        out.normals = vertices.attribute("NORMAL", &attribute::NORMAL, reader, cx)?.unwrap_or_default();
        let mut uvs = |set: u32, is_needed: bool| -> Result<Vec<[f64; 2]>, MeshError> {
            let name = format!("TEXCOORD_{set}");
            let uvs = vertices.attribute(&name, &attribute::TEXCOORD, reader, cx)?;
            if uvs.is_none() && is_needed {
                let detail = format!("{what} has a texture and no {name} that says where it goes");
                warn_once(warnings, "uvs_missing", detail);
            }
            Ok(uvs.unwrap_or_default())
        };
        out.uvs = uvs(uv_sets[0].unwrap_or(0), uv_sets[0].is_some())?;
        if let Some(set) = uv_sets[1] {
            out.second_uvs = uvs(set, true)?;
        }
        out.colors = vertices.colors(reader, cx)?;
        if source.has_skins {
            out.influences = vertices.influences(reader, cx)?;
        }
        out.targets = vertices.targets(reader)?;
        let indices = vertices.indices(reader, cx)?;
        let count = out.positions.len();
        triangles::check_indices(what, indices.as_deref().unwrap_or_default(), count)?;
        out.lines_and_points = triangles::lines_and_points(vertices.mode(), indices.as_deref(), count, cx)?;
        out.triangles = triangles::of(vertices.mode(), indices, count, cx)?;
        if source.has_ngons && vertices.mode() == mode::TRIANGLES {
            cx.budget.spend("glTF polygons", out.triangles.len() as u64, 1)?;
            (out.edge_masks, out.polygons_by_arity) = ngons::edge_masks(&out.triangles);
        } else {
            out.polygons_by_arity[3] = out.triangles.len() as u64;
        }
        Ok(Some(out))
    }

    /// Adds an instance of the primitive with the given shape and transform.
    pub fn append(
        &self,
        shape: &Shape<'_>,
        raw: &mut RawMesh,
        transform: &Affine,
        default_material: usize,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let before = raw.positions.len();
        let after = before + self.positions.len();
        cx.deadline.check()?;
        self.pay(raw, cx)?;
        raw.positions.extend(shape.positions.iter().map(|p| transform.point(*p)));
        self.append_attributes(shape, raw, transform, before..after);

        let base = before as u32;
        let turns = transform.is_mirroring();
        let mirrored = |t: &[u32; 3]| turns != shape.mirrored.get(t[0] as usize).copied().unwrap_or(false);
        raw.triangles.extend(self.triangles.iter().map(|t| {
            let [a, b, c] = if mirrored(t) { [t[0], t[2], t[1]] } else { *t };
            [a + base, b + base, c + base]
        }));
        let masks = self.edge_masks.iter().zip(&self.triangles);
        raw.edge_masks.extend(masks.map(|(&m, t)| if mirrored(t) { ngons::mirrored(m) } else { m }));
        self.append_rest(raw, base, default_material, cx)
    }

    /// As [`Self::append`], for the only instance of a primitive that keeps its shape: its lists
    /// become those of the mesh where that has none yet.
    pub fn append_only(
        mut self,
        raw: &mut RawMesh,
        transform: &Affine,
        default_material: usize,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        if !raw.positions.is_empty() || !raw.triangles.is_empty() || transform.is_mirroring() {
            return self.append(&Shape::of(&self), raw, transform, default_material, cx);
        }
        cx.deadline.check()?;
        self.pay(raw, cx)?;
        let count = self.positions.len();
        raw.report.file_vertices += count as u64;
        raw.positions = std::mem::take(&mut self.positions);
        if *transform != Affine::IDENTITY {
            each_piece(&mut raw.positions, |piece| piece.iter_mut().for_each(|p| *p = transform.point(*p)));
        }
        let matrix = transform.normal_matrix();
        raw.normals = whole(&self.normals, count, |n| turn(&matrix, n));
        raw.uvs = whole(&self.uvs, count, |t| t.map(|c| c as f32));
        raw.second_uvs = whole(&self.second_uvs, count, |t| t.map(|c| c as f32));
        raw.colors = whole(&self.colors, count, |c| c.map(|v| v as f32));
        raw.triangles = std::mem::take(&mut self.triangles);
        raw.edge_masks.extend(&self.edge_masks);
        self.append_rest(raw, 0, default_material, cx)
    }

    /// Pays for an instance.
    fn pay(&self, raw: &RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.check_triangles(raw.triangles.len() as u64 + self.triangle_count())?;
        // Lists double when they grow.
        cx.budget.spend("glTF vertices", self.positions.len() as u64, 2 * (24 + 12 + 8 + 16))?;
        if !(self.second_uvs.is_empty() && raw.second_uvs.is_empty()) {
            let count = raw.positions.len() + self.positions.len();
            let known = if raw.second_uvs.is_empty() { count } else { self.positions.len() };
            cx.budget.spend("second texture coordinates", known as u64, 2 * 8)?;
        }
        cx.budget.spend("glTF triangles", self.triangles.len() as u64, 2 * (12 + 1 + 4))?;
        if raw.positions.len() + self.positions.len() >= u32::MAX as usize {
            return Err(MeshError::broken("the glTF file has more than 4 billion vertices, with its instances"));
        }
        Ok(())
    }

    /// Adds the attributes of an instance whose vertices have the numbers `of`.
    fn append_attributes(&self, shape: &Shape<'_>, raw: &mut RawMesh, transform: &Affine, of: Range<usize>) {
        raw.report.file_vertices += of.len() as u64;
        let matrix = transform.normal_matrix();
        let normals = shape.normals.iter().map(|n| turn(&matrix, n));
        extend_attribute(&mut raw.normals, of.start, of.end, [0.0; 3], normals);
        let in_f32 = |uv: &[f64; 2]| uv.map(|c| c as f32);
        extend_attribute(&mut raw.uvs, of.start, of.end, [0.0; 2], self.uvs.iter().map(in_f32));
        extend_attribute(&mut raw.second_uvs, of.start, of.end, [0.0; 2], self.second_uvs.iter().map(in_f32));
        extend_attribute(&mut raw.colors, of.start, of.end, [1.0; 4], self.colors.iter().map(|c| c.map(|v| v as f32)));
    }

    /// Adds what an instance has beside vertices and triangles; `base` is its first vertex.
    fn append_rest(
        &self,
        raw: &mut RawMesh,
        base: u32,
        default_material: usize,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        raw.edge_masks.resize(raw.triangles.len(), ALL_EDGES);
        let material = self.material.unwrap_or(default_material) as u32;
        if raw.triangle_materials.is_empty() && material == 0 {
            // Memory from the system is zero already: no pass has to write it.
            raw.triangle_materials = vec![0; raw.triangles.len()];
        } else {
            raw.triangle_materials.resize(raw.triangles.len(), material);
        }
        cx.budget.spend(
            "glTF lines and points",
            self.lines_and_points.len() as u64,
            2 * size_of::<LineOrPoint>() as u64,
        )?;
        raw.lines_and_points
            .extend(self.lines_and_points.iter().map(|ends| LineOrPoint { ends: ends.map(|v| v + base), material }));
        for (all, own) in raw.report.polygons_by_arity.iter_mut().zip(self.polygons_by_arity) {
            *all += own;
        }
        Ok(())
    }

    /// Marks the vertices that its triangles, lines and points use.
    pub fn mark_used(&self, is_used: &mut Vec<bool>) {
        is_used.resize(is_used.len().max(self.positions.len()), false);
        let of_lines = self.lines_and_points.iter().flatten();
        self.triangles.iter().flatten().chain(of_lines).for_each(|vertex| is_used[*vertex as usize] = true);
    }

    /// The index of its material.
    pub fn material(&self) -> Option<usize> {
        self.material
    }

    /// The number of its triangles, including those that lines and points become.
    pub fn triangle_count(&self) -> u64 {
        let of = |ends: &[u32; 2]| if ends[0] == ends[1] { POINT_TRIANGLES } else { SEGMENT_TRIANGLES };
        self.triangles.len() as u64 + self.lines_and_points.iter().map(of).sum::<u64>()
    }
}

/// The results of `each` for the values of an attribute, if there are `count` of them.
fn whole<T: Sync, R: Send>(values: &[T], count: usize, each: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    if values.len() == count { map_items(values, each) } else { Vec::new() }
}

/// A transformed normal of unit length, or zero if it has no direction. Made unit in f64, because
/// after a scale of 1e-30 f32 could not hold it.
fn turn(m: &[[f64; 3]; 3], n: &[f64; 3]) -> [f32; 3] {
    let v: [f64; 3] = std::array::from_fn(|r| m[r][0] * n[0] + m[r][1] * n[1] + m[r][2] * n[2]);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 && length.is_finite() { v.map(|c| (c / length) as f32) } else { [0.0; 3] }
}
