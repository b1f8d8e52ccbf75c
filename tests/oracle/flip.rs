//! The difference of two pictures to someone who flips between them on a screen: LDR-FLIP
//! (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "FLIP: A Difference
//! Evaluator for Alternating Images"), written from the paper with its constants. 0: no difference
//! that could be seen; 1: as large as there is.
//!
//! The eye's own blur comes first (contrast sensitivity, in a space of one achromatic and two
//! chromatic channels), then colours are compared by a metric for large differences, and where
//! edges or points differ too, the difference is amplified.

use std::f64::consts::PI;

use super::vector::{V3, length};

/// A screen 0.7 m wide with 3840 columns, seen from 0.7 m away.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// The contrast sensitivity of each channel as a sum of Gaussians, (a, b) each (the paper's table
/// 1).
const ACHROMATIC: &[[f64; 2]] = &[[1.0, 0.0047]];
const RED_GREEN: &[[f64; 2]] = &[[1.0, 0.0053]];
const BLUE_YELLOW: &[[f64; 2]] = &[[34.1, 0.04], [13.5, 0.025]];
/// The largest b: all three filters are cut off where it has fallen by three standard deviations.
const WIDEST: f64 = 0.04;

/// Exponent of the colour difference.
const COLOR_POWER: f64 = 0.7;
/// Differences up to this share of the largest are mapped to [0, `KNEE_VALUE`], the rest above.
const KNEE_SHARE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// Width of the detectors of edges and points, degrees.
const FEATURE_DEGREES: f64 = 0.082;
/// Exponent of the feature difference.
const FEATURE_POWER: f64 = 0.5;

/// A picture as the eye has it.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Blurred, in L*a*b* with chroma that fades with darkness (Hunt's effect).
    colors: Vec<V3>,
    /// Strength of the edge and of the point at each pixel.
    features: Vec<[f64; 2]>,
}

impl Seen {
    /// Of a picture in linear sRGB primaries, row by row.
    pub fn new(width: usize, pixels: &[V3]) -> Self {
        assert!(width > 0 && pixels.len().is_multiple_of(width));
        let xyz: Vec<V3> = pixels.iter().map(|&p| xyz_over_white(p)).collect();
        Self { colors: colors(width, &xyz), features: features(width, &xyz) }
    }

    /// The mean over all pixels of how different the other picture looks.
    pub fn difference(&self, other: &Self) -> f64 {
        assert_eq!(self.colors.len(), other.colors.len());
        let largest = largest_color_difference();
        let pixel = |i: usize| {
            let color = redistributed(hyab(self.colors[i], other.colors[i]).powf(COLOR_POWER), largest);
            let apart = [0, 1].map(|k| (self.features[i][k] - other.features[i][k]).abs());
            let feature = (apart[0].max(apart[1]) / 2.0_f64.sqrt()).powf(FEATURE_POWER);
            color.powf(1.0 - feature)
        };
        (0..self.colors.len()).map(pixel).sum::<f64>() / self.colors.len() as f64
    }
}

/// XYZ of linear sRGB, divided by that of white (D65).
fn xyz_over_white(rgb: V3) -> V3 {
    TO_XYZ.map(|row| (row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]) / row.iter().sum::<f64>())
}

/// IEC 61966-2-1's primaries, in the paper's rationals.
const TO_XYZ: [V3; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Blurs the channels of YCxCz as the eye does, and goes on to L*a*b*.
fn colors(width: usize, xyz: &[V3]) -> Vec<V3> {
    let channel = |of: fn(&V3) -> f64, gaussians| blurred(width, xyz.iter().map(of).collect(), gaussians);
    // Linear in XYZ, so that the offset of the first may be left out.
    let luma = channel(|c| c[1], ACHROMATIC);
    let red_green = channel(|c| c[0] - c[1], RED_GREEN);
    let blue_yellow = channel(|c| c[1] - c[2], BLUE_YELLOW);
    let from_xyz = inverse(TO_XYZ.map(|row| row.map(|v| v / row.iter().sum::<f64>())));
    let pixel = |i: usize| {
        let blurred = [luma[i] + red_green[i], luma[i], luma[i] - blue_yellow[i]];
        // Colours outside of the screen's gamut cannot be shown.
        let rgb = from_xyz.map(|row| (0..3).map(|k| row[k] * blurred[k]).sum::<f64>().clamp(0.0, 1.0));
        hunt_lab(xyz_over_white(rgb))
    };
    (0..xyz.len()).map(pixel).collect()
}

/// The sum of separable Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees, normalised.
fn blurred(width: usize, plane: Vec<f64>, gaussians: &[[f64; 2]]) -> Vec<f64> {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil();
    let taps = |b: f64| kernel(radius, |x| (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp());
    let weight = |[a, b]: [f64; 2]| a * (PI / b).sqrt() * taps(b).iter().sum::<f64>().powi(2);
    let total: f64 = gaussians.iter().map(|&g| weight(g)).sum();
    let mut sum = vec![0.0; plane.len()];
    for &gaussian in gaussians {
        let taps = normalised(taps(gaussian[1]));
        let part = convolved(width, &plane, &taps, &taps);
        sum.iter_mut().zip(part).for_each(|(sum, v)| *sum += v * weight(gaussian) / total);
    }
    sum
}

/// Edges by first and points by second derivatives of a Gaussian, of the luminance that is not
/// blurred.
fn features(width: usize, xyz: &[V3]) -> Vec<[f64; 2]> {
    let deviation = 0.5 * FEATURE_DEGREES * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil();
    let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let across = normalised(kernel(radius, gauss));
    let edge = normalised(kernel(radius, |x| -x * gauss(x)));
    let point = normalised(kernel(radius, |x| (x * x / (deviation * deviation) - 1.0) * gauss(x)));
    let luminance: Vec<f64> = xyz.iter().map(|c| c[1]).collect();
    let strength = |taps: &[f64]| -> Vec<f64> {
        let (x, y) = (convolved(width, &luminance, taps, &across), convolved(width, &luminance, &across, taps));
        x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(edge, point)| [edge, point]).collect()
}

fn kernel(radius: f64, at: impl Fn(f64) -> f64) -> Vec<f64> {
    let radius = radius as i32;
    (-radius..=radius).map(|x| at(f64::from(x))).collect()
}

/// Positive weights that add up to 1, and negative ones that add up to -1.
fn normalised(taps: Vec<f64>) -> Vec<f64> {
    let sum = |sign: f64| taps.iter().map(|t| (t * sign).max(0.0)).sum::<f64>();
    let (above, below) = (sum(1.0), sum(-1.0));
    taps.iter()
        .map(|&t| {
            if t > 0.0 {
                t / above
            } else if t < 0.0 {
                t / below
            } else {
                0.0
            }
        })
        .collect()
}

/// Along rows by one kernel and along columns by the other; a border pixel goes on for ever.
fn convolved(width: usize, plane: &[f64], along_rows: &[f64], along_columns: &[f64]) -> Vec<f64> {
    let height = plane.len() / width;
    let at = |i: usize, tap: usize, taps: &[f64], end: usize| (i + tap).saturating_sub(taps.len() / 2).min(end - 1);
    let mut rows = vec![0.0; plane.len()];
    for (row, out) in plane.chunks(width).zip(rows.chunks_mut(width)) {
        for (x, out) in out.iter_mut().enumerate() {
            *out = along_rows.iter().enumerate().map(|(k, t)| t * row[at(x, k, along_rows, width)]).sum();
        }
    }
    let mut result = vec![0.0; plane.len()];
    for (y, out) in result.chunks_mut(width).enumerate() {
        for (k, tap) in along_columns.iter().enumerate() {
            let from = at(y, k, along_columns, height) * width;
            out.iter_mut().zip(&rows[from..from + width]).for_each(|(out, v)| *out += tap * v);
        }
    }
    result
}

/// L*a*b* with a* and b* times L* / 100.
fn hunt_lab(xyz: V3) -> V3 {
    let delta = 6.0_f64 / 29.0;
    let f = |t: f64| if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 };
    let [x, y, z] = xyz.map(f);
    let lightness = 116.0 * y - 16.0;
    [lightness, 5.0 * (x - y) * lightness, 2.0 * (y - z) * lightness]
}

/// The metric for large differences (Abasi, Tehran and Fairchild 2020).
fn hyab(a: V3, b: V3) -> f64 {
    (a[0] - b[0]).abs() + length([a[1] - b[1], a[2] - b[2]])
}

/// Between pure green and pure blue.
fn largest_color_difference() -> f64 {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| hunt_lab(xyz_over_white(rgb)));
    hyab(green, blue).powf(COLOR_POWER)
}

fn redistributed(error: f64, largest: f64) -> f64 {
    let knee = KNEE_SHARE * largest;
    if error < knee {
        KNEE_VALUE / knee * error
    } else {
        KNEE_VALUE + (error - knee) / (largest - knee) * (1.0 - KNEE_VALUE)
    }
}

fn inverse(m: [V3; 3]) -> [V3; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}
