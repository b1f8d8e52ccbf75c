//! The filters of meshopt compression, in the extension's own formulas. A filter decodes values
//! that are already unpacked (unit vectors, quaternions, floats or colours); they are
//! little-endian, and are replaced in place.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_meshopt_compression#filters>

/// Decodes octahedral unit vectors: x, y and the value that stands for 1. The fourth component
/// stays. A component has `size` bytes, 1 or 2.
pub fn octahedral(bytes: &mut [u8], size: usize) {
    let largest = if size == 1 { 127.0 } else { 32767.0 };
    for element in bytes.chunks_exact_mut(size * 4) {
        let [x, y, one] = [0, 1, 2].map(|k| signed(element, size, k));
        if one == 0.0 {
            continue;
        }
        let (mut x, mut y) = (x / one, y / one);
        let z = 1.0 - x.abs() - y.abs();
        let t = (-z).max(0.0);
        x -= t.copysign(x);
        y -= t.copysign(y);
        let length = (x * x + y * y + z * z).sqrt();
        for (k, v) in [x, y, z].into_iter().enumerate() {
            store(element, size, k, round(v / length * largest));
        }
    }
}

/// Decodes unit quaternions of 16 bits: three components, then a scale with the index of the
/// omitted one.
pub fn quaternion(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let [x, y, z, last] = [0, 1, 2, 3].map(|k| signed(element, 2, k));
        let last = last as i32;
        let scale = std::f64::consts::FRAC_1_SQRT_2 / f64::from(last | 3);
        let [x, y, z] = [x, y, z].map(|v| v * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let left_out = (last & 3) as usize;
        for (k, v) in [w, x, y, z].into_iter().enumerate() {
            store(element, 2, (left_out + k) % 4, round(v * 32767.0));
        }
    }
}

/// Decodes floats with 8 bits of exponent over 24 of mantissa, both signed.
pub fn exponential(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(4) {
        let word = i32::from_le_bytes([element[0], element[1], element[2], element[3]]);
        let (mantissa, exponent) = (f64::from(word << 8 >> 8), word >> 24);
        // Exact: 24 bits times a power of two.
        let value = mantissa * f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52);
        element.copy_from_slice(&(value as f32).to_le_bytes());
    }
}

/// Decodes RGBA from Y, Co, Cg and alpha. The highest set bit of alpha tells their bit depth.
pub fn color(bytes: &mut [u8], size: usize) {
    let largest = if size == 1 { 255.0 } else { 65535.0 };
    for element in bytes.chunks_exact_mut(size * 4) {
        let [y, alpha] = [0, 3].map(|k| signed(element, size, k) as i64 & largest as i64);
        let [co, cg] = [1, 2].map(|k| signed(element, size, k) as i64);
        let bits = 64 - alpha.leading_zeros();
        if bits == 0 {
            continue;
        }
        let all = (1_i64 << bits) - 1;
        // Alpha has a bit less than the others; its lowest is doubled.
        let alpha = (alpha << 1 & all) | (alpha & 1);
        for (k, v) in [y + co - cg, y + cg, y - co - cg, alpha].into_iter().enumerate() {
            let v = (v as f64 * largest / all as f64).clamp(0.0, largest);
            store(element, size, k, round(v));
        }
    }
}

/// Rounds to nearest, halves away from zero, as the extension does.
fn round(v: f64) -> i64 {
    (v + 0.5_f64.copysign(v)) as i64
}

fn signed(element: &[u8], size: usize, k: usize) -> f64 {
    match size {
        1 => f64::from(element[k].cast_signed()),
        _ => f64::from(i16::from_le_bytes([element[2 * k], element[2 * k + 1]])),
    }
}

fn store(element: &mut [u8], size: usize, k: usize, value: i64) {
    element[k * size..(k + 1) * size].copy_from_slice(&value.to_le_bytes()[..size]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shorts(values: [i16; 4]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn unit_vectors_come_back_from_the_octahedron() {
        // +z, +x, and the middle of the lower half's edge (0, -1, -1) / sqrt 2.
        let mut bytes = shorts([0, 0, 1000, 7]);
        bytes.extend(shorts([1000, 0, 1000, 7]));
        bytes.extend(shorts([500, -1000, 1000, 7]));
        octahedral(&mut bytes, 2);
        let mut expected = shorts([0, 0, 32767, 7]);
        expected.extend(shorts([32767, 0, 0, 7]));
        expected.extend(shorts([0, -23170, -23170, 7]));
        assert_eq!(bytes, expected);
        let mut small = [127, 0, 127, 5];
        octahedral(&mut small, 1);
        assert_eq!(small, [127, 0, 0, 5]);
    }

    #[test]
    fn quaternions_get_their_largest_component_back() {
        // A scale of 1023, of which y was the largest: z, w, x are stored.
        let mut bytes = shorts([0, 0, 0, 1020 | 1]);
        quaternion(&mut bytes);
        assert_eq!(bytes, shorts([0, 32767, 0, 0]));
        let mut bytes = shorts([1023, 0, 0, 1020 | 3]);
        quaternion(&mut bytes);
        assert_eq!(bytes, shorts([23170, 0, 0, 23170]));
    }

    #[test]
    fn exponents_are_powers_of_two() {
        let cases: [(i32, i32, f32); 5] =
            [(3, 2, 12.0), (-5, -1, -2.5), (0, 100, 0.0), (8_388_607, -100, 6.617_444e-24), (1, -100, 7.888_609e-31)];
        for (mantissa, exponent, expected) in cases {
            let mut bytes = (exponent << 24 | (mantissa & 0xff_ffff)).to_le_bytes();
            exponential(&mut bytes);
            assert_eq!(f32::from_le_bytes(bytes), expected);
        }
    }

    #[test]
    fn colours_come_back_from_luma_and_chroma() {
        // White, opaque, of 8 bits; and a green that is half transparent, of 4 bits.
        let mut bytes = [255, 0, 0, 255, 7, 0, 8, 0b1011];
        color(&mut bytes, 1);
        assert_eq!(bytes[..4], [255; 4]);
        assert_eq!(bytes[4..], [0, 255, 0, 119]);
    }
}
