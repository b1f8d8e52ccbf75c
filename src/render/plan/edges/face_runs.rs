//! Runs of 32 consecutive faces of a mesh, each with a bounding box and a cone that contains its
//! normals. From these, `view_of_runs` finds for a whole run which side it shows to the viewer and
//! where on screen it lies.
//!
//! Consecutive faces are mostly neighbours. If they are not, the box and the cone are wide and tell
//! little, and each face has to be looked at.

use std::ops::Range;

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::mesh::edges::{Edge, EdgeList};
use crate::mesh::vector::{cross, dot, sub};
use crate::parallel::map;

/// Faces of a run.
pub const FACES: usize = 32;

/// Runs that a thread takes at a time.
const CHUNK: usize = 512;

/// The share of its sides' product that twice a face's area must have, so that rounding leaves its normal
/// alone.
const NEEDLE: f64 = 1e-8;

/// Errors that rounding to f32 makes in a cone.
const ROUNDED: f64 = 1e-6;

/// The faces `FACES r` and following, and the edges that come with them: those whose first face is one of
/// them. Box and cone contain the other faces of these edges, too.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaceRun {
    /// The box's lower and upper corner.
    pub bounds: [[f32; 3]; 2],
    /// The cone's axis, a unit vector.
    pub axis: [f32; 3],
    /// The least cosine of the angle between a normal and the axis.
    pub cos: f32,
    /// Twice the least area of a face; 0 where a face has no certain normal.
    pub least_area: f32,
    /// The number of the first edge.
    pub first_edge: u32,
    /// True if each edge has two faces of one material, which agree which side is out.
    pub is_plain: bool,
}

/// The runs of a mesh, in order.
#[derive(Debug, Default)]
pub struct FaceRuns {
    /// The runs.
    pub runs: Vec<FaceRun>,
    edge_count: usize,
}

impl FaceRuns {
    /// Those of a mesh with these edges.
    pub fn of(mesh: &Mesh, list: &EdgeList, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let count = mesh.triangles.len().div_ceil(FACES);
        budget.spend("runs of faces", count as u64, size_of::<FaceRun>() as u64)?;
        let mut runs = vec![FaceRun::default(); count];
        map(runs.chunks_mut(CHUNK).enumerate().collect(), |(i, chunk): (usize, &mut [FaceRun])| {
            let first_face = (i * CHUNK * FACES) as u32;
            let mut edge = list.edges.partition_point(|edge| edge.faces[0] < first_face);
            for (run, r) in chunk.iter_mut().zip(i * CHUNK..) {
                let faces = r * FACES..mesh.triangles.len().min((r + 1) * FACES);
                let of_run = list.edges[edge..].iter().take_while(|edge| (edge.faces[0] as usize) < faces.end).count();
                *run = run_of(mesh, list, faces, edge..edge + of_run);
                edge += of_run;
            }
        });
        Ok(Self { runs, edge_count: list.len() })
    }

    /// The faces of a run, of a mesh with so many.
    pub fn faces(r: usize, count: usize) -> Range<usize> {
        r * FACES..count.min((r + 1) * FACES)
    }

    /// The edges that come with a run.
    pub fn edges(&self, r: usize) -> Range<usize> {
        let end = self.runs.get(r + 1).map_or(self.edge_count, |next| next.first_edge as usize);
        self.runs[r].first_edge as usize..end
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.runs[..])
    }
}

/// The run of some faces and the edges that come with them.
fn run_of(mesh: &Mesh, list: &EdgeList, faces: Range<usize>, edges: Range<usize>) -> FaceRun {
    let mut run = FaceRun {
        bounds: [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]],
        first_edge: edges.start as u32,
        is_plain: true,
        ..FaceRun::default()
    };
    let mut normals = [[0.0_f64; 3]; 4 * FACES];
    let (mut count, mut sum, mut least_area) = (0, [0.0; 3], f64::INFINITY);
    let mut add = |face: usize| {
        let corners = mesh.triangles[face].map(|v| mesh.positions[v as usize]);
        for corner in &corners {
            run.bounds[0] = std::array::from_fn(|k| run.bounds[0][k].min(corner[k]));
            run.bounds[1] = std::array::from_fn(|k| run.bounds[1][k].max(corner[k]));
        }
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        let (p, q) = (sub(b, a), sub(c, a));
        let normal = cross(p, q);
        let area = dot(normal, normal).sqrt();
        let is_certain = area > NEEDLE * (dot(p, p) * dot(q, q)).sqrt();
        least_area = least_area.min(if is_certain { area } else { 0.0 });
        let normal = normal.map(|v| if is_certain { v / area } else { 0.0 });
        sum = [0, 1, 2].map(|k| sum[k] + normal[k]);
        normals[count] = normal;
        count += 1;
    };
    faces.clone().for_each(&mut add);
    let materials = &mesh.triangle_materials;
    let mut is_plain = true;
    for edge in edges.map(|i| list.get(i)) {
        let [first, second] = edge.faces;
        is_plain &= edge.face_count == 2 && !edge.has_inconsistent_winding;
        if second != Edge::NO_FACE {
            is_plain &= materials[first as usize] == materials[second as usize];
            if !faces.contains(&(second as usize)) {
                add(second as usize);
            }
        }
    }
    let length = dot(sum, sum).sqrt();
    if length < NEEDLE || least_area <= 0.0 {
        return FaceRun { cos: -1.0, is_plain, ..run };
    }
    run.axis = sum.map(|v| (v / length) as f32);
    let axis = run.axis.map(f64::from);
    let cos = normals[..count].iter().map(|normal| dot(*normal, axis)).fold(1.0, f64::min);
    FaceRun { cos: (cos - ROUNDED) as f32, least_area: (least_area * (1.0 - ROUNDED)) as f32, is_plain, ..run }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;

    #[test]
    fn runs_have_all_edges_and_contain_their_faces() {
        let [columns, rows] = [70, 40];
        let at = |i: u32, j: u32| [i as f32 / 100.0 - 0.4, j as f32 / 100.0, ((i * i + 3 * j) % 7) as f32 / 2000.0];
        let positions: Vec<_> = (0..columns * rows).map(|v| at(v % columns, v / columns)).collect();
        let squares = (0..(columns - 1) * (rows - 1)).map(|k| k / (columns - 1) * columns + k % (columns - 1));
        let triangles: Vec<_> =
            squares.flat_map(|a| [[a, a + 1, a + columns + 1], [a, a + columns + 1, a + columns]]).collect();
        let triangle_materials = (0..triangles.len() as u32).map(|t| t / 1000).collect();
        let edge_masks = vec![7; triangles.len()];
        let mesh = Mesh { positions, triangles, edge_masks, triangle_materials, ..Mesh::default() };
        let mut budget = Budget::new(&Limits::default());
        let list = EdgeList::of(&mesh, &mut budget).unwrap();
        let before = budget.spent_bytes();
        let runs = FaceRuns::of(&mesh, &list, &mut budget).unwrap();
        assert_eq!(budget.spent_bytes() - before, runs.bytes() as u64);
        let (mut next_edge, mut plain) = (0, 0);
        for (r, run) in runs.runs.iter().enumerate() {
            let faces = FaceRuns::faces(r, mesh.triangles.len());
            let edges = runs.edges(r);
            assert_eq!(edges.start, next_edge);
            next_edge = edges.end;
            assert!(edges.clone().all(|i| faces.contains(&(list.get(i).faces[0] as usize))));
            let is_plain = |i: usize| {
                let [a, b] = list.get(i).faces;
                b != Edge::NO_FACE && a / 1000 == b / 1000
            };
            assert_eq!(run.is_plain, edges.clone().all(is_plain));
            plain += usize::from(run.is_plain);
            let others = edges.map(|i| list.get(i).faces[1] as usize).filter(|&face| face < mesh.triangles.len());
            for face in faces.chain(others) {
                let corners = mesh.triangles[face].map(|v| mesh.positions[v as usize]);
                let is_within = |p: [f32; 3]| (0..3).all(|k| (run.bounds[0][k]..=run.bounds[1][k]).contains(&p[k]));
                assert!(corners.into_iter().all(is_within));
                let [a, b, c] = corners.map(|corner| corner.map(f64::from));
                let normal = cross(sub(b, a), sub(c, a));
                let area = dot(normal, normal).sqrt();
                assert!(dot(normal, run.axis.map(f64::from)) >= f64::from(run.cos) * area && run.cos > 0.0);
                assert!(area >= f64::from(run.least_area) && run.least_area > 0.0);
            }
        }
        assert!(next_edge == list.len() && plain > 50 && plain < runs.runs.len() - 10, "{plain}");
    }
}
