//! FLIP: a measure of the difference that a person sees when one picture is shown and then the other in its place. It
//! goes from 0, no difference, to 1, the largest. The algorithm is that of Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström and Fairchild, FLIP: A Difference Evaluator for Alternating Images (High Performance Graphics
//! 2020), for pictures of low dynamic range; constants such as `Q_C` and `P_T` have the names of the paper.
//!
//! A picture is taken to be looked at from 0.7 m, on a screen that is 0.7 m and 3840 pixels wide, as in the paper.

use super::Picture;
use meshsnap_render::parallel::map;
use meshsnap_render::srgb::srgb_to_linear;

/// Pixels per degree of the field of view.
const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Rows that are worked on at a time.
const BAND: usize = 64;

/// Exponents of colour and features, and the two ends of the compressed large colour differences.
const Q_C: f64 = 0.7;
const Q_F: f64 = 0.5;
const P_C: f64 = 0.4;
const P_T: f64 = 0.95;

/// Width of the features that the eye detects, degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Of linear sRGB to XYZ, by rows.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// The FLIP of two pictures of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// The mean over all pixels.
    pub mean: f64,
    /// The largest.
    pub max: f64,
    /// By pixel, row by row.
    pub errors: Vec<f32>,
}

/// Computes it. Pictures of different sizes have none.
pub fn flip(a: &Picture, b: &Picture) -> Option<Flip> {
    if a.size() != b.size() {
        return None;
    }
    let eye = Eye::new();
    let (width, height) = (a.width_px as usize, a.height_px as usize);
    let bands = map((0..height).step_by(BAND).collect(), |top| {
        let rows = top..height.min(top + BAND);
        let [of_a, of_b] = [a, b].map(|picture| Seen::of(picture, rows.clone(), &eye));
        let error = |pixel: usize| {
            let of_color = eye.color_difference(of_a.colors[pixel], of_b.colors[pixel]);
            let [features_a, features_b] = [of_a.features[pixel], of_b.features[pixel]];
            let of_features = (0..2).map(|k| (features_a[k] - features_b[k]).abs()).fold(0.0, f64::max);
            let of_features = libm::pow(of_features * std::f64::consts::FRAC_1_SQRT_2, Q_F).min(1.0);
            libm::pow(of_color, 1.0 - of_features)
        };
        (0..of_a.colors.len()).map(error).collect::<Vec<f64>>()
    });
    let (mut sum, mut max) = (0.0, 0.0);
    let mut errors = Vec::with_capacity(width * height);
    for error in bands.into_iter().flatten() {
        sum += error;
        max = f64::max(max, error);
        errors.push(error as f32);
    }
    Some(Flip { mean: sum / errors.len().max(1) as f64, max, errors })
}

/// Some rows of a picture as an eye sees them.
struct Seen {
    /// Colours after the blur of the eye: L, a, b of CIELAB, with the Hunt effect.
    colors: Vec<[f64; 3]>,
    /// The strengths of edges and of points.
    features: Vec<[f64; 2]>,
}

impl Seen {
    fn of(picture: &Picture, rows: std::ops::Range<usize>, eye: &Eye) -> Self {
        let (width, height) = (picture.width_px as usize, picture.height_px as usize);
        let radius = eye.radius();
        // Pixels beyond the picture's border are those of the border.
        let around: Vec<usize> =
            (0..rows.len() + 2 * radius).map(|row| (rows.start + row).saturating_sub(radius).min(height - 1)).collect();
        let mut opponent: [Vec<f64>; 3] = [Vec::new(), Vec::new(), Vec::new()];
        for row in around {
            for pixel in &picture.pixels[row * width..][..width] {
                let values = eye.opponent(eye.over_white(*pixel));
                opponent.iter_mut().zip(values).for_each(|(plane, value)| plane.push(value));
            }
        }
        let plane = |channel: usize| Plane { values: &opponent[channel], width, radius };
        let blurred: Vec<Vec<f64>> =
            eye.blurs.iter().enumerate().map(|(channel, blurs)| plane(channel).filtered(blurs)).collect();
        let colors = (0..rows.len() * width).map(|i| eye.lab([blurred[0][i], blurred[1][i], blurred[2][i]]));
        let luminance: Vec<f64> = opponent[0].iter().map(|value| (value + 16.0) / 116.0).collect();
        let luminance = Plane { values: &luminance, width, radius };
        let strength = |along: &[f64]| -> Vec<f64> {
            let [x, y] = [[along, &eye.feature_blur], [&eye.feature_blur, along]];
            let [x, y] = [x, y].map(|[x, y]| luminance.convolved(x, y));
            x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        let (edges, points) = (strength(&eye.edge), strength(&eye.point));
        let features = edges.into_iter().zip(points).map(|(edge, point)| [edge, point]);
        Self { colors: colors.collect(), features: features.collect() }
    }
}

/// A channel of some rows, with `radius` more rows on both sides.
struct Plane<'a> {
    values: &'a [f64],
    width: usize,
    radius: usize,
}

impl Plane<'_> {
    /// The sum of several blurs, each the same along both axes.
    fn filtered(&self, blurs: &[Vec<f64>]) -> Vec<f64> {
        let mut all: Option<Vec<f64>> = None;
        for blur in blurs {
            let one = self.convolved(blur, blur);
            match &mut all {
                None => all = Some(one),
                Some(all) => all.iter_mut().zip(one).for_each(|(sum, value)| *sum += value),
            }
        }
        all.unwrap_or_default()
    }

    /// The middle rows, after a kernel along x and one along y, of odd lengths.
    fn convolved(&self, along_x: &[f64], along_y: &[f64]) -> Vec<f64> {
        let (width, rows) = (self.width, self.values.len() / self.width.max(1));
        let half = along_x.len() / 2;
        let mut wide = Vec::with_capacity(self.values.len());
        let mut padded = vec![0.0; width + 2 * half];
        for row in self.values.chunks_exact(width) {
            padded[half..half + width].copy_from_slice(row);
            padded[..half].fill(row[0]);
            padded[half + width..].fill(row[width - 1]);
            wide.extend((0..width).map(|x| dot(&padded[x..x + along_x.len()], along_x)));
        }
        let half = along_y.len() / 2;
        let mut out = vec![0.0; (rows - 2 * self.radius) * width];
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            for (k, weight) in along_y.iter().enumerate() {
                let row = &wide[(y + self.radius + k - half) * width..][..width];
                out.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        out
    }
}

fn dot(values: &[f64], weights: &[f64]) -> f64 {
    values.iter().zip(weights).map(|(value, weight)| value * weight).sum()
}

/// The filters of an eye.
struct Eye {
    /// By opponent channel (luminance, red to green, blue to yellow): the blurs whose sum is its contrast sensitivity.
    blurs: [Vec<Vec<f64>>; 3],
    edge: Vec<f64>,
    point: Vec<f64>,
    feature_blur: Vec<f64>,
    /// By number of a channel: its linear value.
    linear: Vec<f64>,
    to_rgb: [[f64; 3]; 3],
    white: [f64; 3],
    /// The largest difference of colours, between green and blue.
    most: f64,
}

impl Eye {
    fn new() -> Self {
        // a1, b1, a2, b2 of each channel.
        const SENSITIVITY: [[f64; 4]; 3] =
            [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];
        let pi = std::f64::consts::PI;
        let radius = libm::ceil(3.0 * (0.04 / (2.0 * pi * pi)).sqrt() * PIXELS_PER_DEGREE) as i32;
        let blurs = SENSITIVITY.map(|[a1, b1, a2, b2]| {
            let parts = [(a1, b1), (a2, b2)].into_iter().filter(|(a, _)| *a > 0.0);
            let mut parts: Vec<(f64, Vec<f64>)> = parts
                .map(|(a, b)| {
                    let at = |x: i32| f64::from(x) / PIXELS_PER_DEGREE;
                    let gauss = (-radius..=radius).map(|x| libm::exp(-pi * pi * at(x) * at(x) / b));
                    (a * (pi / b).sqrt(), gauss.collect())
                })
                .collect();
            let total: f64 = parts.iter().map(|(weight, gauss)| weight * sum(gauss) * sum(gauss)).sum();
            // The weight is that of both axes together.
            for (weight, gauss) in &mut parts {
                let root = (*weight / total).sqrt();
                gauss.iter_mut().for_each(|value| *value *= root);
            }
            parts.into_iter().map(|(_, gauss)| gauss).collect()
        });
        let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
        let reach = libm::ceil(3.0 * deviation) as i32;
        let gauss = |x: i32| libm::exp(-f64::from(x * x) / (2.0 * deviation * deviation));
        let all = |value: &dyn Fn(i32) -> f64| -> Vec<f64> { (-reach..=reach).map(value).collect() };
        let feature_blur = all(&gauss);
        let whole = sum(&feature_blur);
        let edge = all(&|x| -f64::from(x) * gauss(x));
        let point = all(&|x| (f64::from(x * x) / (deviation * deviation) - 1.0) * gauss(x));
        let [edge, point] = [edge, point].map(|kernel| balanced(kernel, whole));
        let white = TO_XYZ.map(|row| sum(&row));
        let linear = (0..=u16::MAX).map(|value| srgb_to_linear(f64::from(value) / f64::from(u16::MAX))).collect();
        let mut eye = Self { blurs, edge, point, feature_blur, linear, to_rgb: inverse(TO_XYZ), white, most: 1.0 };
        let of_color = |color| eye.hunt(color);
        let [green, blue] = [of_color([0.0, 1.0, 0.0]), of_color([0.0, 0.0, 1.0])];
        eye.most = libm::pow(distance(green, blue), Q_C);
        eye
    }

    /// The farthest pixel that counts.
    fn radius(&self) -> usize {
        self.blurs.iter().flatten().chain([&self.edge]).map(|kernel| kernel.len() / 2).max().unwrap_or(0)
    }

    /// The linear colour of a pixel over white.
    fn over_white(&self, [r, g, b, a]: [u16; 4]) -> [f64; 3] {
        [r, g, b].map(|value| self.linear[usize::from(value.saturating_add(u16::MAX - a))])
    }

    /// Luminance and two differences of colours, in which sensitivity is known (YCxCz).
    fn opponent(&self, linear: [f64; 3]) -> [f64; 3] {
        let xyz = times(TO_XYZ, linear);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| xyz[k] / self.white[k]);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// CIELAB with the Hunt effect, of a colour in opponent channels.
    fn lab(&self, [luminance, cx, cz]: [f64; 3]) -> [f64; 3] {
        let y = (luminance + 16.0) / 116.0;
        let relative = [y + cx / 500.0, y, y - cz / 200.0];
        let xyz = std::array::from_fn(|k| relative[k] * self.white[k]);
        self.hunt(times(self.to_rgb, xyz).map(|value| value.clamp(0.0, 1.0)))
    }

    /// The same of a linear colour: colours seem stronger where there is more light.
    fn hunt(&self, linear: [f64; 3]) -> [f64; 3] {
        const DELTA: f64 = 6.0 / 29.0;
        let xyz = times(TO_XYZ, linear);
        let root = |value: f64| match value > DELTA * DELTA * DELTA {
            true => libm::cbrt(value),
            false => value / (3.0 * DELTA * DELTA) + 4.0 / 29.0,
        };
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| root(xyz[k] / self.white[k]));
        let lightness = 116.0 * y - 16.0;
        [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
    }

    /// The difference of two colours, from 0 to 1.
    fn color_difference(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        let difference = libm::pow(distance(a, b), Q_C);
        let knee = P_C * self.most;
        match difference < knee {
            true => P_T / knee * difference,
            false => P_T + (difference - knee) / (self.most - knee) * (1.0 - P_T),
        }
    }
}

/// A distance that holds for large differences, too (HyAB).
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [l, x, y]: [f64; 3] = std::array::from_fn(|k| a[k] - b[k]);
    l.abs() + (x * x + y * y).sqrt()
}

/// A kernel whose positive and negative weights have the sums 1 and -1, together with a blur of this sum across.
fn balanced(kernel: Vec<f64>, across: f64) -> Vec<f64> {
    let above: f64 = kernel.iter().filter(|value| **value > 0.0).sum::<f64>() * across;
    let below: f64 = -kernel.iter().filter(|value| **value < 0.0).sum::<f64>() * across;
    kernel.into_iter().map(|value| if value < 0.0 { value / below } else { value / above }).collect()
}

fn sum(values: &[f64]) -> f64 {
    values.iter().sum()
}

fn times(matrix: [[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    matrix.map(|[a, b, c]| a * x + b * y + c * z)
}

/// The inverse of a matrix that has one, by cofactors.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |row: usize, column: usize| {
        let [r1, r2] = [(row + 1) % 3, (row + 2) % 3];
        let [c1, c2] = [(column + 1) % 3, (column + 2) % 3];
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|column| m[0][column] * minor(0, column)).sum();
    std::array::from_fn(|row| std::array::from_fn(|column| minor(column, row) / determinant))
}
