//! The test whether a triangle is so thin that it may lie between samples: at least a pixel long, less than a pixel
//! high, and at least four times as long as high (stage mixed). The length is the larger extent, across or down;
//! twice the area over it is the height. Pixels with such triangles may be drawn a second time, from more points.

/// A thin triangle is this many times as long as it is high, or more.
pub const ASPECT: i32 = 4;

/// Thin triangles are less high than this, 1/256 px: samples see most of what is higher.
pub const HEIGHT_MAX: i32 = 256;

/// Thin triangles are this long, 1/256 px, or more: what is shorter covers less than 1/8 of a pixel.
pub const LENGTH_MIN: i32 = 256;

/// Triangles of this length, 1/256 px, that are less than [`HEIGHT_MAX`] high are [`ASPECT`] times as long in any case.
/// Squares of lesser lengths have 30 bits.
pub const LENGTH_MAX: i32 = 1 << 15;

/// True if a triangle is long and less than a pixel high, and has an area. `twice_area` may be negative.
#[inline(always)]
pub fn is_thin(x: [i32; 3], y: [i32; 3], twice_area: i64) -> bool {
    // Differences wrap only for triangles outside, whose result is not used.
    let size = |v: [i32; 3]| v[0].max(v[1]).max(v[2]).wrapping_sub(v[0].min(v[1]).min(v[2]));
    let length = size(x).max(size(y));
    let (long, twice_area) = (i64::from(length), twice_area.wrapping_abs());
    (length >= LENGTH_MIN)
        & (twice_area > 0)
        & (twice_area < i64::from(HEIGHT_MAX) * long)
        & ((length >= LENGTH_MAX) | (i64::from(ASPECT).wrapping_mul(twice_area) <= long.wrapping_mul(long)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::geometry::transform::ScreenVertex;
    use crate::backend::cpu::geometry::visibility::area;

    fn is_thin_of(corners: [[i32; 2]; 3]) -> bool {
        let [x, y] = [0, 1].map(|axis| corners.map(|corner| corner[axis]));
        let vertex = |[x, y]: [i32; 2]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 };
        is_thin(x, y, area(&corners.map(vertex)))
    }

    #[test]
    fn hairs_are_thin_and_dots_and_bars_are_not() {
        let hair = [[0, 0], [2560, 256], [2560, 288]];
        assert!(is_thin_of(hair));
        assert!(is_thin_of(hair.map(|[x, y]| [y, x])));
        // Beyond the picture, too.
        assert!(is_thin_of([[-1 << 20, -1 << 20], [1 << 20, 1 << 20], [1 << 20, (1 << 20) + 32]]));
        // A quarter as high as long.
        assert!(is_thin_of([[0, 0], [256, 0], [256, 64]]));
        assert!(!is_thin_of([[0, 0], [256, 0], [256, 65]]));
        assert!(!is_thin_of([[0, 0], [255, 0], [255, 63]]), "short");
        // A pixel high.
        assert!(is_thin_of([[0, 0], [4096, 0], [4096, 255]]));
        assert!(!is_thin_of([[0, 0], [4096, 0], [4096, 256]]));
        assert!(!is_thin_of([[0, 0], [4096, 0], [8192, 0]]), "no area");
        // As long as can be.
        assert!(is_thin_of([[-1 << 20, 0], [1 << 20, 0], [1 << 20, 255]]));
        assert!(!is_thin_of([[-1 << 20, 0], [1 << 20, 0], [1 << 20, 256]]));
    }
}
