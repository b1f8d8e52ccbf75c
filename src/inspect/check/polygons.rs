//! Polygons with more than four corners, for the rule `no-ngons`. Reading has divided all polygons into triangles and
//! has marked the edges that it added, so that the triangles of one polygon can be put together again here: more than
//! two of them make such a polygon. A polygon may be missed if reading has dropped a triangle of it that had no area.

use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::union_find::UnionFind;

/// Memory per triangle: up to three edges that are sorted, its set, its count.
const BYTES_PER_TRIANGLE: u64 = 3 * 12 + 4 + 4;

/// The first triangle of each polygon with more than four corners, as far as all its triangles have an area.
pub fn ngons(mesh: &Mesh, budget: &mut Budget) -> Result<Vec<u32>, LimitExceeded> {
    budget.spend("the polygons", mesh.triangles.len() as u64, BYTES_PER_TRIANGLE)?;
    let mut inner: Vec<([u32; 2], u32)> = Vec::new();
    for ((face, t), mask) in (0_u32..).zip(&mesh.triangles).zip(&mesh.edge_masks) {
        let edges = (0..3).filter(|k| mask & (1 << k) == 0).map(|k| [t[k], t[(k + 1) % 3]]);
        inner.extend(edges.map(|[a, b]| ([a.min(b), a.max(b)], face)));
    }
    inner.sort_unstable();
    let mut sets = UnionFind::new(mesh.triangles.len());
    // An edge within a polygon has two of its triangles. Polygons that repeat each other have the same edges, one
    // after the other.
    for same in inner.chunk_by(|a, b| a.0 == b.0) {
        same.as_chunks::<2>().0.iter().for_each(|[(_, one), (_, other)]| {
            sets.unite(*one, *other);
        });
    }
    let mut counts = vec![0_u32; mesh.triangles.len()];
    (0..counts.len() as u32).for_each(|face| counts[sets.find(face) as usize] += 1);
    // A quadrilateral has two triangles. A set goes by its lowest face.
    Ok((0_u32..).zip(&counts).filter(|(_, count)| **count > 2).map(|(face, _)| face).collect())
}
