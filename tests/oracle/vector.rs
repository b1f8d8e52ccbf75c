//! Vectors as arrays.

pub type V2 = [f64; 2];
pub type V3 = [f64; 3];

pub fn sub<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|k| a[k] - b[k])
}

pub fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (0..N).map(|k| a[k] * b[k]).sum()
}

/// `a + t (b - a)`.
pub fn mix<const N: usize>(a: [f64; N], b: [f64; N], t: f64) -> [f64; N] {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

pub fn length<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

pub fn unit<const N: usize>(a: [f64; N]) -> [f64; N] {
    let length = length(a);
    a.map(|v| v / length)
}

/// The z of the vector product: positive where `b` lies clockwise of `a` on screen, where y points
/// down.
pub fn cross2(a: V2, b: V2) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Distance of `p` from the segment `a` to `b`.
pub fn distance_to_segment(p: V2, a: V2, b: V2) -> f64 {
    let along = sub(b, a);
    let squared = dot(along, along);
    let t = if squared > 0.0 { (dot(sub(p, a), along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    length(sub(p, mix(a, b, t)))
}
