//! The assembly of a 3MF file's mesh: each build item (an object that is to be printed) with its
//! transform, and so on down through its components (references to other objects, each with a
//! transform). Without build items, the objects that are no components take their place.
//!
//! Objects and triangles are counted before memory is reserved for them. Otherwise a small file in
//! which each object refers twice to the next one could ask for 2^n copies. Such a file is refused
//! by the limits.

use super::model::{Group, NONE, Object, Triangle};
use super::parts::{Key, Parts};
use crate::import::MeshError;
use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::corners::CornerSet;
use crate::import::polygon::ALL_EDGES;
use crate::import::raw::RawMesh;
use crate::limits;
use crate::mesh::MaterialSlot;
use crate::mesh::material::AlphaMode;
use rapidhash::RapidHashMap;

/// Depth of components. Writers use two levels.
const DEPTH_MAX: usize = 64;
const VERTEX_BYTES: u64 = 24 + 16;
const TRIANGLE_BYTES: u64 = 12 + 1 + 4;
const WHITE: [f32; 4] = [1.0; 4];

/// Fills `raw` with all build items.
pub fn assemble(parts: &Parts, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
    let roots = parts.roots();
    let mut counter = Counter { parts, known: RapidHashMap::default() };
    let mut total = Count::default();
    for root in &roots {
        let (key, object) = parts.find(0, root)?;
        total.add(counter.count(key, object, 0)?);
    }
    cx.check_triangles(total.triangles)?;
    limits::check("the number of scene nodes", total.objects, cx.limits.nodes, "--limit-nodes")?;
    cx.budget.spend("the 3MF triangles", total.triangles, TRIANGLE_BYTES)?;
    raw.triangles.reserve_exact(total.triangles as usize);
    raw.edge_masks.reserve_exact(total.triangles as usize);
    raw.triangle_materials.reserve_exact(total.triangles as usize);
    let mut builder = Builder { parts, slots: Slots::default(), set: CornerSet::default() };
    for root in &roots {
        let (key, object) = parts.find(0, root)?;
        builder.add(key.0, object, &root.transform, raw, cx)?;
    }
    raw.report.file_vertices = total.vertices;
    raw.report.polygons_by_arity[3] = raw.triangles.len() as u64;
    builder.slots.finish(raw);
    Ok(())
}

/// Totals of an object with all its components.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    objects: u64,
    triangles: u64,
    vertices: u64,
    /// Levels of objects below this one.
    height: usize,
}

impl Count {
    /// Adds the totals of a sibling.
    fn add(&mut self, other: Self) {
        self.objects = self.objects.saturating_add(other.objects);
        self.triangles = self.triangles.saturating_add(other.triangles);
        self.vertices = self.vertices.saturating_add(other.vertices);
    }
}

struct Counter<'a> {
    parts: &'a Parts,
    /// None while the object is being counted.
    known: RapidHashMap<Key, Option<Count>>,
}

impl Counter<'_> {
    fn count(&mut self, key: Key, object: &Object, depth: usize) -> Result<Count, MeshError> {
        let known = self.known.get(&key).copied();
        if let Some(None) = known {
            return Err(MeshError::broken(format!("object {} of the 3MF file is in itself", key.1)));
        }
        // A known object may be deep itself.
        if depth + known.flatten().map_or(0, |count| count.height) > DEPTH_MAX {
            return Err(MeshError::broken(format!("objects of the 3MF file are more than {DEPTH_MAX} deep")));
        }
        if let Some(Some(count)) = known {
            return Ok(count);
        }
        self.known.insert(key, None);
        let (triangles, vertices) = (object.triangles.len() as u64, object.vertices.len() as u64);
        let mut count = Count { objects: 1, triangles, vertices, height: 0 };
        let parts = self.parts;
        for placed in &object.components {
            let (inner, object) = parts.find(key.0, placed)?;
            let part = self.count(inner, object, depth + 1)?;
            count.add(part);
            count.height = count.height.max(part.height + 1);
        }
        self.known.insert(key, Some(count));
        Ok(count)
    }
}

struct Builder<'a> {
    parts: &'a Parts,
    slots: Slots,
    set: CornerSet,
}

impl Builder<'_> {
    /// Adds an object. Depth and size were checked before.
    fn add(
        &mut self,
        part: usize,
        object: &Object,
        transform: &Affine,
        raw: &mut RawMesh,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        cx.deadline.check()?;
        self.mesh(part, object, transform, raw, cx)?;
        let parts = self.parts;
        for placed in &object.components {
            let ((part, _), inner) = parts.find(part, placed)?;
            self.add(part, inner, &transform.after(&placed.transform), raw, cx)?;
        }
        Ok(())
    }

    fn mesh(
        &mut self,
        part: usize,
        object: &Object,
        transform: &Affine,
        raw: &mut RawMesh,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let model = self.parts.model(part);
        let mirrors = transform.is_mirroring();
        self.set.clear();
        for (i, triangle) in object.triangles.iter().enumerate() {
            if i % 65_536 == 0 {
                cx.deadline.check()?;
            }
            self.set.pay(3, VERTEX_BYTES, cx)?;
            let group = model.groups.get(&triangle.group);
            let material = self.slots.of((part, triangle.group, triangle.indices[0]), group);
            let mut corners = [0; 3];
            for (k, corner) in corners.iter_mut().enumerate() {
                let (key, color) = corner_color(triangle, k, group);
                let (vertex, is_new) = self.set.vertex(key, raw.positions.len());
                if is_new {
                    let position = object.vertices.get(triangle.corners[k] as usize).copied().unwrap_or_default();
                    raw.positions.push(transform.point(position));
                    if let Some(color) = color {
                        raw.colors.resize(raw.positions.len() - 1, WHITE);
                        raw.colors.push(color);
                    }
                }
                *corner = vertex;
            }
            let [a, b, c] = corners;
            raw.triangles.push(if mirrors { [a, c, b] } else { corners });
            raw.edge_masks.push(ALL_EDGES);
            raw.triangle_materials.push(material);
        }
        let used = object.triangles.iter().flat_map(|triangle| triangle.corners);
        raw.report.add_loose(cx.loose(object.vertices.len(), used)?);
        self.set.pay_all(VERTEX_BYTES, cx)?;
        if !raw.colors.is_empty() {
            raw.colors.resize(raw.positions.len(), WHITE);
        }
        Ok(())
    }
}

/// The key that distinguishes corners at one vertex, and the corner's own colour.
fn corner_color(triangle: &Triangle, corner: usize, group: Option<&Group>) -> ([u32; 4], Option<[f32; 4]>) {
    let vertex = triangle.corners[corner];
    let index = triangle.indices[corner];
    let colors = group.filter(|group| group.names.is_none()).map(|group| &group.colors);
    match colors.and_then(|colors| colors.get(index as usize)) {
        Some(&color) => ([vertex, triangle.group, index, 0], Some(color)),
        None => ([vertex, NONE, NONE, 0], None),
    }
}

/// A base material: its part, its group and its place there.
type Base = (usize, u32, u32);

/// Material slots, made as triangles need them.
#[derive(Default)]
struct Slots {
    all: Vec<MaterialSlot>,
    /// Slots by base material. None: triangles without one.
    known: RapidHashMap<Option<Base>, u32>,
    has_plain: Option<usize>,
}

impl Slots {
    fn of(&mut self, (part, number, index): Base, group: Option<&Group>) -> u32 {
        let base = group.and_then(|group| {
            let name = group.names.as_ref()?.get(index as usize)?;
            Some((name, *group.colors.get(index as usize)?))
        });
        let key = base.map(|_| (part, number, index));
        let next = self.all.len() as u32;
        let slot = *self.known.entry(key).or_insert(next);
        if slot < next {
            return slot;
        }
        self.all.push(match base {
            Some((name, color)) => MaterialSlot {
                name: name.clone(),
                base_color: Some(color),
                alpha: if color[3] < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
                ..MaterialSlot::default()
            },
            None => MaterialSlot::default(),
        });
        if base.is_none() {
            self.has_plain = Some(slot as usize);
        }
        slot
    }

    fn finish(mut self, raw: &mut RawMesh) {
        // Vertex colours are final: white takes the place of the grey of files without colours.
        if let Some(plain) = self.has_plain.filter(|_| !raw.colors.is_empty()) {
            self.all[plain].base_color = Some(WHITE);
        }
        raw.materials = self.all;
    }
}
