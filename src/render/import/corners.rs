//! Two helpers of importers that read a mesh face by face. `Polygons` splits polygons into
//! triangles and counts them against the limits. `CornerSet` makes one vertex of each distinct
//! combination of indices that a corner has: of a position, a normal, a texture coordinate ...

use super::MeshError;
use super::polygon::Triangulator;
use super::raw::RawMesh;
use crate::import::context::Context;
use rapidhash::RapidHashMap;
use std::collections::hash_map::Entry;

/// Corners between two checks of the deadline and of the number of triangles.
const CORNERS_PER_POLL: u64 = 65_536;
/// Bytes per triangle in a raw mesh, whose lists double as they grow.
const TRIANGLE_BYTES: u64 = 2 * (12 + 1 + 4);
/// Bytes per corner in the set while it grows.
const CORNER_BYTES: u64 = 2 * (16 + 4 + 1) + 4;

/// Adds polygons to a raw mesh; pays for them and counts them.
#[derive(Debug, Default)]
pub struct Polygons {
    triangulator: Triangulator,
    since_poll: u64,
    triangles: u64,
}

impl Polygons {
    /// Pays for a polygon of `corners` corners, at least three, before its corners are made.
    pub fn pay(&mut self, corners: usize, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let corners = corners as u64;
        self.triangles += corners.saturating_sub(2);
        self.since_poll += corners;
        if self.since_poll >= CORNERS_PER_POLL {
            self.poll(cx)?;
        }
        Ok(())
    }

    fn poll(&mut self, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.deadline.check()?;
        cx.check_triangles(self.triangles)?;
        cx.budget.spend("the triangles of the file", self.since_poll, TRIANGLE_BYTES)?;
        self.since_poll = 0;
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

    /// Pays for the last polygons, and warns if some were fanned.
    pub fn finish(mut self, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
        self.poll(cx)?;
        raw.report.warnings.extend(self.triangulator.warning());
        Ok(())
    }
}

/// Numbers the distinct combinations of indices (of a position, a normal ...) at corners: each
/// becomes one vertex.
#[derive(Debug, Default)]
pub struct CornerSet {
    numbers: RapidHashMap<[u32; 4], u32>,
    unpaid: u64,
}

impl CornerSet {
    /// The vertex of a corner, and true if it is new. A new vertex gets the number `count`.
    pub fn vertex(&mut self, key: [u32; 4], count: usize) -> (u32, bool) {
        match self.numbers.entry(key) {
            Entry::Occupied(known) => (*known.get(), false),
            Entry::Vacant(place) => {
                self.unpaid += 1;
                (*place.insert(count as u32), true)
            }
        }
    }

    /// Pays for the vertices since the last payment, each `vertex_bytes` large in the raw mesh.
    /// `corners` more may follow until the next one.
    pub fn pay(&mut self, corners: usize, vertex_bytes: u64, cx: &mut Context<'_>) -> Result<(), MeshError> {
        if self.unpaid + corners as u64 >= CORNERS_PER_POLL {
            self.pay_all(vertex_bytes, cx)?;
            if corners as u64 >= CORNERS_PER_POLL {
                cx.budget.spend("a face of very many corners", corners as u64, CORNER_BYTES + 2 * vertex_bytes)?;
            }
        }
        Ok(())
    }

    /// Pays for the vertices since the last payment.
    pub fn pay_all(&mut self, vertex_bytes: u64, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.budget.spend("the vertices of the file", self.unpaid, CORNER_BYTES + 2 * vertex_bytes)?;
        self.unpaid = 0;
        if self.numbers.len() >= u32::MAX as usize - CORNERS_PER_POLL as usize {
            return Err(MeshError::broken("the file has more than 4 billion different corners"));
        }
        Ok(())
    }

    /// Empties the set, for a part that shares no vertices with those before it.
    pub fn clear(&mut self) {
        // Clearing takes time in proportion to the capacity: after one large part, many small ones
        // must not each pay for that.
        if self.numbers.len() < self.numbers.capacity() / 16 {
            self.numbers = RapidHashMap::default();
        } else {
            self.numbers.clear();
        }
    }
}
