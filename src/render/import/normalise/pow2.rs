//! Scaling by powers of two for the whole range of f64, exact unless the result over- or
//! underflows.

/// Larger coordinates count as infinite. Sums and differences of two smaller ones cannot overflow.
pub const TOO_LARGE: f64 = 4.49423283715579e307; // about 2^1022

/// True if a position is finite and small enough to compute with.
#[inline(always)]
pub fn is_usable(p: &[f64; 3]) -> bool {
    // False for NaN.
    (p[0].abs() < TOO_LARGE) & (p[1].abs() < TOO_LARGE) & (p[2].abs() < TOO_LARGE)
}

/// Multiplies by a power of two that need not itself be an f64.
#[derive(Clone, Copy, Debug)]
pub struct Pow2([f64; 2]);

impl Pow2 {
    /// `2^exponent`, for exponents between -2000 and 2000.
    pub fn new(exponent: i32) -> Self {
        let half = exponent / 2;
        Self([libm::ldexp(1.0, half), libm::ldexp(1.0, exponent - half)])
    }

    /// `v * 2^exponent`, exact unless it under- or overflows.
    #[inline(always)]
    pub fn of(self, v: f64) -> f64 {
        v * self.0[0] * self.0[1]
    }

    /// The same for a vector.
    #[inline(always)]
    pub fn of3(self, v: [f64; 3]) -> [f64; 3] {
        [self.of(v[0]), self.of(v[1]), self.of(v[2])]
    }
}

/// The smallest `e` with `v <= 2^e`, for finite `v > 0`. `v / 2^e` is then in (0.5, 1].
pub fn exponent(v: f64) -> i32 {
    let (mantissa, e) = libm::frexp(v);
    if mantissa == 0.5 { e - 1 } else { e }
}

/// The largest magnitude among some components.
pub fn max_abs(v: &[f64; 3]) -> f64 {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_power_of_two_is_found_and_undone() {
        let mut cases = 0;
        for e in -1074..=1020 {
            let v = Pow2::new(e).of(1.0);
            assert_eq!(exponent(v), e);
            assert_eq!(Pow2::new(-e).of(v), 1.0);
            if e > -1000 {
                assert_eq!(exponent(v * 1.5), e + 1);
            }
            cases += 1;
        }
        assert_eq!(cases, 2095);
    }
}
