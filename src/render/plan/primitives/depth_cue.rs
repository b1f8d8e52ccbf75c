//! The depth cue of lit points: a point is darker where points beside it on screen are nearer, so that
//! a dense cloud reads as a surface and its silhouettes stand out.
//!
//! This is eye-dome lighting (Boucheny, "Visualisation scientifique de grands volumes de donnees", 2009)
//! computed once per point instead of once per pixel. Both back-ends draw its result as colours.

use glam::DVec2;

use crate::limits::Deadline;
use crate::mesh::MaterialSlot;
use crate::plan::PlanError;
use crate::plan::context::CHECK_EVERY;
use crate::spec::{DebugView, Layers, Shading};

/// Strength of the cue.
const STRENGTH: f64 = 1.5;

/// Largest slope that counts: a silhouette is not darker for being far in front of what it hides.
const SLOPE_MAX: f64 = 4.0;

/// Cells of the grid per point's width. A point covers three by three cells, and those that are compared
/// with it are three cells away.
const CELLS_PER_POINT: f64 = 3.0;

/// Most cells of the grid on a side.
const CELLS_MAX: f64 = 4096.0;

/// Bytes per point: its place, and its shade.
pub const POINT_BYTES: u64 = size_of::<Seen>() as u64 + 4;

/// A point as it is seen.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Place on screen, pixels from the upper left corner.
    pub at_px: DVec2,
    /// Distance from the viewer, in units of the box. Only differences count.
    pub depth: f64,
    /// A pixel there, in units of the box.
    pub px: f64,
}

/// True if points of a material have the cue: those that are lit.
pub fn is_cued(slot: &MaterialSlot, layers: &Layers) -> bool {
    layers.surface.is_some_and(|surface| {
        let is_lit = surface.shading != Shading::Unlit && !(slot.unlit && surface.shading == Shading::Smooth);
        is_lit && surface.debug == DebugView::None
    })
}

/// The grid for points of this width in a picture of this size.
pub struct Grid {
    cell_px: f64,
    columns: usize,
    rows: usize,
}

impl Grid {
    /// A grid whose cells are at least a pixel wide.
    pub fn new(size_px: [u32; 2], point_px: f64) -> Self {
        let cell_px = (point_px / CELLS_PER_POINT).max(1.0);
        let cells = |size: u32| (f64::from(size) / cell_px).clamp(1.0, CELLS_MAX) as usize + 1;
        Self { cell_px, columns: cells(size_px[0]), rows: cells(size_px[1]) }
    }

    /// Memory that [`shades`](Self::shades) takes beside that of the points, bytes.
    pub fn bytes(&self) -> u64 {
        4 * (self.columns * self.rows) as u64
    }

    /// The share of light that each point keeps.
    pub fn shades(&self, points: &[Seen], deadline: &Deadline) -> Result<Vec<f32>, PlanError> {
        let nearest = self.nearest(points, deadline)?;
        let mut shades = Vec::with_capacity(points.len());
        for (i, point) in points.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                deadline.check()?;
            }
            let Some(cell) = self.cell(point) else {
                shades.push(1.0);
                continue;
            };
            let mut slopes = 0.0;
            for [x, y] in AROUND {
                let Some(beside) = self.index([cell[0] + 3 * x, cell[1] + 3 * y]).map(|cell| nearest[cell]) else {
                    continue;
                };
                let Some(other) = points.get(beside as usize) else { continue };
                let across = (point.at_px - other.at_px).length().max(self.cell_px) * point.px;
                slopes += ((point.depth - other.depth) / across).clamp(0.0, SLOPE_MAX);
            }
            shades.push((1.0 / (1.0 + STRENGTH * slopes / AROUND.len() as f64)) as f32);
        }
        Ok(shades)
    }

    /// The nearest point that covers each cell, by its number; equally near ones by the lowest.
    fn nearest(&self, points: &[Seen], deadline: &Deadline) -> Result<Vec<u32>, PlanError> {
        let mut nearest = vec![u32::MAX; self.columns * self.rows];
        for (i, point) in points.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                deadline.check()?;
            }
            let Some([x, y]) = self.cell(point) else { continue };
            for cell in (-1..=1).flat_map(|dy| (-1..=1).filter_map(move |dx| self.index([x + dx, y + dy]))) {
                let is_nearer = points.get(nearest[cell] as usize).is_none_or(|known| point.depth < known.depth);
                if is_nearer {
                    nearest[cell] = i as u32;
                }
            }
        }
        Ok(nearest)
    }

    /// Column and row of a point's cell; None outside of the picture.
    fn cell(&self, point: &Seen) -> Option<[i64; 2]> {
        let [x, y] = (point.at_px / self.cell_px).to_array();
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.columns as f64 && y < self.rows as f64;
        is_inside.then_some([x as i64, y as i64])
    }

    fn index(&self, [x, y]: [i64; 2]) -> Option<usize> {
        let is_inside = x >= 0 && y >= 0 && x < self.columns as i64 && y < self.rows as i64;
        is_inside.then(|| y as usize * self.columns + x as usize)
    }
}

/// Directions to the cells beside one.
const AROUND: [[i64; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

#[cfg(test)]
mod tests {
    use super::*;

    fn shades(points: &[Seen]) -> Vec<f32> {
        Grid::new([300, 300], 3.0).shades(points, &Deadline::default()).unwrap()
    }

    /// A plane of points 2 px apart, whose depth grows by `slope` from the left to the right.
    fn plane(slope: f64) -> Vec<Seen> {
        let at = |i: u32| DVec2::new(f64::from(i % 100) * 2.0 + 20.0, f64::from(i / 100) * 2.0 + 20.0);
        (0..10_000).map(|i| Seen { at_px: at(i), depth: 5.0 + slope * 0.01 * at(i).x, px: 0.01 }).collect()
    }

    #[test]
    fn a_plane_is_darker_the_more_it_turns_away() {
        let inner = |slope: f64| {
            let shades = shades(&plane(slope));
            let inner: Vec<f32> = (0..10_000).filter(|i| i % 100 > 4 && i % 100 < 95).map(|i| shades[i]).collect();
            let mean = inner.iter().sum::<f32>() / inner.len() as f32;
            assert!(inner.iter().all(|shade| (shade - mean).abs() < 0.3 * mean), "{slope} is even");
            mean
        };
        let [flat, some, steep] = [0.0, 0.7, 2.5].map(inner);
        assert_eq!(flat, 1.0);
        assert!(some < 0.9 && steep < some - 0.1, "{some} {steep}");
    }

    #[test]
    fn what_is_behind_an_edge_is_dark_and_points_alone_are_not() {
        let step = |i: u32| if i % 100 < 50 { 1.0 } else { 5.0 };
        let points: Vec<Seen> =
            plane(0.0).into_iter().zip(0..).map(|(point, i)| Seen { depth: step(i), ..point }).collect();
        let shades_of = shades(&points);
        assert_eq!(shades_of[50 * 100 + 48], 1.0, "the nearer side");
        assert!(shades_of[50 * 100 + 51] < 0.7, "{}", shades_of[50 * 100 + 51]);
        let alone: Vec<Seen> = points.into_iter().step_by(97).collect();
        let lit = shades(&alone).iter().filter(|&&shade| shade == 1.0).count();
        assert!(lit > alone.len() * 9 / 10, "{lit} of {}", alone.len());
    }

    #[test]
    fn points_outside_and_odd_numbers_do_no_harm() {
        let odd = [f64::NAN, f64::INFINITY, -1e30, 1e30, -0.5, 299.99, 300.0];
        let points: Vec<Seen> =
            odd.into_iter().flat_map(|x| odd.map(|y| Seen { at_px: DVec2::new(x, y), depth: x, px: 0.01 })).collect();
        assert_eq!(shades(&points).len(), 49);
    }
}
