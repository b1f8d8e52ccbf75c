//! The bounds of a mesh as a camera sees it, to which the camera is fitted: the least and the largest
//! coordinates along the camera's axes, and how far vertices reach towards the four sides of the view
//! pyramid. For a single view, vertices are left out whose boxes (`position_boxes`) show that they cannot
//! change the result. For a turntable, the bounds are those of a whole turn.

use glam::{DVec2, DVec3};

use super::position_boxes::{BLOCK, BoxedPositions, GROUP, middle_and_half};
use crate::mesh::Mesh;
use crate::parallel::map;

/// Vertices that are looked at side by side.
const LANES: usize = 4;

/// Groups of vertices that a thread takes at a time: so many that it saves more than handing them over costs.
const CHUNK: usize = 1024;

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
    pub fn new(framing: BoxedPositions<'_>, axes: [DVec3; 3], slopes: DVec2) -> Self {
        let BoxedPositions { positions, boxes } = framing;
        if positions.is_empty() {
            let nothing = DVec2::NEG_INFINITY;
            return Self { low: DVec3::ZERO, high: DVec3::ZERO, plus: nothing, minus: nothing };
        }
        let farthest = Farthest::new(axes, slopes);
        let group = |i: usize| {
            let blocks = &boxes.blocks[i * BLOCKS..boxes.blocks.len().min((i + 1) * BLOCKS)];
            positions[i * GROUP..].chunks(BLOCK).zip(blocks)
        };
        let reaches: Vec<Reach> = boxes.groups.iter().map(|around| farthest.reach(around)).collect();
        let mut lanes = ExtentLanes::EMPTY;
        // The block that may reach the farthest in each direction: few others reach farther than all of these.
        for way in 0..WAYS {
            let first = (0..reaches.len()).max_by(|&a, &b| reaches[a][way].total_cmp(&reaches[b][way])).unwrap_or(0);
            let reach = |around: &[[f32; 3]; 2]| farthest.reach(around)[way];
            let block = group(first).max_by(|(_, a), (_, b)| reach(a).total_cmp(&reach(b)));
            block.into_iter().for_each(|(block, _)| farthest.add(block, &mut lanes));
        }
        let least = lanes.farthest();
        let far: Vec<usize> = (0..reaches.len()).filter(|&i| !is_within(&reaches[i], &least)).collect();
        let pieces =
            map(far.chunks(CHUNK).collect(), |chunk| farthest.lanes_of(chunk.iter().flat_map(|&i| group(i)), &least));
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

/// The number of directions of a search.
const WAYS: usize = 10;

/// Blocks of a group.
const BLOCKS: usize = GROUP / BLOCK;

/// A distance in each direction.
type Reach = [f64; WAYS];

/// The search for the farthest vertices in ten directions: to both sides along each axis, and across the
/// four planes of a view pyramid.
struct Farthest {
    axes: [DVec3; 3],
    slopes: DVec2,
    directions: [DVec3; WAYS],
    /// Distance up to which rounding may move a vertex along each direction.
    rounded: Reach,
}

impl Farthest {
    fn new(axes: [DVec3; 3], slopes: DVec2) -> Self {
        let [x, y, z] = axes;
        let lean = [z * slopes.x, z * slopes.y];
        let directions = [-x, -y, -z, x, y, z, lean[0] + x, lean[1] + y, lean[0] - x, lean[1] - y];
        Self { axes, slopes, directions, rounded: directions.map(|way| ROUNDED * (1.0 + way.abs().element_sum())) }
    }

    /// The farthest that a vertex in a box may reach.
    fn reach(&self, around: &[[f32; 3]; 2]) -> Reach {
        let [middle, half] = middle_and_half(around);
        std::array::from_fn(|i| {
            let way = self.directions[i];
            way.dot(middle) + way.abs().dot(half) + self.rounded[i]
        })
    }

    /// The bounds of some blocks with their boxes. Blocks that reach no farther than `least`, or than the blocks before,
    /// are left out.
    fn lanes_of<'p>(
        &self,
        blocks: impl Iterator<Item = (&'p [[f32; 3]], &'p [[f32; 3]; 2])>,
        least: &Reach,
    ) -> ExtentLanes {
        let mut lanes = ExtentLanes::EMPTY;
        let mut farthest = *least;
        for (block, around) in blocks {
            if !is_within(&self.reach(around), &farthest) {
                self.add(block, &mut lanes);
                let found = lanes.farthest();
                farthest = std::array::from_fn(|i| found[i].max(least[i]));
            }
        }
        lanes
    }

    /// Adds the bounds of at least one position.
    fn add(&self, block: &[[f32; 3]], lanes: &mut ExtentLanes) {
        let (fours, rest) = block.as_chunks();
        fours.iter().for_each(|four| lanes.add(four, self.axes, self.slopes));
        if let Some(first) = rest.first() {
            let mut last = [*first; LANES];
            last[..rest.len()].copy_from_slice(rest);
            lanes.add(&last, self.axes, self.slopes);
        }
    }
}

/// True if nothing that reaches no farther than `reach` goes beyond what is the farthest in each direction.
fn is_within(reach: &Reach, farthest: &Reach) -> bool {
    reach.iter().zip(farthest).fold(true, |is_within, (reach, farthest)| is_within & (reach < farthest))
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
    fn farthest(&self) -> Reach {
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
    use glam::DQuat;

    use super::*;
    use crate::limits::{Budget, Limits};
    use crate::scene::position_boxes::PositionBoxes;

    #[test]
    fn blocks_that_are_left_out_change_no_bound() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut left_out = [0; 2];
        for count in [1, 2, 3, 5, 63, 64, 65, 1000, 40_000, 400_000] {
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
            let boxes = PositionBoxes::of(&positions, &mut Budget::new(&Limits::default())).unwrap();
            let all = Extents::new(BoxedPositions { positions: &positions, boxes: &boxes }, axes, slopes);
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
            let blocks = || positions.chunks(BLOCK).zip(&boxes.blocks);
            let bounds = farthest.lanes_of(blocks(), &[f64::NEG_INFINITY; WAYS]).farthest();
            assert_eq!(bounds, farthest.lanes_of(blocks(), &bounds).farthest());
            let count = |boxes: &[[[f32; 3]; 2]]| {
                boxes.iter().filter(|around| is_within(&farthest.reach(around), &bounds)).count()
            };
            left_out = [left_out[0] + count(&boxes.blocks), left_out[1] + count(&boxes.groups)];
        }
        assert!(left_out[0] > 400 && left_out[1] > 2, "{left_out:?}");
    }
}
