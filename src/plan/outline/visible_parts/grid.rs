//! The faces that lie near silhouette edges on screen, by cells of a grid.
//!
//! Cells are as small as faces usually are, so that a cell lists few of them; and only faces in the
//! cells that edges go through are listed.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use crate::limits::{Deadline, Stopped};
use crate::parallel;
use crate::plan::PlanError;
use crate::plan::context::PlanContext;
use crate::plan::edges::face_runs::{FACES, FaceRuns};
use crate::plan::edges::select::{map, select_by};
use crate::plan::outline::ScreenPoint;
use crate::plan::outline::screen_edges::{OutlineView, PX, before, on_screen};

/// The fewest and the most cells.
const CELLS: [f64; 2] = [256.0, 1_048_576.0];

/// Entries of all cells up to which faces are listed, beyond eight per face. Faces are far larger
/// than cells where there are more.
const ENTRIES_MAX: usize = 1 << 20;

/// Runs of faces, and faces, that a thread takes at a time.
const RUNS: usize = 64;
const PIECE: usize = 1024;

/// A grid over the picture. What lies beside the picture belongs to the cells at its border.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// Half the picture's size, 1/256 px.
    half: [f64; 2],
    /// Cells per 1/256 px.
    per_unit: f64,
    /// Columns and rows.
    size: [usize; 2],
}

impl Cells {
    /// Cells for so many faces in a picture of this size. They are a power of two pixels wide.
    pub fn new(half: [f64; 2], faces: usize) -> Self {
        let count = (faces as f64).clamp(CELLS[0], CELLS[1]);
        let mut width = PX;
        while 4.0 * half[0] * half[1] > count * width * width {
            width *= 2.0;
        }
        let size = half.map(|half| (2.0 * half / width) as usize + 1);
        Self { half, per_unit: 1.0 / width, size }
    }

    /// The number of cells.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The column (axis 0) or row (1) of a coordinate.
    #[inline]
    fn along(&self, axis: usize, v: f64) -> usize {
        let at = ((v + self.half[axis]) * self.per_unit) as i32;
        (at.max(0) as usize).min(self.size[axis] - 1)
    }

    /// The cell of a point.
    pub fn at(&self, [x, y]: [f64; 2]) -> usize {
        self.along(1, y) * self.size[0] + self.along(0, x)
    }

    /// Calls `each` with the cells that a line or a triangle with these corners may touch.
    pub fn each<const N: usize>(&self, corners: &[[f64; 2]; N], mut each: impl FnMut(usize)) {
        self.each_row(corners, |row, from, to| (from..=to).for_each(|column| each(row * self.size[0] + column)));
    }

    /// Calls `each` with the rows of these cells, and the first and the last column in each.
    #[inline]
    fn each_row<const N: usize>(&self, corners: &[[f64; 2]; N], mut each: impl FnMut(usize, usize, usize)) {
        let [[left, top], [right, bottom]] = self.around(corners);
        for row in top..=bottom {
            let (from, to) = if right - left <= 1 || top == bottom { (left, right) } else { self.across(corners, row) };
            each(row, from, to);
        }
    }

    /// The first and the last column and row of some points.
    #[inline]
    fn around<const N: usize>(&self, points: &[[f64; 2]; N]) -> [[usize; 2]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for axis in 0..2 {
                // Not `f64::min` and `max`, which look for NaN.
                low[axis] = if point[axis] < low[axis] { point[axis] } else { low[axis] };
                high[axis] = if point[axis] > high[axis] { point[axis] } else { high[axis] };
            }
        }
        [[self.along(0, low[0]), self.along(1, low[1])], [self.along(0, high[0]), self.along(1, high[1])]]
    }

    /// The first and the last column of what lies in a row.
    fn across<const N: usize>(&self, corners: &[[f64; 2]; N], row: usize) -> (usize, usize) {
        let border = |row: usize| row as f64 / self.per_unit - self.half[1];
        let upper = if row == 0 { f64::NEG_INFINITY } else { border(row) - 1.0 };
        let lower = if row + 1 == self.size[1] { f64::INFINITY } else { border(row + 1) + 1.0 };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % N];
            let (first, last) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            if first[1] > lower || last[1] < upper {
                continue;
            }
            let at = |y: f64| first[0] + (last[0] - first[0]) * ((y - first[1]) / (last[1] - first[1]));
            for x in
                [if first[1] < upper { at(upper) } else { first[0] }, if last[1] > lower { at(lower) } else { last[0] }]
            {
                (low, high) = (low.min(x), high.max(x));
            }
        }
        (self.along(0, low - 1.0), self.along(0, high + 1.0))
    }
}

/// The cells that are asked about.
pub struct Marks {
    /// The grid.
    pub cells: Cells,
    /// Words of each row.
    row_words: usize,
    words: Vec<u64>,
}

impl Marks {
    /// No cell of a grid. The caller has spent [`Marks::bytes`].
    pub fn new(cells: Cells) -> Self {
        let row_words = cells.size[0].div_ceil(64);
        Self { cells, row_words, words: vec![0; row_words * cells.size[1]] }
    }

    /// Memory for this grid.
    pub fn bytes(cells: &Cells) -> u64 {
        (cells.size[0].div_ceil(64) * cells.size[1]) as u64 * 8
    }

    /// Marks the cells that a line touches.
    pub fn line(&mut self, ends: &[[f64; 2]; 2]) {
        let (words, row_words) = (&mut self.words, self.row_words);
        self.cells.each_row(ends, |row, from, to| {
            (from..=to).for_each(|column| words[row * row_words + column / 64] |= 1 << (column % 64));
        });
    }

    /// Marks the cell of a point.
    pub fn point(&mut self, [x, y]: [f64; 2]) {
        let (column, row) = (self.cells.along(0, x), self.cells.along(1, y));
        self.words[row * self.row_words + column / 64] |= 1 << (column % 64);
    }

    /// Calls `each` with the first cell of 64 in a row, and the bits of those that are marked, from a column
    /// to another.
    #[inline]
    fn each_word(&self, row: usize, [from, to]: [usize; 2], mut each: impl FnMut(usize, u64)) {
        for word in from / 64..=to / 64 {
            let mut bits = self.words[row * self.row_words + word];
            if word == from / 64 {
                bits &= u64::MAX << (from % 64);
            }
            if word == to / 64 {
                bits &= u64::MAX >> (63 - to % 64);
            }
            if bits != 0 {
                each(row * self.cells.size[0] + word * 64, bits);
            }
        }
    }

    /// True if any cell around some points is marked.
    #[inline]
    fn meet<const N: usize>(&self, points: &[[f64; 2]; N]) -> bool {
        let [[left, top], [right, bottom]] = self.cells.around(points);
        (top..=bottom).any(|row| {
            let mut is_met = false;
            self.each_word(row, [left, right], |_, _| is_met = true);
            is_met
        })
    }

    /// Calls `each` with the marked cells that a triangle may touch.
    #[inline]
    fn each_marked(&self, corners: &[[f64; 2]; 3], mut each: impl FnMut(usize)) {
        self.cells.each_row(corners, |row, from, to| {
            if from <= to {
                self.each_word(row, [from, to], |first, mut bits| {
                    while bits != 0 {
                        each(first + bits.trailing_zeros() as usize);
                        bits &= bits - 1;
                    }
                });
            }
        });
    }
}

/// A face on screen.
#[derive(Clone, Copy, Debug, bytemuck::Zeroable)]
pub struct ScreenFace {
    /// X, y and reversed depth; their area is positive.
    pub corners: [[f64; 3]; 3],
    /// The face's vertices, also where it is cut at the near plane.
    pub vertices: [u32; 3],
}

/// The faces that hide what is behind them, by cell.
pub struct FaceGrid {
    /// The grid.
    pub cells: Cells,
    /// By cell, the first of its entries; one more than there are cells.
    first: Vec<u32>,
    /// Indices of faces.
    entries: Vec<u32>,
    faces: Vec<ScreenFace>,
}

impl FaceGrid {
    /// The faces in the marked cells, of the materials that hide (`hides`, by material). None if
    /// there is no such material, or if there are too many entries.
    pub fn of(
        view: &OutlineView<'_>,
        marks: &Marks,
        hides: &[bool],
        cx: &mut PlanContext<'_>,
    ) -> Result<Option<Self>, PlanError> {
        if !hides.contains(&true) {
            return Ok(None);
        }
        let cells = marks.cells;
        let mesh = view.view.mesh;
        let runs = near_runs(view, marks, cx)?;
        let near = near_faces(view, marks, hides, &runs, cx)?;
        let faces: Vec<ScreenFace> = select_by("faces near an outline", [runs.len(), RUNS], cx, |range, found| {
            for (&run, &near) in runs[range.clone()].iter().zip(&near[range]) {
                let mut rest = near;
                while rest != 0 {
                    screen_faces(view, run as usize * FACES + rest.trailing_zeros() as usize, &mut *found);
                    rest &= rest - 1;
                }
            }
        })?;
        let most = ENTRIES_MAX + 8 * mesh.triangles.len();
        let Some(counts) = count_entries(marks, &faces, most, cx.deadline)? else { return Ok(None) };
        let total = counts.iter().sum::<usize>();
        // Entries with their cells, and without.
        cx.budget.spend("faces near an outline", total as u64, 8 + 4)?;
        cx.budget.spend("faces near an outline", cells.len() as u64 + 1, 4)?;
        let pairs = entries_and_cells(marks, &faces, &counts, cx.deadline)?;
        let mut first = vec![0_u32; cells.len() + 1];
        pairs.iter().for_each(|&[_, cell]| first[cell as usize] += 1);
        // Each cell's end, from which the next pass counts down to its first entry.
        let mut end = 0;
        first.iter_mut().for_each(|count| {
            end += *count;
            *count = end;
        });
        let mut entries = vec![0; total];
        for &[face, cell] in &pairs {
            let place = &mut first[cell as usize];
            *place -= 1;
            entries[*place as usize] = face;
        }
        Ok(Some(Self { cells, first, entries, faces }))
    }

    /// The number of faces in a cell.
    pub fn count(&self, cell: usize) -> usize {
        (self.first[cell + 1] - self.first[cell]) as usize
    }

    /// The faces in a cell.
    pub fn faces(&self, cell: usize) -> impl Iterator<Item = &ScreenFace> {
        let range = self.first[cell] as usize..self.first[cell + 1] as usize;
        self.entries[range].iter().map(|&face| &self.faces[face as usize])
    }
}

/// The runs of faces that may lie in a marked cell, in order.
fn near_runs(view: &OutlineView<'_>, marks: &Marks, cx: &mut PlanContext<'_>) -> Result<Vec<u32>, PlanError> {
    let runs = &view.view.runs.runs;
    // Marks, and the list.
    cx.budget.spend("faces near an outline", runs.len() as u64, 1 + 4)?;
    let run_view = &view.view.run_view;
    let is_near = map(runs, cx.deadline, |run| u8::from(run_view.place(run).is_none_or(|place| marks.meet(&place))))?;
    let mut near = Vec::with_capacity(runs.len());
    near.extend(is_near.iter().zip(0..).filter(|(is_near, _)| **is_near == 1).map(|(_, r)| r));
    Ok(near)
}

/// By run, the bits of the faces that hide and may lie in a marked cell.
fn near_faces(
    view: &OutlineView<'_>,
    marks: &Marks,
    hides: &[bool],
    runs: &[u32],
    cx: &mut PlanContext<'_>,
) -> Result<Vec<u32>, PlanError> {
    let (mesh, near) = (view.view.mesh, view.near());
    let is_near = |face: usize| {
        let hides = hides.get(mesh.triangle_materials[face] as usize).copied().unwrap_or(true);
        if !hides || matches!(view.view.shown(face as u32), None | Some(0)) {
            return false;
        }
        let [a, b, c] = mesh.triangles[face];
        let [a, b, c] = [view.view.place(a), view.view.place(b), view.view.place(c)];
        let is_cut = (a[2] < near) | (b[2] < near) | (c[2] < near);
        is_cut || marks.meet(&[[a[0] / a[2], a[1] / a[2]], [b[0] / b[2], b[1] / b[2]], [c[0] / c[2], c[1] / c[2]]])
    };
    let bits = |&run: &u32| {
        let faces = FaceRuns::faces(run as usize, mesh.triangles.len());
        faces.zip(0..).fold(0_u32, |bits, (face, k)| bits | u32::from(is_near(face)) << k)
    };
    // Twice: in pieces, and in one list.
    cx.budget.spend("faces near an outline", runs.len() as u64, 4 + 4)?;
    let deadline = cx.deadline;
    let pieces = parallel::map(runs.chunks(RUNS).collect(), |piece: &[u32]| {
        deadline.check()?;
        Ok(piece.iter().map(bits).collect::<Vec<u32>>())
    });
    Ok(pieces.into_iter().collect::<Result<Vec<_>, Stopped>>()?.concat())
}

/// The number of entries of each piece of the faces; None if there are more than `most` in all.
fn count_entries(
    marks: &Marks,
    faces: &[ScreenFace],
    most: usize,
    deadline: &Deadline,
) -> Result<Option<Vec<usize>>, Stopped> {
    let all = AtomicUsize::new(0);
    let counts: Result<Vec<usize>, Stopped> = parallel::map(faces.chunks(PIECE).collect(), |piece| {
        deadline.check()?;
        let mut count = 0;
        // What is counted no more does not matter: there are too many already.
        for face in piece.iter().take_while(|_| all.load(Relaxed) <= most) {
            let before = count;
            marks.each_marked(&flat(face), |_| count += 1);
            all.fetch_add(count - before, Relaxed);
        }
        Ok(count)
    })
    .into_iter()
    .collect();
    Ok(Some(counts?).filter(|counts| counts.iter().sum::<usize>() <= most))
}

/// Every face with every marked cell that it may touch, of which there are so many in each piece.
fn entries_and_cells(
    marks: &Marks,
    faces: &[ScreenFace],
    counts: &[usize],
    deadline: &Deadline,
) -> Result<Vec<[u32; 2]>, Stopped> {
    let mut all = vec![[0; 2]; counts.iter().sum()];
    let (mut pieces, mut rest) = (Vec::with_capacity(counts.len()), &mut all[..]);
    for ((piece, first), &count) in faces.chunks(PIECE).zip((0..).step_by(PIECE)).zip(counts) {
        let (place, after) = rest.split_at_mut(count);
        pieces.push((piece, first, place));
        rest = after;
    }
    let fill = |(piece, first, place): (&[ScreenFace], u32, &mut [[u32; 2]])| {
        deadline.check()?;
        let mut places = place.iter_mut();
        for (face, i) in piece.iter().zip(first..) {
            marks.each_marked(&flat(face), |cell| {
                if let Some(place) = places.next() {
                    *place = [i, cell as u32];
                }
            });
        }
        Ok(())
    };
    parallel::map(pieces, fill).into_iter().collect::<Result<(), Stopped>>()?;
    Ok(all)
}

/// The corners without their depths.
#[inline]
fn flat(face: &ScreenFace) -> [[f64; 2]; 3] {
    let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = face.corners;
    [[ax, ay], [bx, by], [cx, cy]]
}

/// Calls `each` with what of a face lies before the near plane: nothing, a triangle, or two.
#[inline]
fn screen_faces(view: &OutlineView<'_>, face: usize, each: &mut dyn FnMut(ScreenFace)) {
    let vertices = view.view.mesh.triangles[face];
    let near = view.near();
    let mut face = |corners: [ScreenPoint; 3]| {
        let [[ax, ay, az, _], [bx, by, bz, _], [cx, cy, cz, _]] = corners;
        let (a, mut b, mut c) = ([ax, ay, az], [bx, by, bz], [cx, cy, cz]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area < 0.0 {
            (b, c) = (c, b);
        }
        if area != 0.0 {
            each(ScreenFace { corners: [a, b, c], vertices });
        }
    };
    let corners = [view.homogeneous(vertices[0]), view.homogeneous(vertices[1]), view.homogeneous(vertices[2])];
    if corners.iter().all(|corner| corner[3] >= near) {
        return face([on_screen(corners[0]), on_screen(corners[1]), on_screen(corners[2])]);
    }
    let mut cut = [[0.0; 4]; 4];
    let mut count = 0;
    for k in 0..3 {
        let (from, to) = (&corners[k], &corners[(k + 1) % 3]);
        if from[3] >= near {
            cut[count] = on_screen(*from);
            count += 1;
        }
        if (from[3] >= near) != (to[3] >= near) {
            let (inside, outside) = if from[3] >= near { (from, to) } else { (to, from) };
            cut[count] = on_screen(before(near, inside, outside));
            count += 1;
        }
    }
    for k in 2..count {
        face([cut[0], cut[k - 1], cut[k]]);
    }
}
