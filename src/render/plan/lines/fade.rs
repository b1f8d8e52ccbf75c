//! The fading of lines where they lie dense: over such places they are fainter, so that the surface can be
//! seen between them, and elsewhere they keep their full opacity.
//!
//! The picture is covered by a grid of points. At each point the share of the surface around it that lines
//! cover is estimated ([`Density`]), and the opacity follows from it ([`LineFade`]). Between the points,
//! opacities are interpolated, so that no border shows.

/// Least distance of the grid's points, pixels.
const SPACING_MIN_PX: u32 = 16;

/// Distances of points along the picture's longer side, at most.
const SPACINGS_MAX: u32 = 64;

/// Steps between two points that the place of a piece of surface is rounded to.
const STEPS: f64 = 16.0;

/// The part of an average face that is added to each point, covered like the whole picture. It gives a value to
/// points without a face, and where few faces are looked at, chance has less weight.
const MEAN_FACES: f64 = 0.25;

/// Steps of opacities in 1, coarse enough for rounding to leave no trace.
const OPACITY_STEPS: f64 = 256.0;

/// The opacity of lines over the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct LineFade {
    /// Distance of the points of the grid, a power of two, pixels.
    pub spacing_px: u32,
    /// Points per row.
    pub columns: u32,
    /// Opacities at the points, 0 to 1, row by row. The first point is the picture's upper left corner.
    pub opacities: Vec<f32>,
}

impl LineFade {
    /// The opacities along the middle of a row of pixels, one for each column of points.
    pub fn row(&self, y: u32) -> Vec<f32> {
        let (upper, share) = self.place(y);
        let columns = self.columns as usize;
        let points = |row: usize| self.opacities.iter().skip(row * columns).take(columns);
        points(upper).zip(points(upper + 1)).map(|(a, b)| a + share * (b - a)).collect()
    }

    /// The opacity in the middle of a pixel of column x, given the [opacities of its row](Self::row).
    #[inline(always)]
    pub fn at(&self, row: &[f32], x: u32) -> f32 {
        let (left, share) = self.place(x);
        match row.get(left..left + 2) {
            Some(&[a, b]) => a + share * (b - a),
            _ => 1.0,
        }
    }

    /// The point before a pixel's middle in a row or a column, and the share of the way to the next one.
    #[inline(always)]
    fn place(&self, pixel: u32) -> (usize, f32) {
        let spacing = self.spacing_px.max(1);
        ((pixel / spacing) as usize, ((pixel % spacing) as f32 + 0.5) / spacing as f32)
    }
}

/// Areas around the points of a grid, and what lines of two widths cover of them. Whole numbers, whose sums do
/// not depend on an order.
pub struct Density {
    size_px: [u32; 2],
    spacing_px: u32,
    columns: usize,
    rows: usize,
    /// Per point, the area and what the thinner and the wider lines cover of it, in [`AREA_UNIT`]s.
    sums: Vec<[u64; 3]>,
    /// The number of faces and their amounts.
    faces: u64,
    of_faces: [u64; 3],
}

/// Parts of a square pixel in which areas are counted.
const AREA_UNIT: f64 = 256.0;

impl Density {
    /// The grid of a picture, without any surface.
    pub fn new(size_px: [u32; 2]) -> Self {
        let longest = size_px[0].max(size_px[1]);
        let spacing_px = longest.div_ceil(SPACINGS_MAX).next_power_of_two().max(SPACING_MIN_PX);
        let [columns, rows] = size_px.map(|px| px.div_ceil(spacing_px) as usize + 1);
        Self { size_px, spacing_px, columns, rows, sums: vec![[0; 3]; columns * rows], faces: 0, of_faces: [0; 3] }
    }

    /// Adds a face that stands for `weight` faces, given its corners in pixels from the picture's upper left
    /// corner, its area in square pixels, and the shares of it that the thinner and the wider lines cover.
    pub fn add_face(&mut self, corners: [[f64; 2]; 3], area: f64, weight: f64, covered: [f64; 2]) {
        let amounts = |area: f64| [area, area * covered[0], area * covered[1]].map(|v| nearest(v * AREA_UNIT) as u64);
        let whole = amounts(area * weight);
        self.faces += 1;
        add(&mut self.of_faces, whole, 1);
        let spacing = f64::from(self.spacing_px);
        let ends = |k: usize| {
            let of_axis = corners.map(|corner| corner[k]);
            [of_axis[0].min(of_axis[1]).min(of_axis[2]), of_axis[0].max(of_axis[1]).max(of_axis[2])]
        };
        let [x, y] = [ends(0), ends(1)];
        if (x[1] - x[0]).max(y[1] - y[0]) <= spacing {
            let middle = [0, 1].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
            self.add_at(middle, whole);
            return;
        }
        // Each point inside stands for the area around it.
        let around = amounts(spacing * spacing * weight);
        let points = |[low, high]: [f64; 2], count: usize| {
            (low / spacing).ceil().max(0.0) as usize..((high / spacing).floor() + 1.0).clamp(0.0, count as f64) as usize
        };
        for row in points(y, self.rows) {
            for column in points(x, self.columns) {
                if is_inside(&corners, [column, row].map(|v| v as f64 * spacing)) {
                    self.add_around([column, row], around);
                }
            }
        }
    }

    /// Adds what the line along an edge covers, given its ends in pixels from the picture's upper left corner and the
    /// line's width in pixels.
    pub fn add_edge(&mut self, ends: [[f64; 2]; 2], width_px: f64) {
        // The end that the file names first must not matter.
        let ends = if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] };
        let Some([a, b]) = clipped(ends, self.size_px.map(f64::from)) else { return };
        let length = ((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1])).sqrt();
        let parts = (length / f64::from(self.spacing_px)).ceil().max(1.0);
        let covered = (length / parts * width_px * AREA_UNIT).round() as u64;
        for part in 0..parts as u32 {
            let share = (f64::from(part) + 0.5) / parts;
            self.add_at([0, 1].map(|k| a[k] + share * (b[k] - a[k])), [0, covered, covered]);
        }
    }

    /// Adds a surface that fills the picture, without lines.
    pub fn fill(&mut self) {
        let area = (f64::from(self.spacing_px) * f64::from(self.spacing_px) * AREA_UNIT) as u64;
        for at in 0..self.sums.len() {
            self.add_around([at % self.columns, at / self.columns], [area, 0, 0]);
        }
    }

    /// Adds amounts of a whole square around a point, as far as that lies in the picture.
    fn add_around(&mut self, point: [usize; 2], amounts: [u64; 3]) {
        let share = |k: usize| {
            let (middle, end) = (point[k] as f64, f64::from(self.size_px[k]) / f64::from(self.spacing_px));
            (((middle + 0.5).min(end) - (middle - 0.5).max(0.0)).max(0.0) * STEPS).round() as u64
        };
        let share = share(0) * share(1);
        add(&mut self.sums[point[1] * self.columns + point[0]], amounts, share);
    }

    /// Adds amounts to the four points around a place in the picture; none elsewhere.
    fn add_at(&mut self, place: [f64; 2], amounts: [u64; 3]) {
        let is_in_picture = |k: usize| place[k] >= 0.0 && place[k] <= f64::from(self.size_px[k]);
        if !is_in_picture(0) || !is_in_picture(1) {
            return;
        }
        let steps = place.map(|v| nearest(v / f64::from(self.spacing_px) * STEPS) as usize);
        let shares = |steps: usize| [STEPS as usize - steps % STEPS as usize, steps % STEPS as usize];
        let [x, y] = steps.map(|steps| steps / STEPS as usize);
        for (row, down) in (y..self.rows).zip(shares(steps[1])) {
            for (column, right) in (x..self.columns).zip(shares(steps[0])) {
                add(&mut self.sums[row * self.columns + column], amounts, (down * right) as u64);
            }
        }
    }

    /// The opacity of lines that cover at most this share of the surface around each point, or as much as that
    /// share of lines that cover everything. `between` is the place of their width between the thinner and the
    /// wider one, 0 to 1. None: they are opaque everywhere.
    pub fn fade(self, covered_max: f64, between: f64) -> Option<LineFade> {
        let covered = |[area, thin, wide]: [f64; 3]| (thin + between * (wide - thin)) / area.max(f64::MIN_POSITIVE);
        let per_face = MEAN_FACES * SHARES as f64 / self.faces.max(1) as f64;
        let mean = self.of_faces.map(|sum| per_face * sum as f64);
        let opacity = |column: usize, row: usize| {
            let sums = self.smoothed(column, row);
            let covered = covered(std::array::from_fn(|k| sums[k] + mean[k]));
            let opacity = covered_max / covered.clamp(covered_max, 1.0);
            ((opacity * OPACITY_STEPS).round() / OPACITY_STEPS) as f32
        };
        let points = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (column, row)));
        let opacities: Vec<f32> = points.map(|(column, row)| opacity(column, row)).collect();
        let is_opaque = opacities.iter().all(|&opacity| opacity == 1.0);
        (!is_opaque).then_some(LineFade { spacing_px: self.spacing_px, columns: self.columns as u32, opacities })
    }

    /// The mean of a point and its eight neighbours, of which those beside it count half and those at its corners a
    /// quarter. At the picture's border a point stands for the neighbours that it lacks.
    fn smoothed(&self, column: usize, row: usize) -> [f64; 3] {
        let around =
            |at: usize, count: usize| [(at.saturating_sub(1), 0.25), (at, 0.5), ((at + 1).min(count - 1), 0.25)];
        let mut mean = [0.0; 3];
        for (row, down) in around(row, self.rows) {
            for (column, right) in around(column, self.columns) {
                let sums = self.sums[row * self.columns + column];
                mean = std::array::from_fn(|k| mean[k] + down * right * sums[k] as f64);
            }
        }
        mean
    }
}

/// The share of a point that takes an amount in whole, where amounts are divided among the points around a place.
const SHARES: u64 = (STEPS * STEPS) as u64;

/// The nearest whole number. Programs for all x86-64 processors call a function for `f64::round`; this is compiled in
/// place.
pub fn nearest(v: f64) -> i64 {
    (v + 0.5_f64.copysign(v)) as i64
}

fn add(sums: &mut [u64; 3], amounts: [u64; 3], share: u64) {
    for (sum, amount) in sums.iter_mut().zip(amounts) {
        *sum = sum.saturating_add(amount.saturating_mul(share));
    }
}

/// The part of a straight line that lies in a picture of this size.
fn clipped([a, b]: [[f64; 2]; 2], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let mut range = [0.0_f64, 1.0_f64];
    for k in 0..2 {
        let along = b[k] - a[k];
        if along == 0.0 && !(0.0..=size[k]).contains(&a[k]) {
            return None;
        }
        if along != 0.0 {
            let borders = [-a[k] / along, (size[k] - a[k]) / along];
            range = [range[0].max(borders[0].min(borders[1])), range[1].min(borders[0].max(borders[1]))];
        }
    }
    (range[0] < range[1]).then(|| range.map(|t| [0, 1].map(|k| a[k] + t * (b[k] - a[k]))))
}

/// True if a point lies inside a triangle or on its sides.
fn is_inside(corners: &[[f64; 2]; 3], point: [f64; 2]) -> bool {
    let side = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])
    };
    let sides = [0, 1, 2].map(side);
    sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle with its right angle at a place, of one square pixel.
    fn small(x: f64, y: f64) -> [[f64; 2]; 3] {
        let side = std::f64::consts::SQRT_2;
        [[x, y], [x + side, y], [x, y + side]]
    }

    /// A picture of 128 x 64 px whose left half is covered to one share, its right half to another.
    fn halves(left: f64, right: f64) -> Option<LineFade> {
        let mut density = Density::new([128, 64]);
        for (x, y) in (0..64).flat_map(|y| (0..128).map(move |x| (x, y))) {
            let share = if x < 64 { left } else { right };
            density.add_face(small(f64::from(x), f64::from(y)), 1.0, 1.0, [share; 2]);
        }
        density.fade(0.35, 0.5)
    }

    #[test]
    fn lines_fade_where_they_are_dense_and_there_alone() {
        assert_eq!(halves(0.1, 0.3), None);
        let fade = halves(0.1, 0.7).unwrap();
        assert_eq!((fade.spacing_px, fade.columns, fade.opacities.len()), (16, 9, 45));
        for y in 0..64 {
            let row = fade.row(y);
            let along: Vec<f32> = (0..128).map(|x| fade.at(&row, x)).collect();
            assert!(along[..24].iter().all(|&opacity| opacity == 1.0), "{along:?}");
            assert!(along[104..].iter().all(|&opacity| (opacity - 0.5).abs() < 0.01), "{along:?}");
            // No step, and no way back.
            assert!(along.windows(2).all(|two| two[1] <= two[0] && two[0] - two[1] < 0.03), "{along:?}");
        }
    }

    #[test]
    fn a_large_face_counts_wherever_it_is_and_however_far_it_reaches() {
        for far in [1.0, 100.0, 1e6] {
            let mut density = Density::new([192, 192]);
            // It fills the picture. In a corner lies what is dense.
            let large = [[-far, -far], [500.0 + 3.0 * far, -far], [-far, 500.0 + 3.0 * far]];
            density.add_face(large, 1e5, 1.0, [0.01; 2]);
            for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
                density.add_face(small(f64::from(x), f64::from(y)), 1.0, 1.0, [1.0; 2]);
            }
            let fade = density.fade(0.35, 0.5).unwrap();
            let at = |x: u32, y: u32| fade.at(&fade.row(y), x);
            // Of the two layers in the corner one is covered.
            assert!((0.67..0.8).contains(&at(16, 16)), "{far}: {}", at(16, 16));
            let others = (0..192).flat_map(|y| (0..192).map(move |x| (x, y))).filter(|&(x, y)| x.max(y) > 104);
            assert!(others.clone().count() > 20_000 && others.clone().all(|(x, y)| at(x, y) == 1.0), "{far}");
        }
    }

    #[test]
    fn places_without_a_face_fade_as_the_picture_does() {
        let mut density = Density::new([64, 64]);
        density.add_face(small(4.0, 4.0), 1.0, 1000.0, [0.6, 0.8]);
        let fade = density.fade(0.35, 0.5).unwrap();
        assert!(fade.opacities.iter().all(|&opacity| opacity == 0.5), "{fade:?}");
        assert_eq!(Density::new([64, 64]).fade(0.35, 0.5), None);
    }

    #[test]
    fn edges_fade_where_they_are_many() {
        // Parallel edges all over the picture, 1.5 to 50 px apart: lines of 1 px cover .67 to .02 of it.
        let mut faded = [0; 2];
        for distance in [1.5, 2.0, 4.0, 10.0, 50.0] {
            let mut density = Density::new([200, 200]);
            density.fill();
            for i in 0..(200.0 / distance) as u32 {
                let x = f64::from(i) * distance;
                density.add_edge([[x, -1e4], [x, 300.0]], 1.0);
            }
            match density.fade(0.35, 1.0) {
                None => faded[0] += 1,
                Some(fade) => {
                    let opacity = fade.at(&fade.row(100), 100);
                    assert!((f64::from(opacity) - 0.35 * distance).abs() < 0.05, "{distance}: {opacity}");
                    faded[1] += 1;
                }
            }
        }
        assert_eq!(faded, [3, 2]);
    }

    #[test]
    fn large_pictures_have_few_points_and_every_pixel_has_an_opacity() {
        for (size_px, spacing_px) in [([1, 1], 16), ([1024, 100], 16), ([1025, 100], 32), ([4096, 4096], 64)] {
            let mut density = Density::new(size_px);
            let [x, y] = size_px.map(|px| f64::from(px) - 1.0);
            density.add_face(small(x, y), 1.0, 1e9, [1.0; 2]);
            let fade = density.fade(0.35, 0.0).unwrap();
            assert_eq!(fade.spacing_px, spacing_px);
            assert!(fade.opacities.len() <= 65 * 65);
            for y in [0, size_px[1] - 1] {
                let row = fade.row(y);
                assert_eq!(row.len(), fade.columns as usize);
                for x in [0, size_px[0] - 1] {
                    assert!(row.len() > fade.place(x).0 + 1 && fade.at(&row, x) < 1.0, "{size_px:?}: {x} {y}");
                }
            }
        }
    }
}
