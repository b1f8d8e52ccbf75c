//! Vertices that two meshes have in common: each vertex of the second mesh gets the number of the vertex of the first
//! mesh that lies at the same place, within a tolerance, or else a new number. A grid of small cubes makes the search
//! fast.

use rapidhash::RapidHashMap;

use super::frame::Frame;
use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;

/// Most points of a cell that are looked at. Meshes have one or two in a cell as small as these.
const CELL_POINTS_MAX: usize = 16;

/// Memory of a point in a grid: position, link, and its entry in the map.
const BYTES_PER_POINT: u64 = 24 + 4 + 48;

const NONE: u32 = u32::MAX;

/// Points in cells, to find one within a small distance.
pub struct Grid {
    points: Vec<[f64; 3]>,
    first: RapidHashMap<[i64; 3], u32>,
    /// The next point in the same cell.
    next: Vec<u32>,
    tolerance: f64,
}

impl Grid {
    /// A grid of points; those within `tolerance` of each other count as one.
    pub fn new(points: Vec<[f64; 3]>, tolerance: f64, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        budget.spend("vertices to compare", points.len() as u64, BYTES_PER_POINT)?;
        let mut grid = Self {
            first: RapidHashMap::with_capacity_and_hasher(points.len(), Default::default()),
            next: vec![NONE; points.len()],
            points,
            tolerance,
        };
        // Backwards, so that each cell lists its points in order.
        for index in (0..grid.points.len()).rev() {
            let cell = grid.points[index].map(|value| grid.cell(value));
            let before = grid.first.insert(cell, index as u32);
            grid.next[index] = before.unwrap_or(NONE);
        }
        Ok(grid)
    }

    fn cell(&self, value: f64) -> i64 {
        // Far out, the conversion saturates: all such points are in one cell.
        (value / (4.0 * self.tolerance)).floor() as i64
    }

    /// The nearest point within the tolerance.
    pub fn find(&self, point: [f64; 3]) -> Option<u32> {
        let low = point.map(|value| self.cell(value - self.tolerance));
        let high = point.map(|value| self.cell(value + self.tolerance));
        let along = |k: usize| if low[k] == high[k] { [low[k], NO_CELL] } else { [low[k], high[k]] };
        const NO_CELL: i64 = i64::MIN + 1;
        let mut best = (self.tolerance * self.tolerance, None);
        for x in along(0).into_iter().filter(|x| *x != NO_CELL) {
            for y in along(1).into_iter().filter(|y| *y != NO_CELL) {
                for z in along(2).into_iter().filter(|z| *z != NO_CELL) {
                    let mut index = self.first.get(&[x, y, z]).copied().unwrap_or(NONE);
                    for _ in 0..CELL_POINTS_MAX {
                        let Some(other) = self.points.get(index as usize) else { break };
                        let squared = (0..3).map(|k| (point[k] - other[k]).powi(2)).sum::<f64>();
                        if squared < best.0 || (squared == best.0 && best.1.is_none()) {
                            best = (squared, Some(index));
                        }
                        index = self.next[index as usize];
                    }
                }
            }
        }
        best.1
    }
}

/// For each vertex of `b` the one of `a` that it is, or else a number of its own from `a`'s count on.
/// `tolerance` is in the unit box of `a`.
pub fn numbers(a: &Mesh, b: &Mesh, tolerance: f64, budget: &mut Budget) -> Result<Vec<u32>, LimitExceeded> {
    budget.spend("vertices to compare", b.positions.len() as u64, 4)?;
    if a.to_file == b.to_file && a.positions == b.positions {
        return Ok((0..b.positions.len() as u32).collect());
    }
    let points = a.positions.iter().map(|position| position.map(f64::from)).collect();
    let grid = Grid::new(points, tolerance, budget)?;
    let frame = Frame::between(&b.to_file, &a.to_file);
    let mut new = a.positions.len() as u32;
    let number = |position: &[f32; 3]| match grid.find(frame.map(*position)) {
        Some(same) => same,
        None => {
            new = new.wrapping_add(1);
            new.wrapping_sub(1)
        }
    };
    Ok(b.positions.iter().map(number).collect())
}
