//! f32 to IEEE half floats.

/// The nearest half float, ties to even; what is too large becomes infinite.
///
/// Normal results are rounded in the integer bits. For subnormal ones, adding 0.5 puts the half's last place at the sum's
/// last place, and the adder rounds (the method of Fabian Giesen's "Float->half variants").
pub fn half(v: f32) -> u16 {
    let bits = v.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    let magnitude = bits & 0x7fff_ffff;
    let half = if magnitude > 0x7f80_0000 {
        0x7e00
    } else if magnitude >= 0x4780_0000 {
        0x7c00
    } else if magnitude < 0x3880_0000 {
        (f32::from_bits(magnitude) + 0.5).to_bits() - 0.5_f32.to_bits()
    } else {
        let odd = magnitude >> 13 & 1;
        (magnitude - (112 << 23) + 0xfff + odd) >> 13
    };
    sign | half as u16
}

#[cfg(test)]
mod tests {
    use super::half;

    /// By the definition of the format.
    fn value(half: u16) -> f64 {
        let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 1023));
        let magnitude = match exponent {
            0 => fraction * 2.0_f64.powi(-24),
            31 => f64::INFINITY,
            e => (1.0 + fraction / 1024.0) * 2.0_f64.powi(e - 15),
        };
        if half & 0x8000 == 0 { magnitude } else { -magnitude }
    }

    #[test]
    fn every_half_and_every_midpoint_rounds_as_it_should() {
        let mut checked = 0;
        for sign in [0, 0x8000] {
            for low in 0..0x7c00_u16 {
                let next = low + 1;
                let (a, b) = (value(low), if next == 0x7c00 { 65536.0 } else { value(next) });
                let signed = |v: f64| if sign == 0 { v as f32 } else { -v as f32 };
                let middle = signed((a + b) / 2.0);
                assert_eq!(f64::from(middle).abs(), (a + b) / 2.0, "a midpoint is an f32");
                let even = if low % 2 == 0 { low } else { next };
                assert_eq!(half(signed(a)), low | sign);
                assert_eq!(half(middle), even | sign, "midpoint above {low:#06x}");
                assert_eq!(half(f32::from_bits(middle.to_bits() - 1)), low | sign);
                assert_eq!(half(f32::from_bits(middle.to_bits() + 1)), next | sign);
                checked += 4;
            }
        }
        assert_eq!(checked, 2 * 4 * 0x7c00);
        assert_eq!(half(f32::INFINITY), 0x7c00);
        assert_eq!(half(f32::NEG_INFINITY), 0xfc00);
        assert_eq!(half(f32::MAX), 0x7c00);
        assert_eq!(half(f32::NAN) & 0x7fff, 0x7e00);
        assert_eq!(half(f32::MIN_POSITIVE), 0);
    }
}
