//! The side of a plane on which a point lies, exactly: by floating point where rounding cannot change the sign, else
//! by integers where the coordinates fit, else by the crate [`robust`].

use robust::{Coord3D, orient3d};

use super::Point;

/// Rounding of a determinant in floating point, in parts of the sum of the absolute values of its terms: Shewchuk,
/// *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997, bound A of ORIENT3D.
const ROUNDING: f64 = (7.0 + 56.0 * EPSILON) * EPSILON;

/// Half a unit in the last place of 1.
const EPSILON: f64 = f64::EPSILON / 2.0;

/// Bits of a difference of coordinates as an integer: three of them multiplied, six such products and a sign fit 128.
const BITS: i32 = 39;

/// Positive if `d` lies on the side of the plane through `a`, `b` and `c` from which they appear clockwise, negative on the other,
/// 0 on the plane. The sign is exact, the value is not.
pub fn orient([a, b, c]: [Point; 3], d: Point) -> f64 {
    let from = |p: Point| -> Point { std::array::from_fn(|k| p[k] - d[k]) };
    let rows = [from(a), from(b), from(c)];
    let terms = |k: usize| {
        let (p, q) = (rows[(k + 1) % 3], rows[(k + 2) % 3]);
        (rows[k][2], p[0] * q[1], q[0] * p[1])
    };
    let (mut value, mut size) = (0.0, 0.0);
    for (z, pq, qp) in [terms(0), terms(1), terms(2)] {
        value += z * (pq - qp);
        size += z.abs() * (pq.abs() + qp.abs());
    }
    if value.abs() > ROUNDING * size {
        return value;
    }
    by_integers([a, b, c, d], &rows).unwrap_or_else(|| {
        let [a, b, c, d] = [a, b, c, d].map(|[x, y, z]| Coord3D { x, y, z });
        orient3d(a, b, c, d)
    })
}

/// The determinant's sign, if all coordinates are multiples of a power of two of which differences are few enough.
fn by_integers(points: [Point; 4], rows: &[Point; 3]) -> Option<f64> {
    let largest = rows.iter().flatten().fold(0.0, |largest: f64, v| largest.max(v.abs()));
    // A power of two not above the largest difference, by its exponent bits.
    let exponent = (largest.to_bits() >> 52) as i32 - 1023;
    if !(-800..800).contains(&exponent) {
        return None;
    }
    let unit = f64::from_bits(((exponent + 1 - BITS + 1023) as u64) << 52);
    // Adding this rounds to multiples of the unit. It is exact where they are such, and then so are their differences.
    let rounder = unit * 1.5 * (1_u64 << 52) as f64;
    let coordinate_max = unit * (1_u64 << 50) as f64;
    let is_multiple = |v: f64| v.abs() <= coordinate_max && (v + rounder) - rounder == v;
    if !points.iter().flatten().all(|&v| is_multiple(v)) {
        return None;
    }
    let whole = |v: f64| (v / unit) as i64;
    let [a, b, c] = rows.map(|row| row.map(whole));
    let minor = |p: [i64; 3], q: [i64; 3]| i128::from(p[0]) * i128::from(q[1]) - i128::from(q[0]) * i128::from(p[1]);
    let sum = i128::from(a[2]) * minor(b, c) + i128::from(b[2]) * minor(c, a) + i128::from(c[2]) * minor(a, b);
    Some(sum.signum() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by_robust(points: [Point; 4]) -> f64 {
        let [a, b, c, d] = points.map(|[x, y, z]| Coord3D { x, y, z });
        orient3d(a, b, c, d)
    }

    /// Points in a plane, beside it by the last digit, and anywhere, of all sizes.
    #[test]
    fn signs_are_those_of_the_exact_library() {
        let mut state = 1_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let (mut cases, mut integers, mut zeros) = (0, 0, 0);
        for round in 0..60_000 {
            let scale = [1.0, 1e-3, 7.3e4, 1e-30, 3e15][round % 5];
            let grid = [8, 1000, 1 << 20][round / 5 % 3];
            let mut coordinate = || ((random() % (2 * grid)) as f64 - grid as f64) * scale;
            let mut point = || -> Point { std::array::from_fn(|_| f64::from(coordinate() as f32)) };
            let [a, b, c] = [point(), point(), point()];
            let mut d: Point = match round % 4 {
                // A corner of their parallelogram: in their plane, if no digit is lost.
                0 | 1 => std::array::from_fn(|k| f64::from((a[k] + b[k] - c[k]) as f32)),
                2 => a,
                _ => point(),
            };
            if round % 8 == 1 {
                d[round % 3] = f64::from((d[round % 3] as f32).next_up());
            }
            let want = by_robust([a, b, c, d]);
            let same = |got: f64| (got > 0.0, got < 0.0) == (want > 0.0, want < 0.0);
            assert!(same(orient([a, b, c], d)), "{a:?} {b:?} {c:?} {d:?}");
            let rows = [a, b, c].map(|p| std::array::from_fn(|k| p[k] - d[k]));
            if let Some(got) = by_integers([a, b, c, d], &rows) {
                assert!(same(got), "{a:?} {b:?} {c:?} {d:?}");
                integers += 1;
            }
            zeros += usize::from(want == 0.0);
            cases += 1;
        }
        assert_eq!(cases, 60_000);
        assert!(integers > 40_000 && zeros > 10_000, "{integers} {zeros}");
        // Those that do not fit are left to the library.
        let far = [[1.0, 0.0, 0.0], [0.0, 1e-20, 0.0], [0.0, 0.0, 1.0], [1e30, 1.0, 1.0]];
        let rows = [0, 1, 2].map(|i: usize| std::array::from_fn(|k| far[i][k] - far[3][k]));
        assert_eq!(by_integers(far, &rows), None);
    }
}
