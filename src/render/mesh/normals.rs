//! Vertex normals for meshes whose files have none, which smooth shading needs. The normal at a
//! vertex is the mean of the normals of its faces, each weighted by the angle of the face's corner
//! there. So it does not depend on how a flat region was cut into triangles.

use rayon::prelude::*;

use super::vector::{dot, sub};

/// Memory that [`angle_weighted`] takes beside its result and a sum per position, bytes.
pub fn working_bytes(triangles: usize) -> u64 {
    (triangles.min(BLOCK) * size_of::<[f64; 3]>()) as u64
}

/// A unit normal per position: the mean of its faces' normals, each weighted by the angle of the
/// face's corner there. So the normals do not depend on how a flat region was cut into triangles.
pub fn angle_weighted(positions: &[[f32; 3]], triangles: &[[u32; 3]], face_normals: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0_f64; 3]; positions.len()];
    let angles_of = |triangle: &[u32; 3]| corner_angles(triangle.map(|v| positions[v as usize].map(f64::from)));
    // Angles are found by several threads, a block at a time. Sums keep the order of the triangles.
    let mut angles = vec![[0.0; 3]; triangles.len().min(BLOCK)];
    for (triangles, face_normals) in triangles.chunks(BLOCK).zip(face_normals.chunks(BLOCK)) {
        let find = |(angles, triangle): (&mut [f64; 3], &[u32; 3])| *angles = angles_of(triangle);
        if triangles.len() <= PIECE {
            angles.iter_mut().zip(triangles).for_each(find);
        } else {
            angles.par_iter_mut().zip(triangles).with_min_len(PIECE).for_each(find);
        }
        for ((triangle, normal), angles) in triangles.iter().zip(face_normals).zip(&angles) {
            let normal = normal.map(f64::from);
            for (&v, angle) in triangle.iter().zip(angles) {
                let sum = &mut sums[v as usize];
                for k in 0..3 {
                    sum[k] += normal[k] * angle;
                }
            }
        }
    }
    let mut normals: Vec<[f32; 3]> = sums.iter().map(|s| unit(*s).unwrap_or_default()).collect();
    // Where faces cancel each other, as on the two sides of a plate, the first face's normal is
    // taken.
    for (triangle, face_normal) in triangles.iter().zip(face_normals) {
        for &v in triangle {
            if normals[v as usize] == [0.0; 3] {
                normals[v as usize] = *face_normal;
            }
        }
    }
    normals
}

/// Triangles whose angles are kept at a time: 3 MiB.
const BLOCK: usize = 1 << 17;
/// Triangles that a thread does at least.
const PIECE: usize = 1 << 12;

/// The squared length, in radians, up to which a sum of weighted normals counts as cancelled: the
/// rest is rounding.
const CANCELLED_SQUARED: f64 = 1e-12;

/// The unit vector of a sum of weighted normals; None where they cancel each other.
pub(super) fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    let length2 = dot(v, v);
    (length2 > CANCELLED_SQUARED).then(|| {
        let length = length2.sqrt();
        v.map(|c| (c / length) as f32)
    })
}

/// The angles of a triangle's corners, radians.
pub(super) fn corner_angles([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
    let length = [dot(ab, ab), dot(bc, bc), dot(ca, ca)].map(f64::sqrt);
    let angle = |u: [f64; 3], v: [f64; 3], scale: f64| {
        // Welded positions differ, so no length is 0.
        acos((-dot(u, v) / scale).clamp(-1.0, 1.0))
    };
    [angle(ca, ab, length[2] * length[0]), angle(ab, bc, length[0] * length[1]), angle(bc, ca, length[1] * length[2])]
}

/// The arc cosine in radians, to within 5e-8: Abramowitz and Stegun, Handbook of Mathematical
/// Functions, 4.4.46.
///
/// It has the same bits on every machine and is several times faster than `libm::acos`. Weights
/// need no more digits.
fn acos(x: f64) -> f64 {
    let t = x.abs();
    let series = [-0.0012624911, 0.0066700901, -0.0170881256, 0.0308918810, -0.0501743046, 0.0889789874, -0.2145988016]
        .into_iter()
        .fold(0.0, |sum, c| (sum + c) * t);
    let angle = (1.0 - t).max(0.0).sqrt() * (series + std::f64::consts::FRAC_PI_2);
    if x < 0.0 { std::f64::consts::PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    #[test]
    fn the_fast_arc_cosine_is_close() {
        for i in -1000..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((acos(x) - libm::acos(x)).abs() < 5e-8, "{x}");
        }
    }

    /// A cube's corner normal is the diagonal however its quads are cut.
    #[test]
    fn cutting_a_quad_the_other_way_changes_nothing() {
        let h = 0.5_f32;
        let positions: Vec<[f32; 3]> = (0..8)
            .map(|i| {
                [if i & 1 == 0 { -h } else { h }, if i & 2 == 0 { -h } else { h }, if i & 4 == 0 { -h } else { h }]
            })
            .collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let normals =
            [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let mut cases = 0;
        for cuts in 0..64_u32 {
            let mut mesh = Mesh { positions: positions.clone(), ..Mesh::default() };
            for (i, (q, normal)) in quads.iter().zip(normals).enumerate() {
                let r: [u32; 4] = std::array::from_fn(|k| q[(k + (cuts >> i & 1) as usize) % 4]);
                mesh.triangles.extend([[r[0], r[1], r[2]], [r[0], r[2], r[3]]]);
                mesh.face_normals.extend([normal; 2]);
            }
            for (n, p) in angle_weighted(&mesh.positions, &mesh.triangles, &mesh.face_normals).iter().zip(&positions) {
                for k in 0..3 {
                    assert!((n[k] - p[k] * 2.0 / 3.0_f32.sqrt()).abs() < 1e-6);
                }
                cases += 1;
            }
        }
        assert_eq!(cases, 512);
    }

    #[test]
    fn both_sides_of_a_sheet_still_have_a_direction() {
        let mesh = Mesh {
            positions: vec![[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 1]],
            face_normals: vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
            ..Mesh::default()
        };
        assert_eq!(angle_weighted(&mesh.positions, &mesh.triangles, &mesh.face_normals), vec![[0.0, 0.0, 1.0]; 3]);
    }
}
