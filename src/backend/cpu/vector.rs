//! Vectors of three, for the stages shade and lines.

/// Scalar product.
#[inline(always)]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// `a - b`
#[inline(always)]
pub fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Vector product.
#[inline(always)]
pub fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Component of `v` at right angles to the unit vector `n`; about unit length where it is not zero.
pub fn across(v: [f32; 3], n: [f32; 3]) -> [f32; 3] {
    let largest = v.iter().fold(0.0_f32, |most, c| most.max(c.abs()));
    let v = if largest > 0.0 { v.map(|c| c / largest) } else { v };
    let along = dot(v, n);
    std::array::from_fn(|k| v[k] - along * n[k])
}

/// The unit vector, or `otherwise` where `v` is too short or too long to have a direction.
pub fn unit_or(v: [f32; 3], otherwise: [f32; 3]) -> [f32; 3] {
    let length_squared = dot(v, v);
    if length_squared > 1e-20 && length_squared < 1e30 { v.map(|c| c / length_squared.sqrt()) } else { otherwise }
}

/// A face's unit normal on the viewer's side. It is not normalised again, so that it keeps its
/// bits.
#[inline(always)]
pub fn turned_to_viewer(n: [f32; 3], front: bool) -> [f32; 3] {
    if front { n } else { n.map(|v| -v) }
}

/// The unit normal on the viewer's side of interpolated corner normals.
#[inline(always)]
pub fn facing(n: [f32; 3], front: bool) -> [f32; 3] {
    let length_squared = dot(n, n);
    let scale = if length_squared > 1e-20 { 1.0 / length_squared.sqrt() } else { 0.0 };
    let scale = if front { scale } else { -scale };
    n.map(|v| v * scale)
}
