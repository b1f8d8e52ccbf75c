//! Arithmetic with vectors of three f64 (difference, scalar product, vector product), each operation
//! rounded by itself and in the written order.
//!
//! The operations of the crate glam are not used here. These sums decide which edges are drawn and which
//! volumes are reported, so the order of their terms is part of the result. A comparison that puts
//! positions in order is here, too.

/// `a - b`
pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The scalar product, summed from x to z.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product, right-handed.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// True if a position is not larger than another: `a <= b`, without branches, because the order of
/// positions cannot be predicted.
#[inline(always)]
pub fn is_in_order([ax, ay, az]: [f32; 3], [bx, by, bz]: [f32; 3]) -> bool {
    (ax < bx) | ((ax == bx) & ((ay < by) | ((ay == by) & (az <= bz))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_ordered_as_arrays_are() {
        let values = [-1.0, -0.0, 0.0, 0.5];
        let positions = || {
            values
                .into_iter()
                .flat_map(move |x| values.into_iter().flat_map(move |y| values.into_iter().map(move |z| [x, y, z])))
        };
        for a in positions() {
            assert!(positions().all(|b| is_in_order(a, b) == (a <= b)), "{a:?}");
        }
    }
}
