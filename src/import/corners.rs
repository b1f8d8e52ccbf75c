//! Polygons whose corners have attributes of their own, and how they get into a raw mesh: for importers that read face by
//! face.

use super::MeshError;
use super::polygon::Triangulator;
use super::raw::RawMesh;
use crate::import::context::Context;
use crate::warning::Warning;
use rapidhash::RapidHashMap;
use std::collections::hash_map::Entry;

/// Corners between two looks at the deadline and at the number of triangles.
const CORNERS_PER_LOOK: u64 = 65_536;
/// What a triangle takes in a raw mesh, whose lists double when they grow.
const TRIANGLE_BYTES: u64 = 2 * (12 + 1 + 4);
/// What a corner takes in the set, while that grows.
const CORNER_BYTES: u64 = 2 * (16 + 4 + 1) + 4;

/// Adds polygons to a raw mesh, paid and counted.
#[derive(Debug, Default)]
pub struct Polygons {
    triangulator: Triangulator,
    since_look: u64,
    triangles: u64,
}

impl Polygons {
    /// Pays for a polygon of `corners` corners, three at least, before its corners are made.
    pub fn pay(&mut self, corners: usize, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let corners = corners as u64;
        self.triangles += corners.saturating_sub(2);
        self.since_look += corners;
        if self.since_look >= CORNERS_PER_LOOK {
            self.look(cx)?;
        }
        Ok(())
    }

    fn look(&mut self, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.deadline.check()?;
        cx.check_triangles(self.triangles)?;
        cx.budget.spend("the triangles of the file", self.since_look, TRIANGLE_BYTES)?;
        self.since_look = 0;
        Ok(())
    }

    /// Splits a polygon of at least three vertices of `raw`.
    pub fn add(&mut self, raw: &mut RawMesh, corners: &[u32], material: u32) {
        raw.report.polygons_by_arity[corners.len().min(12)] += 1;
        let RawMesh { positions, triangles, edge_masks, triangle_materials, .. } = raw;
        self.triangulator.split(corners, positions, &mut |triangle, mask| {
            triangles.push(triangle);
            edge_masks.push(mask);
            triangle_materials.push(material);
        });
    }

    /// Pays for the last ones, and warns if some were split without care.
    pub fn finish(mut self, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        self.look(cx)?;
        if self.triangulator.gave_up() {
            raw.report.warnings.push(Warning {
                code: "polygons_fanned",
                detail: "polygons with very many corners were split into fans, which is wrong where they are concave"
                    .into(),
            });
        }
        Ok(())
    }
}

/// Gives every combination of indices (of a position, a normal ...) that corners have a vertex of its own, once.
#[derive(Debug, Default)]
pub struct CornerSet {
    numbers: RapidHashMap<[u32; 4], u32>,
    unpaid: u64,
}

impl CornerSet {
    /// The vertex of a corner, and whether it is new: the next after `count`.
    pub fn vertex(&mut self, key: [u32; 4], count: usize) -> (u32, bool) {
        match self.numbers.entry(key) {
            Entry::Occupied(known) => (*known.get(), false),
            Entry::Vacant(place) => {
                self.unpaid += 1;
                (*place.insert(count as u32), true)
            }
        }
    }

    /// Pays for the vertices since the last time, each `vertex_bytes` large in the raw mesh; `corners` more may follow until
    /// the next.
    pub fn pay(&mut self, corners: usize, vertex_bytes: u64, cx: &mut Context<'_>) -> Result<(), MeshError> {
        if self.unpaid + corners as u64 >= CORNERS_PER_LOOK {
            self.pay_all(vertex_bytes, cx)?;
            if corners as u64 >= CORNERS_PER_LOOK {
                cx.budget.spend("a face of very many corners", corners as u64, CORNER_BYTES + 2 * vertex_bytes)?;
            }
        }
        Ok(())
    }

    /// Pays for the vertices since the last time.
    pub fn pay_all(&mut self, vertex_bytes: u64, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.budget.spend("the vertices of the file", self.unpaid, CORNER_BYTES + 2 * vertex_bytes)?;
        self.unpaid = 0;
        if self.numbers.len() >= u32::MAX as usize - CORNERS_PER_LOOK as usize {
            return Err(MeshError::broken("the file has more than 4 billion different corners"));
        }
        Ok(())
    }

    /// Forgets them all, for a part that shares nothing with those before it.
    pub fn clear(&mut self) {
        // Emptying takes as long as the table is large: after a large part, many small ones must not each pay for it.
        if self.numbers.len() < self.numbers.capacity() / 16 {
            self.numbers = RapidHashMap::default();
        } else {
            self.numbers.clear();
        }
    }
}
