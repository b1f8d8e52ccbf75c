//! The faces that may hide a part of an outline: those that lie near its edges on screen, listed by
//! the cells of a grid over the picture.
//!
//! There are about as many cells as faces, within limits, so that a cell lists few. Only cells through
//! which an edge goes, or in which `visible_parts` looks at a place beside an edge, list faces. Faces
//! are clipped at the near plane before they are put on screen.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use super::cells::{Cells, Marks};
use crate::limits::{Deadline, Stopped};
use crate::parallel;
use crate::plan::PlanError;
use crate::plan::context::PlanContext;
use crate::plan::edges::face_runs::{FACES, FaceRuns};
use crate::plan::edges::select::{map, select_by};
use crate::plan::outline::ScreenPoint;
use crate::plan::outline::screen_edges::{OutlineView, before, on_screen};

/// Entries of all cells up to which faces are listed, beyond eight per face. Faces are far larger
/// than cells where there are more.
const ENTRIES_MAX: usize = 1 << 20;

/// Runs of faces, and faces, that a thread takes at a time.
const RUNS: usize = 64;
const PIECE: usize = 1024;

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
        let faces: Vec<ScreenFace> = select_by("faces near an outline", runs.len(), RUNS, cx, |range, found| {
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
    let (mesh, near_w) = (view.view.mesh, view.view.near_w());
    let is_near = |face: usize| {
        let hides = hides.get(mesh.triangle_materials[face] as usize).copied().unwrap_or(true);
        if !hides || matches!(view.view.shown(face as u32), None | Some(0)) || view.view.is_unseen(face as u32) {
            return false;
        }
        let [a, b, c] = mesh.triangles[face];
        let [a, b, c] = [view.view.place(a), view.view.place(b), view.view.place(c)];
        let is_cut = (a[2] < near_w) | (b[2] < near_w) | (c[2] < near_w);
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
    let near_w = view.view.near_w();
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
    if corners.iter().all(|corner| corner[3] >= near_w) {
        return face([on_screen(corners[0]), on_screen(corners[1]), on_screen(corners[2])]);
    }
    let mut cut = [[0.0; 4]; 4];
    let mut count = 0;
    for k in 0..3 {
        let (from, to) = (&corners[k], &corners[(k + 1) % 3]);
        if from[3] >= near_w {
            cut[count] = on_screen(*from);
            count += 1;
        }
        if (from[3] >= near_w) != (to[3] >= near_w) {
            let (inside, outside) = if from[3] >= near_w { (from, to) } else { (to, from) };
            cut[count] = on_screen(before(near_w, inside, outside));
            count += 1;
        }
    }
    for k in 2..count {
        face([cut[0], cut[k - 1], cut[k]]);
    }
}
