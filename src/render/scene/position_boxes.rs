//! Boxes around runs of consecutive positions of a mesh. A camera is fitted to the positions that are the farthest in some
//! direction, and the boxes say which runs may have such a position. They do not depend on the camera.

use glam::DVec3;

use crate::limits::{Budget, LimitExceeded};
use crate::parallel::map;

/// Positions of a block.
pub const BLOCK: usize = 64;

/// Positions of a group: a whole number of blocks.
pub const GROUP: usize = 16 * BLOCK;

/// Groups that a thread takes at a time.
const CHUNK: usize = 16;

/// A box: its lower and upper corner.
type Corners = [[f32; 3]; 2];

/// The boxes around a list of positions.
#[derive(Debug, Default)]
pub struct PositionBoxes {
    /// Around each [`BLOCK`] of positions.
    pub blocks: Vec<Corners>,
    /// Around each [`GROUP`].
    pub groups: Vec<Corners>,
}

/// Positions, with the boxes around them.
#[derive(Clone, Copy, Debug)]
pub struct BoxedPositions<'a> {
    /// The positions.
    pub positions: &'a [[f32; 3]],
    /// Their boxes.
    pub boxes: &'a PositionBoxes,
}

impl PositionBoxes {
    /// The boxes around positions.
    pub fn of(positions: &[[f32; 3]], budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let count = positions.len().div_ceil(BLOCK) + positions.len().div_ceil(GROUP);
        // Twice: by thread, and in one list. The room of the first is enough for the lists of a search (`extents`).
        budget.spend("boxes of positions", count as u64, 2 * size_of::<Corners>() as u64)?;
        let boxes = |part: &[[f32; 3]]| part.chunks(BLOCK).map(box_of).collect::<Vec<_>>();
        let blocks = map(positions.chunks(CHUNK * GROUP).collect(), boxes).concat();
        let groups = blocks.chunks(GROUP / BLOCK).map(around).collect();
        Ok(Self { blocks, groups })
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..]) + size_of_val(&self.groups[..])
    }
}

/// Middle and half the size of a box.
pub fn middle_and_half(corners: &Corners) -> [DVec3; 2] {
    let [low, high] = corners.map(|corner| DVec3::from(corner.map(f64::from)));
    [(low + high) * 0.5, (high - low) * 0.5]
}

/// The box around at least one box.
fn around(boxes: &[Corners]) -> Corners {
    let mut all = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for [low, high] in boxes {
        all = [[0, 1, 2].map(|k| all[0][k].min(low[k])), [0, 1, 2].map(|k| all[1][k].max(high[k]))];
    }
    all
}

/// Numbers of four positions, which are looked at side by side.
const LANES: usize = 12;

/// The box around at least one position.
fn box_of(block: &[[f32; 3]]) -> Corners {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let mut add = |four: &[f32; LANES]| {
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
    let over = |v: [f32; LANES], pick: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|k| (k..LANES).step_by(3).fold(v[k], |found, i| pick(found, v[i])))
    };
    [over(low, f32::min), over(high, f32::max)]
}
