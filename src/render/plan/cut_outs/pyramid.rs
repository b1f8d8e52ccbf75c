//! A pyramid of bits over a texture with an alpha mask, and the search in it for a visible texel that a
//! triangle may touch. In the lowest level a bit says whether a texel is visible. In each higher level it
//! says whether any of the four below it is set, so the search leaves out squares without a visible
//! texel.

use crate::limits::{Budget, Deadline, LimitExceeded, Stopped};
use crate::mesh::material::Wrap;
use crate::texture::decode::Pixels;
use crate::texture::mips;

/// Distance from a texel's square at which something of it shows, texels: its border may lie in the middle of the next texel,
/// and is a pixel wide, which is no more than a texel of the level that is looked at.
const BESIDE: f64 = 1.01;

/// Copies of the image that a triangle may reach along each axis. One that reaches more meets something.
const TILES_MAX: i64 = 4;

/// Squares that are looked at for one triangle. If that does not suffice, it meets something.
const SQUARES_MAX: usize = 2048;

/// Rows between two looks at the deadline.
const CHECK_EVERY: u32 = 256;

/// A point in texels.
pub type Point = [f64; 2];

/// A bit for each texel that has something, then for squares of twice the side, and so on up to one.
pub struct Pyramid {
    size: [u32; 2],
    /// The place of each level, finest first.
    levels: Vec<usize>,
    bits: Vec<bool>,
}

impl Pyramid {
    /// Memory of an image's pyramid, bytes.
    pub fn bytes(width: u32, height: u32) -> u64 {
        mips::texels(width, height, 0).saturating_mul(2).saturating_add(u64::from(width) * 16)
    }

    /// That of an image in which texels with at least this alpha are drawn.
    pub fn new(pixels: &Pixels, cutoff: f32, deadline: &Deadline) -> Result<Self, Stopped> {
        let table = pixels.lookup_table(true, |v| v);
        let mut row = vec![[0.0_f32; 4]; pixels.width as usize];
        let mut bits = Vec::with_capacity(pixels.width as usize * pixels.height as usize * 2);
        for y in 0..pixels.height {
            if y.is_multiple_of(CHECK_EVERY) {
                deadline.check()?;
            }
            pixels.row(y, &table, &mut row);
            bits.extend(row.iter().map(|texel| texel[3] >= cutoff));
        }
        Ok(Self::of_bits([pixels.width, pixels.height], bits))
    }

    /// That of so many columns and rows of bits.
    fn of_bits(size: [u32; 2], bits: Vec<bool>) -> Self {
        let mut pyramid = Self { size, levels: vec![0], bits };
        let [mut width, mut height] = size;
        while width > 1 || height > 1 {
            let from = pyramid.levels[pyramid.levels.len() - 1];
            let [wide, high] = [width.div_ceil(2), height.div_ceil(2)];
            pyramid.levels.push(pyramid.bits.len());
            for (y, x) in (0..high).flat_map(|y| (0..wide).map(move |x| (y, x))) {
                let rows = 2 * y..height.min(2 * y + 2);
                let mut all = rows.flat_map(|y| (2 * x..width.min(2 * x + 2)).map(move |x| (y, x)));
                let is_any = all.any(|(y, x)| pyramid.bits[from + (y * width + x) as usize]);
                pyramid.bits.push(is_any);
            }
            (width, height) = (wide, high);
        }
        pyramid
    }

    /// True if a triangle, in parts of the image, meets something. Two equal corners make it a line.
    /// `looks` counts what that takes.
    pub fn meets(&self, corners: [Point; 3], wrap: [Wrap; 2], looks: &mut u64) -> bool {
        let corners = corners.map(|corner| [0, 1].map(|k| corner[k] * f64::from(self.size[k])));
        let mut tiles = [[0, 0]; 2];
        for k in 0..2 {
            let [a, b, c] = corners.map(|corner| corner[k]);
            let side = f64::from(self.size[k]);
            let [low, high] = [a.min(b).min(c) - 1.0, a.max(b).max(c) + 1.0];
            // The least and the largest of numbers do not tell that one is none.
            let is_near = [a, b, c].iter().all(|v| v.is_finite()) && low > -1e6 * side && high < 1e6 * side;
            let is_within = low >= -1.0 && high <= side + 1.0;
            if !is_near || (wrap[k] == Wrap::Clamp && !is_within) {
                return true;
            }
            if wrap[k] != Wrap::Clamp {
                tiles[k] = [(low / side).floor() as i64, (high / side).floor() as i64];
            }
        }
        if tiles.iter().any(|[first, last]| last - first >= TILES_MAX) {
            return true;
        }
        let [columns, rows] = tiles.map(|[first, last]| first..=last);
        rows.flat_map(|row| columns.clone().map(move |column| [column, row]))
            .any(|tile| self.meets_tile(&corners, tile, wrap, looks))
    }

    /// As [`Self::meets`] in one copy of the image.
    fn meets_tile(&self, corners: &[Point; 3], tile: [i64; 2], wrap: [Wrap; 2], looks: &mut u64) -> bool {
        let corners = corners.map(|corner| {
            [0, 1].map(|k| {
                let side = f64::from(self.size[k]);
                let at = corner[k] - tile[k] as f64 * side;
                if wrap[k] == Wrap::Mirror && tile[k].rem_euclid(2) == 1 { side - at } else { at }
            })
        });
        let mut open = vec![(self.levels.len() - 1, 0_u32, 0_u32)];
        let mut count = 0;
        while let Some((level, x, y)) = open.pop() {
            count += 1;
            *looks += 1;
            let [width, height] = self.size.map(|side| side.div_ceil(1 << level));
            if !self.bits[self.levels[level] + (y * width + x) as usize] || !is_near(&corners, level, [x, y]) {
                continue;
            }
            if level == 0 || count > SQUARES_MAX {
                return true;
            }
            let finer = self.size.map(|side| side.div_ceil(1 << (level - 1)));
            debug_assert!(x < width && y < height);
            let inner = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[dx, dy]| (level - 1, 2 * x + dx, 2 * y + dy));
            open.extend(inner.into_iter().filter(|&(_, x, y)| x < finer[0] && y < finer[1]));
        }
        false
    }
}

/// True unless one of a triangle's sides, or an axis, parts it from a square of texels and what is
/// blended with it.
fn is_near(corners: &[Point; 3], level: usize, at: [u32; 2]) -> bool {
    let side = f64::from(1_u32 << level);
    let middle = at.map(|v| (f64::from(v) + 0.5) * side);
    let half = 0.5 * side + BESIDE;
    let sides = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| {
        let (a, b) = (corners[a], corners[b]);
        [a[1] - b[1], b[0] - a[0]]
    });
    [[1.0, 0.0], [0.0, 1.0]].into_iter().chain(sides).all(|[x, y]: Point| {
        let along = corners.map(|corner| x * (corner[0] - middle[0]) + y * (corner[1] - middle[1]));
        let reach = half * (x.abs() + y.abs());
        let [low, high] = [
            along.iter().copied().fold(f64::INFINITY, f64::min),
            along.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        low <= reach && high >= -reach
    })
}

/// Spends an image's pyramid.
pub fn spend(budget: &mut Budget, width: u32, height: u32) -> Result<(), LimitExceeded> {
    budget.spend("a cut-out texture", Pyramid::bytes(width, height), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift64
    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn is_inside([a, b, c]: &[Point; 3], p: Point) -> bool {
        let side = |p: &Point, q: &Point, r: Point| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let all = [side(a, b, p), side(b, c, p), side(c, a, p)];
        all.iter().all(|v| *v >= 0.0) || all.iter().all(|v| *v <= 0.0)
    }

    /// Every place that shows something is found, in all ways to go on beyond the image; and most
    /// triangles beside are free.
    #[test]
    fn what_a_triangle_shows_is_met() {
        let mut state = 0x1234_5678_9abc;
        let size = [37_u32, 20];
        let (mut shown, mut free) = (0, 0);
        for case in 0..3000 {
            let bits: Vec<bool> = (0..size[0] * size[1]).map(|_| random(&mut state) < 0.02).collect();
            let pyramid = Pyramid::of_bits(size, bits.clone());
            let wrap = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][case % 3];
            let reach = if wrap == Wrap::Clamp { 0.99 } else { 2.5 };
            let at: Point = [random(&mut state) * reach * 0.8, random(&mut state) * reach * 0.8];
            let corners: [Point; 3] = std::array::from_fn(|_| {
                [0, 1].map(|k| at[k] + 0.2 * random(&mut state) * if wrap == Wrap::Clamp { 0.9 } else { 1.0 })
            });
            // The nearest texel of points in it.
            let texel = |v: f64, k: usize| {
                let (side, v) = (i64::from(size[k]), (v * f64::from(size[k])).floor() as i64);
                match wrap {
                    Wrap::Clamp => v.clamp(0, side - 1),
                    Wrap::Repeat => v.rem_euclid(side),
                    Wrap::Mirror if v.div_euclid(side).rem_euclid(2) == 1 => side - 1 - v.rem_euclid(side),
                    Wrap::Mirror => v.rem_euclid(side),
                }
            };
            let shows = (0..400).any(|_| {
                let p = [0, 1].map(|k| at[k] + 0.2 * random(&mut state));
                is_inside(&corners, p) && bits[(texel(p[1], 1) * i64::from(size[0]) + texel(p[0], 0)) as usize]
            });
            let meets = pyramid.meets(corners, [wrap; 2], &mut 0);
            assert!(meets || !shows, "{wrap:?} {corners:?}");
            shown += usize::from(shows);
            free += usize::from(!meets);
        }
        assert!(shown > 200 && free > 500, "{shown} {free}");
    }

    #[test]
    fn numbers_that_are_none_meet_something() {
        let pyramid = Pyramid::of_bits([1, 1], vec![false]);
        for odd in [f64::NAN, f64::INFINITY, -1e300, 1e9] {
            assert!(pyramid.meets([[odd, 0.5], [0.1, 0.2], [0.3, 0.4]], [Wrap::Repeat; 2], &mut 0), "{odd}");
        }
        assert!(!pyramid.meets([[0.5, 0.5], [0.1, 0.2], [0.3, 0.4]], [Wrap::Repeat; 2], &mut 0));
    }
}
