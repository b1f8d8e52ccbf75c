//! The faces that lie near silhouette edges on screen, by cells of a grid.
//!
//! Cells are as small as faces usually are, so that a cell lists few of them; and only faces in the
//! cells that edges go through are listed.

use crate::limits::Stopped;
use crate::plan::PlanError;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::edges::select::{map, map_indices};
use crate::plan::outline::ScreenPoint;
use crate::plan::outline::screen_edges::{OutlineView, PX, before, on_screen};

/// The fewest and the most cells.
const CELLS: [f64; 2] = [256.0, 1_048_576.0];

/// Entries of all cells up to which faces are listed, beyond eight per face. Faces are far larger
/// than cells where there are more.
const ENTRIES_MAX: usize = 1 << 20;

/// The cells of a vertex behind the near plane.
const BEHIND: u32 = u32::MAX;

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
        (((v + self.half[axis]) * self.per_unit) as usize).min(self.size[axis] - 1)
    }

    /// The cell of a point.
    pub fn at(&self, [x, y]: [f64; 2]) -> usize {
        self.along(1, y) * self.size[0] + self.along(0, x)
    }

    /// Calls `each` with the cells that a line or a triangle with these corners may touch.
    pub fn each<const N: usize>(&self, corners: &[[f64; 2]; N], mut each: impl FnMut(usize)) {
        let range = |axis: usize| {
            let all = corners.iter().map(|corner| self.along(axis, corner[axis]));
            (all.clone().min().unwrap_or(0), all.max().unwrap_or(0))
        };
        let ((left, right), (top, bottom)) = (range(0), range(1));
        for row in top..=bottom {
            let (from, to) = if right - left <= 1 || top == bottom { (left, right) } else { self.across(corners, row) };
            (from..=to).for_each(|column| each(row * self.size[0] + column));
        }
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
    words: Vec<u64>,
}

impl Marks {
    /// No cell of a grid. The caller has spent [`Marks::bytes`].
    pub fn new(cells: Cells) -> Self {
        Self { cells, words: vec![0; cells.len().div_ceil(64)] }
    }

    /// Memory for this grid.
    pub fn bytes(cells: &Cells) -> u64 {
        cells.len() as u64 / 8 + 8
    }

    /// Marks the cells that a line touches.
    pub fn line(&mut self, ends: &[[f64; 2]; 2]) {
        let words = &mut self.words;
        self.cells.each(ends, |cell| words[cell / 64] |= 1 << (cell % 64));
    }

    /// Marks the cell of a point.
    pub fn point(&mut self, at: [f64; 2]) {
        let cell = self.cells.at(at);
        self.words[cell / 64] |= 1 << (cell % 64);
    }

    #[inline]
    fn has(&self, cell: usize) -> bool {
        self.words[cell / 64] >> (cell % 64) & 1 == 1
    }
}

/// A face on screen.
#[derive(Clone, Copy, Debug)]
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
        let candidates = candidates(view, marks, hides, cx)?;
        let count = candidates.iter().filter(|&&is_one| is_one == 1).count();
        // A face that the near plane cuts may be two.
        cx.budget.spend("faces near an outline", count as u64, 2 * size_of::<ScreenFace>() as u64)?;
        cx.budget.spend("faces near an outline", cells.len() as u64 + 1, 4)?;
        let mut faces: Vec<ScreenFace> = Vec::with_capacity(count);
        let is_listed = |i: &usize| candidates[*i] == 1;
        (0..candidates.len()).filter(is_listed).for_each(|i| screen_faces(view, i, |face| faces.push(face)));
        let mut first = vec![0_u32; cells.len() + 1];
        let mut total = 0;
        let most = ENTRIES_MAX + 8 * view.view.mesh.triangles.len();
        each_entry(&cells, marks, &faces, cx, |_, cell| {
            first[cell] += 1;
            total += 1;
            total <= most
        })?;
        if total > most {
            return Ok(None);
        }
        cx.budget.spend("faces near an outline", total as u64, 4)?;
        // Each cell's end, from which the next pass counts down to its first entry.
        let mut end = 0;
        first.iter_mut().for_each(|count| {
            end += *count;
            *count = end;
        });
        let mut entries = vec![0; total];
        each_entry(&cells, marks, &faces, cx, |face, cell| {
            first[cell] -= 1;
            entries[first[cell] as usize] = face as u32;
            true
        })?;
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

/// By face, 1 if it hides and may lie in a marked cell.
fn candidates(
    view: &OutlineView<'_>,
    marks: &Marks,
    hides: &[bool],
    cx: &mut PlanContext<'_>,
) -> Result<Vec<u8>, PlanError> {
    let (mesh, cells, near) = (view.view.mesh, &marks.cells, view.near());
    cx.budget.spend("faces near an outline", mesh.positions.len() as u64, 4)?;
    cx.budget.spend("faces near an outline", mesh.triangles.len() as u64, 1)?;
    let places = map(&view.view.places, cx.deadline, |&[x, y, w]| {
        if w < near { BEHIND } else { (cells.along(0, x / w) | cells.along(1, y / w) << 16) as u32 }
    })?;
    let is_one = |i: usize| {
        let material = mesh.triangle_materials[i] as usize;
        let hides = hides.get(material).copied().unwrap_or(true);
        if !hides || matches!(view.view.shown(i as u32), None | Some(0)) {
            return false;
        }
        let corners = mesh.triangles[i].map(|v| places[v as usize]);
        if corners.contains(&BEHIND) {
            return true;
        }
        let range = |shift: u32| {
            let [a, b, c] = corners.map(|place| (place >> shift & 0xffff) as usize);
            a.min(b).min(c)..=a.max(b).max(c)
        };
        range(16).any(|row| range(0).any(|column| marks.has(row * cells.size[0] + column)))
    };
    Ok(map_indices(mesh.triangles.len(), cx.deadline, |i| u8::from(is_one(i)))?)
}

/// Calls `each` with what of a face lies before the near plane: nothing, a triangle, or two.
fn screen_faces(view: &OutlineView<'_>, face: usize, mut each: impl FnMut(ScreenFace)) {
    let vertices = view.view.mesh.triangles[face];
    let corners = vertices.map(|v| view.homogeneous(v));
    let near = view.near();
    let mut face = |corners: [ScreenPoint; 3]| {
        let [a, mut b, mut c] = corners.map(|[x, y, z, _]| [x, y, z]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area < 0.0 {
            (b, c) = (c, b);
        }
        if area != 0.0 {
            each(ScreenFace { corners: [a, b, c], vertices });
        }
    };
    if corners.iter().all(|corner| corner[3] >= near) {
        return face(corners.map(on_screen));
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

/// Calls `each` with every face and every marked cell that it may touch, until it returns false.
fn each_entry(
    cells: &Cells,
    marks: &Marks,
    faces: &[ScreenFace],
    cx: &PlanContext<'_>,
    mut each: impl FnMut(usize, usize) -> bool,
) -> Result<(), Stopped> {
    let mut unchecked = 0;
    for (i, face) in faces.iter().enumerate() {
        let mut goes_on = true;
        cells.each(&face.corners.map(|[x, y, _]| [x, y]), |cell| {
            unchecked += 1;
            if goes_on && marks.has(cell) {
                goes_on = each(i, cell);
            }
        });
        if !goes_on {
            break;
        }
        if unchecked >= CHECK_EVERY {
            unchecked = 0;
            cx.deadline.check()?;
        }
    }
    Ok(())
}
