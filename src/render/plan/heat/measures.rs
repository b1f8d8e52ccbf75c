//! The numbers that diagnostic pictures show as colours: the quality of a triangle's shape, the
//! mean length of its edges, the stretch of its texture, and the mean curvature at a vertex. They
//! are computed in f64 without fused multiply-add, so that they are the same on every machine.

use super::CHECK_EVERY;
use crate::limits::Deadline;
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::mesh::vector::{cross, dot, sub};
use crate::plan::PlanError;

type Point = [f64; 3];

/// The quality of a triangle's shape: its area over the mean square of its sides, 1 for an equilateral
/// triangle and 0 for one without an area (Bank and Smith, "Mesh smoothing using a posteriori error
/// estimates", 1997).
pub fn shape_quality([a, b, c]: [Point; 3]) -> f64 {
    let squares = [sub(b, a), sub(c, b), sub(a, c)].map(|side| dot(side, side));
    let sum = (squares[0] + squares[1]) + squares[2];
    // 4 sqrt(3) times the area, which is half of the cross product's length.
    let quality = 3.464_101_615_137_754_4 * length(cross(sub(b, a), sub(c, a))) / sum;
    if sum > 0.0 { quality.clamp(0.0, 1.0) } else { 0.0 }
}

/// The mean length of a triangle's sides.
pub fn mean_edge([a, b, c]: [Point; 3]) -> f64 {
    ((length(sub(b, a)) + length(sub(c, b))) + length(sub(a, c))) / 3.0
}

/// The root mean square over all directions by which a texture is stretched on a triangle: the length on
/// the surface over the length in texture coordinates (the L2 stretch of Sander, Snyder, Gortler and Hoppe,
/// "Texture mapping progressive meshes", 2001). NaN where the texture coordinates have no area.
pub fn uv_stretch([q1, q2, q3]: [Point; 3], [t1, t2, t3]: [[f64; 2]; 3]) -> f64 {
    let twice = (t2[0] - t1[0]) * (t3[1] - t1[1]) - (t3[0] - t1[0]) * (t2[1] - t1[1]);
    if twice == 0.0 || !twice.is_finite() {
        return f64::NAN;
    }
    let derivative = |w1: f64, w2: f64, w3: f64| -> Point {
        std::array::from_fn(|k| ((q1[k] * w1 + q2[k] * w2) + q3[k] * w3) / twice)
    };
    let along_u = derivative(t2[1] - t3[1], t3[1] - t1[1], t1[1] - t2[1]);
    let along_v = derivative(t3[0] - t2[0], t1[0] - t3[0], t2[0] - t1[0]);
    ((dot(along_u, along_u) + dot(along_v, along_v)) / 2.0).sqrt()
}

/// The factor by which the stretch of a mesh is 1 if all its texture is as large as on the average: the
/// root of the area in texture coordinates over the area of the surface.
pub fn uv_scale(mesh: &Mesh) -> f64 {
    let (mut surface, mut texture) = (0.0, 0.0);
    for (triangle, attributes) in mesh.triangles.iter().zip(&mesh.attribute_triangles) {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].map(f64::from));
        let [s, t, u] = attributes.map(|v| mesh.uvs[v as usize].map(f64::from));
        surface += length(cross(sub(b, a), sub(c, a)));
        texture += ((t[0] - s[0]) * (u[1] - s[1]) - (u[0] - s[0]) * (t[1] - s[1])).abs();
    }
    if surface > 0.0 { (texture / surface).sqrt() } else { 1.0 }
}

/// The mean curvature at each position, per unit of the box: positive where the surface bends outwards.
/// It is a quarter of the sum of angle times length over the edges there, per third of the area of the
/// faces there (Cohen-Steiner and Morvan, "Restricted Delaunay triangulations and normal cycle", 2003).
pub fn curvatures(mesh: &Mesh, edges: &EdgeList, deadline: &Deadline) -> Result<Vec<f32>, PlanError> {
    let position = |v: u32| mesh.positions[v as usize].map(f64::from);
    let mut sums = vec![[0.0_f64; 2]; mesh.positions.len()];
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        if face % CHECK_EVERY == 0 {
            deadline.check()?;
        }
        let [a, b, c] = triangle.map(position);
        let third = length(cross(sub(b, a), sub(c, a))) / 6.0;
        triangle.iter().for_each(|&v| sums[v as usize][1] += third);
    }
    for (i, edge) in edges.iter().enumerate() {
        if i % CHECK_EVERY == 0 {
            deadline.check()?;
        }
        if edge.face_count != 2 || edge.has_inconsistent_winding {
            continue;
        }
        let [first, second] = edge.faces.map(|face| mesh.face_normals[face as usize].map(f64::from));
        let (from, to) = (position(edge.vertices[0]), position(edge.vertices[1]));
        // Along the edge as the first face runs: to its left is that face.
        let along =
            if runs(mesh.triangles[edge.faces[0] as usize], edge.vertices) { sub(to, from) } else { sub(from, to) };
        let size = length(along);
        if size == 0.0 {
            continue;
        }
        let angle = libm::atan2(dot(cross(first, second), along) / size, dot(first, second));
        edge.vertices.iter().for_each(|&v| sums[v as usize][0] += 0.25 * angle * size);
    }
    Ok(sums.iter().map(|[bend, area]| if *area > 0.0 { (bend / area) as f32 } else { 0.0 }).collect())
}

/// True if a triangle has an edge in this direction.
fn runs([a, b, c]: [u32; 3], [from, to]: [u32; 2]) -> bool {
    [[a, b], [b, c], [c, a]].contains(&[from, to])
}

fn length(v: Point) -> f64 {
    dot(v, v).sqrt()
}
