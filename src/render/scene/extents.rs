//! The bounds of a mesh as a camera sees it, to which the camera is fitted: the least and the largest
//! coordinates along the camera's axes, and how far vertices reach towards the four sides of the view
//! pyramid. For a single view, blocks of vertices that cannot change the result are left out. For a
//! turntable, the bounds are those of a whole turn.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::parallel::map;

/// Vertices that are looked at side by side.
const LANES: usize = 4;

/// Vertices whose box says whether any of them can be the farthest in some direction.
const BLOCK: usize = 64;

/// Vertices that a thread takes at a time.
const PIECE: usize = 1 << 14;

/// Rounding errors of coordinates in camera axes, per unit of the box: a generous limit.
const ROUNDED: f64 = 1e-12;

/// Bounds of the mesh in camera axes.
pub struct Extents {
    /// The least coordinates.
    pub low: DVec3,
    /// The largest coordinates.
    pub high: DVec3,
    /// Largest `across + slope z`, of the view pyramid's slopes.
    pub plus: DVec2,
    /// Largest `slope z - across`.
    pub minus: DVec2,
}

impl Extents {
    /// The bounds along these axes, and in the view pyramid of these slopes.
    pub fn new(positions: &[[f32; 3]], axes: [DVec3; 3], slopes: DVec2) -> Self {
        if positions.is_empty() {
            let nothing = DVec2::NEG_INFINITY;
            return Self { low: DVec3::ZERO, high: DVec3::ZERO, plus: nothing, minus: nothing };
        }
        let farthest = Farthest::new(axes, slopes);
        let pieces = map(positions.chunks(PIECE).collect(), |piece| farthest.lanes_of(piece));
        let mut lanes = ExtentLanes::EMPTY;
        pieces.iter().for_each(|piece| lanes.merge(piece));
        let least = |v: [f64; LANES]| v.into_iter().fold(f64::INFINITY, f64::min);
        let most = |v: [f64; LANES]| v.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Self {
            low: DVec3::from(lanes.low.map(least)),
            high: DVec3::from(lanes.high.map(most)),
            plus: DVec2::from(lanes.plus.map(most)),
            minus: DVec2::from(lanes.minus.map(most)),
        }
    }

    /// The middle across the view.
    pub fn center(&self) -> DVec2 {
        ((self.low + self.high) * 0.5).truncate()
    }

    /// Half the size across the view.
    pub fn half(&self) -> DVec2 {
        ((self.high - self.low) * 0.5).truncate()
    }

    /// Centre and distance at which the mesh, grown by `grow`, touches the pyramid of these slopes.
    pub fn fit_perspective(&self, slopes: DVec2, grow: f64) -> (DVec2, f64) {
        let Self { plus, minus, .. } = *self;
        if plus == DVec2::NEG_INFINITY {
            return (DVec2::ZERO, 1.0);
        }
        let lean = DVec2::new((1.0 + slopes.x * slopes.x).sqrt(), (1.0 + slopes.y * slopes.y).sqrt()) * grow;
        let distance = ((plus + minus + 2.0 * lean) / (2.0 * slopes)).max_element();
        // A mesh seen as a point or a line would give no distance at all, and a very wide view hardly
        // any.
        ((plus - minus) * 0.5, distance.max(self.high.z + grow + 1e-3))
    }
}

/// The search for the farthest vertices in ten directions: to both sides along each axis, and across the
/// four planes of a view pyramid.
struct Farthest {
    axes: [DVec3; 3],
    slopes: DVec2,
    directions: [DVec3; 10],
    /// Distance up to which rounding may move a vertex along each direction.
    rounded: [f64; 10],
}

impl Farthest {
    fn new(axes: [DVec3; 3], slopes: DVec2) -> Self {
        let [x, y, z] = axes;
        let lean = [z * slopes.x, z * slopes.y];
        let directions = [-x, -y, -z, x, y, z, lean[0] + x, lean[1] + y, lean[0] - x, lean[1] - y];
        Self { axes, slopes, directions, rounded: directions.map(|way| ROUNDED * (1.0 + way.abs().element_sum())) }
    }

    /// The bounds of some positions. Blocks whose boxes lie within the bounds so far are left out.
    fn lanes_of(&self, positions: &[[f32; 3]]) -> ExtentLanes {
        let mut lanes = ExtentLanes::EMPTY;
        let mut farthest = lanes.farthest();
        for block in positions.chunks(BLOCK) {
            if self.is_within(box_of(block), &farthest) {
                continue;
            }
            let (fours, rest) = block.as_chunks();
            fours.iter().for_each(|four| lanes.add(four, self.axes, self.slopes));
            if !rest.is_empty() {
                let mut last = [rest[0]; LANES];
                last[..rest.len()].copy_from_slice(rest);
                lanes.add(&last, self.axes, self.slopes);
            }
            farthest = lanes.farthest();
        }
        lanes
    }

    /// True if no vertex in a box goes beyond what is the farthest in each direction.
    fn is_within(&self, [low, high]: [DVec3; 2], farthest: &[f64; 10]) -> bool {
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let ways = self.directions.iter().zip(&self.rounded).zip(farthest);
        ways.fold(true, |is_within, ((way, rounded), farthest)| {
            is_within & (way.dot(middle) + way.abs().dot(half) + rounded < *farthest)
        })
    }
}

/// The box around at least one position.
fn box_of(block: &[[f32; 3]]) -> [DVec3; 2] {
    // Four positions side by side, and twice the last ones.
    let (mut low, mut high) = ([f32::INFINITY; 3 * LANES], [f32::NEG_INFINITY; 3 * LANES]);
    let mut add = |four: &[f32; 3 * LANES]| {
        // Not `f32::min` and `max`, which look for NaN.
        low = std::array::from_fn(|i| if four[i] < low[i] { four[i] } else { low[i] });
        high = std::array::from_fn(|i| if four[i] > high[i] { four[i] } else { high[i] });
    };
    let flat = block.as_flattened();
    let (fours, rest) = flat.as_chunks();
    fours.iter().for_each(&mut add);
    for one in rest.as_chunks::<3>().0 {
        add(&std::array::from_fn(|i| one[i % 3]));
    }
    let over = |v: [f32; 3 * LANES], pick: fn(f32, f32) -> f32| {
        DVec3::from([0, 1, 2].map(|k| f64::from((1..LANES).fold(v[k], |found, lane| pick(found, v[3 * lane + k])))))
    };
    [over(low, f32::min), over(high, f32::max)]
}

/// The bounds of every fourth vertex.
struct ExtentLanes {
    low: [[f64; LANES]; 3],
    high: [[f64; LANES]; 3],
    plus: [[f64; LANES]; 2],
    minus: [[f64; LANES]; 2],
}

impl ExtentLanes {
    const EMPTY: Self = Self {
        low: [[f64::INFINITY; LANES]; 3],
        high: [[f64::NEG_INFINITY; LANES]; 3],
        plus: [[f64::NEG_INFINITY; LANES]; 2],
        minus: [[f64::NEG_INFINITY; LANES]; 2],
    };

    /// The bounds in the directions of [`Farthest`].
    fn farthest(&self) -> [f64; 10] {
        let most = |v: &[f64; LANES]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let [low, high] = [self.low.map(|v| most(&v.map(|v| -v))), self.high.map(|v| most(&v))];
        let [plus, minus] = [self.plus, self.minus].map(|lanes| lanes.map(|v| most(&v)));
        [low[0], low[1], low[2], high[0], high[1], high[2], plus[0], plus[1], minus[0], minus[1]]
    }

    /// Adds the bounds of more vertices.
    fn merge(&mut self, more: &Self) {
        let least = |a: &mut [f64; LANES], b: &[f64; LANES]| *a = std::array::from_fn(|l| a[l].min(b[l]));
        let most = |a: &mut [f64; LANES], b: &[f64; LANES]| *a = std::array::from_fn(|l| a[l].max(b[l]));
        self.low.iter_mut().zip(&more.low).for_each(|(a, b)| least(a, b));
        self.high.iter_mut().zip(&more.high).for_each(|(a, b)| most(a, b));
        self.plus.iter_mut().zip(&more.plus).for_each(|(a, b)| most(a, b));
        self.minus.iter_mut().zip(&more.minus).for_each(|(a, b)| most(a, b));
    }

    // Loops over lanes and axes walk several arrays at once; an index says that best.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn add(&mut self, block: &[[f32; 3]; LANES], axes: [DVec3; 3], slopes: DVec2) {
        // Not `f64::min` and `max`, which look for NaN.
        let min = |a: f64, b: f64| if a < b { a } else { b };
        let max = |a: f64, b: f64| if a > b { a } else { b };
        let (slopes, mut p) = ([slopes.x, slopes.y], [[0.0; LANES]; 3]);
        for k in 0..3 {
            for l in 0..LANES {
                let [x, y, z] = [f64::from(block[l][0]), f64::from(block[l][1]), f64::from(block[l][2])];
                p[k][l] = (axes[k].x * x + axes[k].y * y) + axes[k].z * z;
                self.low[k][l] = min(p[k][l], self.low[k][l]);
                self.high[k][l] = max(p[k][l], self.high[k][l]);
            }
        }
        for k in 0..2 {
            for l in 0..LANES {
                let lean = slopes[k] * p[2][l];
                self.plus[k][l] = max(p[k][l] + lean, self.plus[k][l]);
                self.minus[k][l] = max(lean - p[k][l], self.minus[k][l]);
            }
        }
    }
}

/// The bounds of positions that turn with their mesh around the up axis through the middle of its box, in the
/// axes of a camera above the horizon by the angle of this sine and cosine.
///
/// A point at distance r from the axis and height h is at `x = r sin a`, `y = h cos e - r cos a sin e` and
/// `z = h sin e + r cos a cos e` for a turn by a; each bound is the largest over all a.
pub fn turned_extents(
    positions: &[[f32; 3]],
    mesh: &Mesh,
    (axes, up): ([DVec3; 3], DVec3),
    (sin_e, cos_e): (f64, f64),
    slopes: DVec2,
) -> Extents {
    let nothing = DVec2::NEG_INFINITY;
    let mut all = Extents { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, plus: nothing, minus: nothing };
    if positions.is_empty() {
        return Extents { low: DVec3::ZERO, high: DVec3::ZERO, ..all };
    }
    let lean_x = (1.0 + (slopes.x * cos_e) * (slopes.x * cos_e)).sqrt();
    let [plus_y, minus_y] = [slopes.y * cos_e - sin_e, slopes.y * cos_e + sin_e].map(f64::abs);
    let [low, high] = mesh.bounds.map(|corner| DVec3::from(corner.map(f64::from)));
    let middle = (low + high) * 0.5;
    let on_axis = middle - up * up.dot(middle);
    for p in positions {
        let p = DVec3::from(p.map(f64::from)) - on_axis;
        let h = up.dot(p);
        let r = (p - up * h).length();
        let reach = DVec3::new(r, r * sin_e.abs(), r * cos_e.abs());
        let at = DVec3::new(0.0, h * cos_e, h * sin_e);
        all.low = all.low.min(at - reach);
        all.high = all.high.max(at + reach);
        let lean = h * sin_e * slopes;
        let across = DVec2::new(0.0, h * cos_e);
        all.plus = all.plus.max(lean + across + DVec2::new(lean_x, plus_y) * r);
        all.minus = all.minus.max(lean - across + DVec2::new(lean_x, minus_y) * r);
    }
    // From the turn's axis to the origin of the camera's axes.
    let shift = DVec3::from(axes.map(|axis| axis.dot(on_axis)));
    let lean = slopes * shift.z;
    all.low += shift;
    all.high += shift;
    all.plus += lean + shift.truncate();
    all.minus += lean - shift.truncate();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn blocks_that_are_left_out_change_no_bound() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut left_out = 0;
        for count in [1, 2, 3, 5, 63, 64, 65, 1000, 40_000] {
            // A walk: neighbours in the list are near each other, as those of a mesh.
            let mut at = [0.0_f32; 3];
            let positions: Vec<[f32; 3]> = (0..count)
                .map(|_| {
                    at = at.map(|v| (v + 0.02 * random()).clamp(-0.5, 0.5));
                    at
                })
                .collect();
            let turn = DQuat::from_xyzw(random().into(), random().into(), random().into(), 1.0).normalize();
            let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
            let slopes = DVec2::new(0.3, 2.0);
            let all = Extents::new(&positions, axes, slopes);
            let along = |axis: DVec3, p: &[f32; 3]| {
                let [x, y, z] = p.map(f64::from);
                (axis.x * x + axis.y * y) + axis.z * z
            };
            let most = |of: &dyn Fn(&[f32; 3]) -> f64| positions.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            for (k, &axis) in axes.iter().enumerate() {
                assert_eq!(all.high[k], most(&|p| along(axis, p)));
                assert_eq!(all.low[k], -most(&|p| -along(axis, p)));
            }
            for k in 0..2 {
                assert_eq!(all.plus[k], most(&|p| along(axes[k], p) + slopes[k] * along(axes[2], p)));
                assert_eq!(all.minus[k], most(&|p| slopes[k] * along(axes[2], p) - along(axes[k], p)));
            }
            let farthest = Farthest::new(axes, slopes);
            let bounds = farthest.lanes_of(&positions).farthest();
            left_out += positions.chunks(BLOCK).filter(|block| farthest.is_within(box_of(block), &bounds)).count();
        }
        assert!(left_out > 400, "{left_out}");
    }
}
