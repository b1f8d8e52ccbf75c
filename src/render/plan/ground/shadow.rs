//! The contact shadow on the plane below a mesh: how much of the sky the mesh's filled faces hide from
//! each place there, roughly.
//!
//! A grid lies on the plane. For each of its cells, a height map has the lowest height of the mesh above it. The
//! mesh above a cell darkens the plane around it: the lower it is, the darker, and the narrower the shadow. This is
//! approximated by blurs of a few widths, each made of three box filters. All is f64 in a fixed order, so it is the
//! same on every machine.

use glam::DVec3;

use crate::limits::Stopped;
use crate::mesh::Mesh;
use crate::plan::PlanError;
use crate::plan::context::PlanContext;
use crate::scene::{GROUND_HEIGHT, GROUND_REACH, GroundPlane};

/// Cells along the longer side of the map.
const CELLS: f64 = 96.0;

/// The radii of the box filters, cells. Three times the largest is less than the map's border.
const RADII: [usize; 5] = [1, 2, 3, 4, 5];

/// Alpha where the mesh lies on the plane.
const DARKEST: f64 = 0.72;

/// Alpha that is too faint to be seen.
const FAINT: f64 = 0.25 / 255.0;

/// Cells that are looked at in large faces. Of further faces only the corners count.
const LOOKS_MAX: u64 = 1 << 26;

/// Looks, or faces, between two looks at the deadline.
const CHECK_EVERY: u64 = 1 << 20;

/// Bytes per cell: its height, alpha, two blurs at work.
const CELL_BYTES: u64 = 8 + 4 + 2 * 8 + 8;

/// A shadow on the plane below a mesh.
pub struct Shadow {
    /// The height of the mesh's lowest point.
    lowest: f64,
    /// The height above it from which nothing darkens the plane.
    highest: f64,
    /// Columns and rows of cells.
    pub size: [usize; 2],
    /// Alpha of black in the middle of each cell, row by row; 0 at the border.
    pub alpha: Vec<f32>,
    low: [f64; 2],
    cell: f64,
}

impl Shadow {
    /// The shadow of the faces whose materials are filled, on the plane below a mesh. None if the
    /// mesh has no extent along it.
    pub fn of(
        mesh: &Mesh,
        is_filled: impl Fn(u32) -> bool,
        plane: &GroundPlane,
        cx: &mut PlanContext<'_>,
    ) -> Result<Option<Self>, PlanError> {
        let GroundPlane { axes, bounds: [right, up, across], side, .. } = *plane;
        if side.is_nan() || side <= 0.0 {
            return Ok(None);
        }
        let (cell, reach) = (side * (1.0 + 2.0 * GROUND_REACH) / CELLS, side * GROUND_REACH);
        let size = [right, across].map(|[low, high]| ((high - low + 2.0 * reach) / cell).ceil() as usize + 1);
        cx.budget.spend("the ground's shadow", (size[0] * size[1]) as u64, CELL_BYTES)?;
        let low = [right[0] - reach, across[0] - reach];
        let map = Self { lowest: up[0], highest: GROUND_HEIGHT * side, size, alpha: Vec::new(), low, cell };
        let mut heights = Heights { map: &map, lowest: vec![f64::INFINITY; size[0] * size[1]], looks: 0 };
        let [right, up, across] = axes;
        for (face, corners) in mesh.triangles.iter().enumerate() {
            if (face as u64).is_multiple_of(CHECK_EVERY) {
                cx.deadline.check()?;
            }
            if is_filled(mesh.triangle_materials.get(face).copied().unwrap_or(0)) {
                let corners = corners.map(|v| DVec3::from(mesh.positions[v as usize].map(f64::from)));
                let corners = corners.map(|p| [right.dot(p), across.dot(p), up.dot(p) - map.lowest]);
                heights.add(corners, cx)?;
            }
        }
        let alpha = darkness(&heights.lowest, &map);
        Ok(Some(Self { alpha, ..map }))
    }

    /// The middle of a column's or a row's cells.
    pub fn middle(&self, axis: usize, index: usize) -> f64 {
        self.low[axis] + (index as f64 + 0.5) * self.cell
    }

    fn index(&self, axis: usize, at: f64) -> usize {
        (((at - self.low[axis]) / self.cell) as usize).min(self.size[axis] - 1)
    }
}

/// The height map while it is made.
struct Heights<'a> {
    map: &'a Shadow,
    lowest: Vec<f64>,
    looks: u64,
}

impl Heights<'_> {
    /// Adds a face: across, across, and its height above the plane.
    fn add(&mut self, corners: [[f64; 3]; 3], cx: &PlanContext<'_>) -> Result<(), Stopped> {
        if corners.iter().all(|corner| corner[2] >= self.map.highest) {
            return Ok(());
        }
        corners.iter().for_each(|corner| self.put(*corner));
        let range = [0, 1].map(|axis| {
            let [a, b, c] = corners.map(|corner| self.map.index(axis, corner[axis]));
            [a.min(b).min(c), a.max(b).max(c)]
        });
        let [columns, rows] = range.map(|[first, last]| last - first);
        if columns + rows == 0 || self.looks > LOOKS_MAX {
            return Ok(());
        }
        let before = self.looks;
        self.looks += ((columns + 1) * (rows + 1)) as u64;
        if before / CHECK_EVERY != self.looks / CHECK_EVERY {
            cx.deadline.check()?;
        }
        // What is upright has sides and no area.
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            self.line(corners[a], corners[b]);
        }
        self.inside(&corners, range);
        Ok(())
    }

    fn put(&mut self, [u, v, height]: [f64; 3]) {
        let at = self.map.index(1, v) * self.map.size[0] + self.map.index(0, u);
        self.lowest[at] = self.lowest[at].min(height);
    }

    /// Adds the points of a side, a cell apart.
    fn line(&mut self, a: [f64; 3], b: [f64; 3]) {
        let steps = ((b[0] - a[0]).abs().max((b[1] - a[1]).abs()) / self.map.cell).ceil();
        for i in 1..steps as usize {
            let share = i as f64 / steps;
            self.put([0, 1, 2].map(|k| a[k] + share * (b[k] - a[k])));
        }
    }

    /// Adds a face's height in the middle of each cell that it covers there.
    fn inside(&mut self, [a, b, c]: &[[f64; 3]; 3], [columns, rows]: [[usize; 2]; 2]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 {
            return;
        }
        let (least, most) = (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2]));
        for row in rows[0]..=rows[1] {
            for column in columns[0]..=columns[1] {
                let at = [self.map.middle(0, column), self.map.middle(1, row)];
                let side = |p: &[f64; 3], q: &[f64; 3]| {
                    ((q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])) / area
                };
                let shares = [side(b, c), side(c, a), side(a, b)];
                if shares.iter().all(|share| *share >= 0.0) {
                    let height = (shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2]).clamp(least, most);
                    let cell = &mut self.lowest[row * self.map.size[0] + column];
                    *cell = cell.min(height);
                }
            }
        }
    }
}

/// Alpha by cell, from the lowest heights.
fn darkness(lowest: &[f64], map: &Shadow) -> Vec<f32> {
    let mut sum = vec![0.0; lowest.len()];
    let mut layer = vec![0.0; lowest.len()];
    for (place, &radius) in RADII.iter().enumerate() {
        for (out, &height) in layer.iter_mut().zip(lowest) {
            let share = (height / map.highest).max(0.0);
            if share >= 1.0 {
                *out = 0.0;
                continue;
            }
            // The width grows with the height, and goes over from one blur to the next.
            let width = share.sqrt() * (RADII.len() - 1) as f64;
            let weight = (1.0 - (width - place as f64).abs()).max(0.0);
            *out = weight * (1.0 - share) * (1.0 - share);
        }
        for _ in 0..3 {
            blur(&mut layer, map.size, radius);
        }
        sum.iter_mut().zip(&layer).for_each(|(sum, layer)| *sum += layer);
    }
    let alpha = |sum: &f64| {
        let alpha = DARKEST * sum.min(1.0);
        if alpha < FAINT { 0.0 } else { alpha as f32 }
    };
    sum.iter().map(alpha).collect()
}

/// A box filter along rows, then along columns. Beyond the border there is nothing.
fn blur(layer: &mut [f64], [columns, rows]: [usize; 2], radius: usize) {
    let mut line = Vec::with_capacity(columns.max(rows));
    for row in 0..rows {
        filter(layer, (row * columns, 1, columns), radius, &mut line);
    }
    for column in 0..columns {
        filter(layer, (column, columns, rows), radius, &mut line);
    }
}

/// A box filter along `count` cells from `first` on, `step` apart.
fn filter(layer: &mut [f64], (first, step, count): (usize, usize, usize), radius: usize, line: &mut Vec<f64>) {
    line.clear();
    line.extend((0..count).map(|i| layer[first + i * step]));
    if line.iter().all(|v| *v == 0.0) {
        return;
    }
    for i in 0..count {
        let window = &line[i.saturating_sub(radius)..count.min(i + radius + 1)];
        layer[first + i * step] = window.iter().sum::<f64>() / (2 * radius + 1) as f64;
    }
}
