//! How far and where to each vertex of a hull moves: what lies on the hull's own silhouette so far that the edges there, not the
//! corners, keep their distance.

use super::{HullOffset, Projection, roles};
use crate::mesh::Mesh;

/// Farthest that a corner moves, in widths of the outline.
const MITER_MAX: f64 = 2.0;

/// Of the sum of two unit vectors: less is rounding, of edges that cancelled each other.
const CANCELLED: f64 = 1e-9;

/// A sum of two unit vectors that is this long has corners so blunt that it does not matter which way they turn.
const BLUNT: f64 = 1.99;

/// Cosine of the angle up to which a silhouette's normal may differ from the surface's: where the border of the back faces runs to and
/// fro, as it does on saddles, its corners say nothing of the shape.
const ALIKE: f64 = 0.5;

/// How far each position moves, where parts differ or where the silhouette turns; else empty, and all move by the first offset.
///
/// A position that several parts share moves as far as the thickest of them, so that their hulls do not tear. (All offsets have the
/// same unit.)
pub fn amounts(mesh: &Mesh, offsets: &[Option<HullOffset>]) -> Vec<f32> {
    let mut amounts = vec![0.0_f32; mesh.positions.len()];
    for (triangle, &material) in mesh.triangles.iter().zip(&mesh.triangle_materials) {
        if let Some(Some(HullOffset::Object(amount) | HullOffset::Px(amount))) = offsets.get(material as usize) {
            for &v in triangle {
                amounts[v as usize] = amounts[v as usize].max(*amount);
            }
        }
    }
    amounts
}

/// Turns the normals and lengthens the amounts (pixels) of the positions on the silhouette of the hull's triangles, those of parts that
/// have an offset, so that on screen both edges that meet in one move by the amount.
pub fn miter(
    mesh: &Mesh,
    projection: &Projection,
    offsets: &[Option<HullOffset>],
    normals: &mut [[f32; 3]],
    amounts: &mut [f32],
) {
    let on_screen = on_screen(mesh, projection);
    let is_drawn = |material: u32| offsets.get(material as usize).is_some_and(Option::is_some);
    let drawn = mesh.triangles.iter().zip(&mesh.triangle_materials).filter(|(_, material)| is_drawn(**material));
    // Back faces run clockwise on screen, where y points down. With a corner behind the eye the area is NaN.
    let backs = drawn.map(|(triangle, _)| triangle).filter(|t| area(t.map(|v| on_screen[v as usize])) > 0.0);
    let sums = sums(&on_screen, backs.clone());
    let corners = corners(&on_screen, &sums, backs);
    for (v, sum) in sums.iter().enumerate() {
        let length = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt();
        if length <= CANCELLED {
            continue;
        }
        // Out is to the left of the way, on screen.
        let out = [sum[1] / length, -sum[0] / length];
        let surface = on_screen_direction(projection, on_screen[v], normals[v]);
        if out[0] * surface[0] + out[1] * surface[1] < ALIKE {
            continue;
        }
        let amount = f64::from(amounts[v]);
        let miter = (2.0 / length).clamp(1.0, MITER_MAX);
        // In a notch that is narrower than the outline the two edges' lines meet far beyond its other side.
        let room = if corners[v].angle > std::f64::consts::PI { corners[v].shortest } else { f64::INFINITY };
        let (right, up) = (projection.screen_right, projection.screen_up);
        normals[v] = std::array::from_fn(|k| (out[0] * f64::from(right[k]) - out[1] * f64::from(up[k])) as f32);
        if 256.0 * amount * miter <= room {
            amounts[v] = (amount * miter) as f32;
        }
    }
}

/// Takes what is seen from the front out of the hull, as it will be: corners that move apart might turn a thin face over, and then it
/// would lie black before the surface. `of_triangles` are [`DrawPlan::roles`](super::DrawPlan::roles).
pub fn leave_out_fronts(mesh: &Mesh, projection: &Projection, of_triangles: &mut Vec<u8>) {
    of_triangles.resize(mesh.triangles.len(), roles::SURFACE | roles::HULL);
    let on_screen = on_screen(mesh, projection);
    for (triangle, role) in mesh.triangles.iter().zip(of_triangles) {
        if area(triangle.map(|v| on_screen[v as usize])) < 0.0 {
            *role &= !roles::HULL;
        }
    }
}

/// Each position in 1/256 px from the picture's centre; NaN behind the eye.
fn on_screen(mesh: &Mesh, projection: &Projection) -> Vec<[f64; 2]> {
    mesh.positions.iter().map(|p| place(projection, p)).collect()
}

/// At each position the sum of the unit directions in which the silhouette comes and goes.
///
/// The silhouette is where back faces end. Run around every back face and add up the directions in which its edges pass each
/// corner: edges between two back faces are passed both ways and cancel. What is left, turned by a quarter, is the sum of the
/// normals of two edges, n1 + n2, and the point at distance 1 from both lies at 2 (n1 + n2) / |n1 + n2|^2. This needs no
/// knowledge of neighbours.
fn sums<'t>(on_screen: &[[f64; 2]], backs: impl Iterator<Item = &'t [u32; 3]>) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0_f64; 2]; on_screen.len()];
    for triangle in backs {
        for k in 0..3 {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            let way = minus(on_screen[ends[1] as usize], on_screen[ends[0] as usize]);
            let length = dot(way, way).sqrt();
            if length > 0.0 {
                for v in ends {
                    let sum = &mut sums[v as usize];
                    *sum = [sum[0] + way[0] / length, sum[1] + way[1] / length];
                }
            }
        }
    }
    sums
}

/// Of a position: the angle that back faces fill there, and the shortest of their edges.
#[derive(Clone, Copy)]
struct Corner {
    angle: f64,
    shortest: f64,
}

/// Where the silhouette turns; elsewhere the angle is 0.
fn corners<'t>(on_screen: &[[f64; 2]], sums: &[[f64; 2]], backs: impl Iterator<Item = &'t [u32; 3]>) -> Vec<Corner> {
    let mut corners = vec![Corner { angle: 0.0, shortest: f64::INFINITY }; on_screen.len()];
    for triangle in backs {
        for k in 0..3 {
            let [v, next, prev] = [0, 1, 2].map(|i| triangle[(k + i) % 3] as usize);
            let turns = dot(sums[v], sums[v]);
            if turns > CANCELLED * CANCELLED && turns < BLUNT * BLUNT {
                let (a, b) = (minus(on_screen[next], on_screen[v]), minus(on_screen[prev], on_screen[v]));
                corners[v].angle += libm::atan2(a[0] * b[1] - a[1] * b[0], dot(a, b));
                corners[v].shortest = corners[v].shortest.min(dot(a, a).min(dot(b, b)).sqrt());
            }
        }
    }
    corners
}

/// The unit direction in which a position moves on screen when it moves along its normal; 0 if it does not.
fn on_screen_direction(projection: &Projection, at: [f64; 2], normal: [f32; 3]) -> [f64; 2] {
    let row = |r: &[f32; 4]| (0..3).map(|k| f64::from(r[k]) * f64::from(normal[k])).sum::<f64>();
    let w = row(&projection.w);
    let way = [row(&projection.x) - at[0] * w, row(&projection.y) - at[1] * w];
    let length = dot(way, way).sqrt();
    if length > 0.0 { way.map(|c| c / length) } else { way }
}

/// On screen, in 1/256 px, as back-ends see it; NaN where it is behind the eye.
fn place(projection: &Projection, p: &[f32; 3]) -> [f64; 2] {
    let p = p.map(f64::from);
    let row = |r: &[f32; 4]| {
        let r = r.map(f64::from);
        ((r[0] * p[0] + r[1] * p[1]) + r[2] * p[2]) + r[3]
    };
    let w = row(&projection.w);
    if w >= f64::from(projection.near_w) { [row(&projection.x) / w, row(&projection.y) / w] } else { [f64::NAN; 2] }
}

fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
