//! Sorting of triangles into bands of rows, before the stage visibility. Triangles that no sample
//! can show are dropped here, eight at a time.

use std::ops::Range;

use super::bin::Bin;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::batch::corners;
use crate::backend::cpu::geometry::clip::clip_triangle;
use crate::backend::cpu::geometry::samples::SampleGrid;
use crate::backend::cpu::geometry::setups::Corners;
use crate::backend::cpu::geometry::transform::{OUTSIDE, ScreenVertex, homogeneous};
use crate::backend::cpu::geometry::visibility::{area, passes_culling};
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::{DrawPlan, Faces, pass_mask};

/// Triangles that touch this many bands are listed once for all of them. Otherwise large ones on a
/// tall picture would take gigabytes of lists.
const TALL_BANDS: usize = 4;

/// Triangles of one pass.
pub struct TrianglePass {
    /// Their ids.
    pub ids: Range<usize>,
    /// Bit that a triangle's pass mask must have; 0 for the outline mesh, which has no masks.
    pub pass_bit: u8,
    /// The faces that are drawn, where a triangle's pass mask does not say.
    pub faces: Faces,
}

/// A chunk's triangles by band.
#[derive(Default)]
pub struct TriangleBin {
    /// The chunk's ids.
    pub ids: Range<usize>,
    /// Ids of triangles that face the viewer and need no clipping.
    pub fronts: BandLists,
    /// Ids of those that face away.
    pub backs: BandLists,
    /// Id and pieces of clipped triangles.
    pieces: Vec<(u32, [ScreenVertex; 3])>,
    /// Indices into `pieces`.
    piece_bands: Bin,
}

/// Triangles by band, in one list.
#[derive(Default)]
pub struct BandLists {
    /// Index in `items` of each band's first item, then the end of the last band's.
    starts: Vec<u32>,
    items: Vec<u32>,
    /// Triangles that touch many bands.
    tall: Vec<Spanned>,
    /// Every triangle's id once, in ascending order.
    pub all: Vec<u32>,
}

/// A triangle's id, and the first and last band that it touches.
#[derive(Clone, Copy, Default)]
struct Spanned {
    id: u32,
    bands: [u16; 2],
}

impl Spanned {
    #[inline(always)]
    fn span(self) -> Range<usize> {
        self.bands[0] as usize..self.bands[1] as usize + 1
    }

    #[inline(always)]
    fn is_tall(self) -> bool {
        self.span().len() > TALL_BANDS
    }
}

impl BandLists {
    fn new(spanned: &[Spanned], bands: usize) -> Self {
        let mut lists = Self { starts: vec![0; bands + 2], all: Vec::with_capacity(spanned.len()), ..Self::default() };
        // Counts, shifted by one band, become starts, which the second pass moves to the ends.
        for s in spanned {
            lists.all.push(s.id);
            if s.is_tall() {
                lists.tall.push(*s);
                continue;
            }
            for band in s.span() {
                lists.starts[band + 2] += 1;
            }
        }
        for band in 2..lists.starts.len() {
            lists.starts[band] += lists.starts[band - 1];
        }
        lists.items.resize(lists.starts[bands + 1] as usize, 0);
        for s in spanned.iter().filter(|s| !s.is_tall()) {
            for band in s.span() {
                let place = &mut lists.starts[band + 1];
                lists.items[*place as usize] = s.id;
                *place += 1;
            }
        }
        lists
    }

    /// Ids of the band's triangles: of those in few bands, and of others.
    pub fn items_in(&self, band: usize) -> (&[u32], Vec<u32>) {
        let is_here = |s: &&Spanned| (s.bands[0] as usize..=s.bands[1] as usize).contains(&band);
        (self.listed_in(band), self.tall.iter().filter(is_here).map(|s| s.id).collect())
    }

    /// True if the band has no triangle.
    pub fn is_empty_in(&self, band: usize) -> bool {
        self.tall.is_empty() && self.listed_in(band).is_empty()
    }

    fn listed_in(&self, band: usize) -> &[u32] {
        let at = |i: usize| self.starts.get(i).map_or(0, |&start| start as usize);
        &self.items[at(band)..at(band + 1)]
    }
}

impl TriangleBin {
    /// Sorts a pass's triangles into bands of `rows`, and into those to which they are as close as
    /// `margin` rows.
    pub fn new(context: &RasterContext<'_>, [rows, margin]: [u32; 2], pass: &TrianglePass) -> Self {
        let plan = context.plan;
        let bands = plan.height_px.div_ceil(rows) as usize;
        let range = |size: u32| plan.seen_range(size);
        let bounds = Bounds {
            grid: SampleGrid::new(plan.samples),
            half: [plan.width_px, plan.height_px].map(|size| size as i32 * 128),
            ranges: [range(plan.width_px), range(plan.height_px)],
            rows: rows as i32,
            margin: margin as i32,
            row_last: plan.height_px as i32 - 1,
        };
        let mut kept = Kept::with_room_for(pass.ids.len());
        keep(context.isa, context, &bounds, pass, &mut kept);
        let mut bin = Self {
            ids: pass.ids.clone(),
            fronts: BandLists::new(&kept.fronts[..kept.counts[0]], bands),
            backs: BandLists::new(&kept.backs[..kept.counts[1]], bands),
            pieces: Vec::new(),
            piece_bands: Bin::new(bands, TALL_BANDS),
        };
        for &id in &kept.outside {
            let Some(faces) = pass.faces_of(plan, id as usize) else { continue };
            bin.push_clipped(context, &bounds, id, faces);
        }
        bin
    }

    fn push_clipped(&mut self, context: &RasterContext<'_>, bounds: &Bounds, id: u32, faces: Faces) {
        let plan = context.plan;
        if !plan.projection.clip || context.is_hull(id) {
            return;
        }
        let corners = context.positions_of(id).map(|(position, _)| homogeneous(&plan.projection, position));
        clip_triangle(&plan.projection, corners, |piece| {
            if passes_culling(faces, area(&piece))
                && let Some(bands) = bounds.bands_of(&piece)
            {
                self.push_piece(id, piece, bands);
            }
        });
    }

    fn push_piece(&mut self, id: u32, piece: [ScreenVertex; 3], bands: [usize; 2]) {
        self.piece_bands.push(self.pieces.len() as u32, bands);
        self.pieces.push((id, piece));
    }

    /// Ids of the clipped triangles, once for each piece.
    pub fn clipped_ids(&self) -> impl Iterator<Item = u32> {
        self.pieces.iter().map(|(id, _)| *id)
    }

    /// The band's triangles that need no clipping.
    pub fn whole_in(&self, band: usize) -> impl Iterator<Item = u32> {
        [&self.fronts, &self.backs].into_iter().flat_map(move |lists| {
            let (listed, tall) = lists.items_in(band);
            listed.iter().copied().chain(tall)
        })
    }

    /// The band's clipped pieces with their ids.
    pub fn pieces_in(&self, band: usize) -> impl Iterator<Item = (u32, &[ScreenVertex; 3])> {
        self.piece_bands.items_in(band).map(|i| &self.pieces[i as usize]).map(|(id, piece)| (*id, piece))
    }
}

impl TrianglePass {
    /// Drawn faces of a triangle; None if the pass does not draw it.
    #[inline(always)]
    fn faces_of(&self, plan: &DrawPlan<'_>, id: usize) -> Option<Faces> {
        if self.pass_bit == 0 {
            return Some(self.faces);
        }
        match plan.pass_masks.get(id) {
            None => Some(self.faces),
            Some(mask) if mask & self.pass_bit == 0 => None,
            Some(mask) if mask & pass_mask::FRONT_ONLY != 0 => Some(Faces::Front),
            Some(mask) if mask & pass_mask::BACK_ONLY != 0 => Some(Faces::Back),
            _ => Some(self.faces),
        }
    }
}

/// The rectangle of the picture that has samples, and its bands.
pub struct Bounds {
    grid: SampleGrid,
    /// The picture's centre, 1/256 px from its corner.
    half: [i32; 2],
    /// Columns, and rows, that have samples.
    ranges: [[i32; 2]; 2],
    /// Rows of a band, and rows beyond it that it sees.
    rows: i32,
    margin: i32,
    row_last: i32,
}

impl Bounds {
    /// First and last band that a triangle on screen touches, or comes as close to as `margin`
    /// rows; None if it touches no column or row of samples.
    #[inline(always)]
    fn bands_of(&self, v: &[ScreenVertex; 3]) -> Option<[usize; 2]> {
        let axis = |k: usize, v: [i32; 3]| {
            let (low, high) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
            self.grid.pixels([low + self.half[k], high + self.half[k]], self.ranges[k])
        };
        let [left, right] = axis(0, v.map(|v| v.x));
        let [top, bottom] = axis(1, v.map(|v| v.y));
        let (top, bottom) = ((top - self.margin).max(0), (bottom + self.margin).min(self.row_last));
        (left <= right && top <= bottom).then(|| [top, bottom].map(|row| (row / self.rows) as usize))
    }
}

/// Triangles of a chunk that culling leaves.
pub struct Kept {
    /// Triangles that face the viewer, and that face away; the first `counts` of them count.
    fronts: Vec<Spanned>,
    backs: Vec<Spanned>,
    counts: [usize; 2],
    /// Triangles with a corner behind the eye or far outside the picture.
    outside: Vec<u32>,
}

impl Kept {
    fn with_room_for(triangles: usize) -> Self {
        let room = || vec![Spanned::default(); triangles + LANES];
        Self { fronts: room(), backs: room(), counts: [0; 2], outside: Vec::new() }
    }
}

dispatch! {
    /// Culls the triangles of a pass.
    pub fn keep(context: &RasterContext<'_>, bounds: &Bounds, pass: &TrianglePass, kept: &mut Kept) = keep_kernel
}

#[inline(always)]
fn keep_kernel(context: &RasterContext<'_>, bounds: &Bounds, pass: &TrianglePass, kept: &mut Kept) {
    let plan = context.plan;
    let has_masks = pass.pass_bit != 0 && !plan.pass_masks.is_empty();
    // f32 divides exactly enough: rows are below 2^13.
    let per_row = 1.0 / bounds.rows as f32;
    for first in pass.ids.clone().step_by(LANES) {
        let lanes = TriangleLanes::load(context, first, pass.ids.end);
        let [drawn_front, drawn_back] = match has_masks {
            true => lanes.drawn(|id| pass.faces_of(plan, id)),
            false => lanes.drawn(|_| Some(pass.faces)),
        };
        let seen = lanes.seen(bounds);
        for l in 0..LANES {
            let area = lanes.area[l];
            let bands = [0, 1].map(|k| ((seen.rows[k][l] as f32 + 0.5) * per_row) as u16);
            let spanned = Spanned { id: (first + l) as u32, bands };
            // Written in any case, kept by the count.
            kept.fronts[kept.counts[0]] = spanned;
            kept.backs[kept.counts[1]] = spanned;
            kept.counts[0] += usize::from(drawn_front[l] & seen.any[l] & (area < 0));
            kept.counts[1] += usize::from(drawn_back[l] & seen.any[l] & (area > 0));
        }
        if lanes.is_outside != [false; LANES] {
            let outside = (0..LANES).filter(|&l| lanes.is_outside[l] && (drawn_front[l] || drawn_back[l]));
            kept.outside.extend(outside.map(|l| (first + l) as u32));
        }
    }
}

/// Eight triangles on screen.
struct TriangleLanes {
    first: usize,
    /// Lanes that hold a triangle.
    len: usize,
    x: [[i32; LANES]; 3],
    y: [[i32; LANES]; 3],
    area: [i64; LANES],
    is_outside: [bool; LANES],
}

/// Lanes of triangles that samples may show, and their first and last row.
struct Seen {
    any: [bool; LANES],
    rows: [[i32; LANES]; 2],
}

impl TriangleLanes {
    #[inline(always)]
    fn load(context: &RasterContext<'_>, first: usize, end: usize) -> Self {
        let len = (end - first).min(LANES);
        let mut ids = [first as u32; LANES];
        for l in 0..len {
            ids[l] += l as u32;
        }
        let Corners { x, y, .. } = corners(context, &ids);
        let (mut area, mut is_outside) = ([0; LANES], [false; LANES]);
        for l in 0..LANES {
            // Only what lies outside wraps, and its area is not looked at.
            let d = |a: i32, b: i32| i64::from(a.wrapping_sub(b));
            area[l] = d(x[1][l], x[0][l]) * d(y[2][l], y[0][l]) - d(x[2][l], x[0][l]) * d(y[1][l], y[0][l]);
            is_outside[l] = (x[0][l] == OUTSIDE) | (x[1][l] == OUTSIDE) | (x[2][l] == OUTSIDE);
        }
        Self { first, len, x, y, area, is_outside }
    }

    /// Lanes whose fronts, and whose backs, are drawn.
    #[inline(always)]
    fn drawn(&self, faces_of: impl Fn(usize) -> Option<Faces>) -> [[bool; LANES]; 2] {
        let mut drawn = [[false; LANES]; 2];
        for l in 0..self.len {
            let faces = faces_of(self.first + l);
            drawn[0][l] = matches!(faces, Some(Faces::Both | Faces::Front));
            drawn[1][l] = matches!(faces, Some(Faces::Both | Faces::Back));
        }
        drawn
    }

    #[inline(always)]
    fn seen(&self, bounds: &Bounds) -> Seen {
        let mut seen = Seen { any: [false; LANES], rows: [[0; LANES]; 2] };
        for l in 0..LANES {
            let axis = |k: usize, v: &[[i32; LANES]; 3]| {
                let (low, high) = (v[0][l].min(v[1][l]).min(v[2][l]), v[0][l].max(v[1][l]).max(v[2][l]));
                let half = bounds.half[k];
                bounds.grid.pixels([low.wrapping_add(half), high.wrapping_add(half)], bounds.ranges[k])
            };
            let ([left, right], [top, bottom]) = (axis(0, &self.x), axis(1, &self.y));
            let (top, bottom) = ((top - bounds.margin).max(0), (bottom + bounds.margin).min(bounds.row_last));
            seen.any[l] = (left <= right) & (top <= bottom) & !self.is_outside[l];
            seen.rows[0][l] = top;
            seen.rows[1][l] = bottom;
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPANS: [[u16; 2]; 5] = [[0, 0], [2, 4], [0, 19], [3, 3], [5, 15]];

    fn items_of(band: u16) -> Vec<u32> {
        let want = (100..).zip(SPANS).filter(|(_, [first, last])| (*first..=*last).contains(&band));
        want.map(|(id, _)| id).collect()
    }

    #[test]
    fn each_band_lists_the_items_that_touch_it() {
        let spanned: Vec<Spanned> = (100..).zip(SPANS).map(|(id, bands)| Spanned { id, bands }).collect();
        let lists = BandLists::new(&spanned, 20);
        for band in 0..20 {
            let (listed, tall) = lists.items_in(band as usize);
            let mut found = [listed, &tall].concat();
            assert!(found.is_empty() || !lists.is_empty_in(band as usize), "band {band}");
            found.sort_unstable();
            assert_eq!(found, items_of(band), "band {band}");
        }
        // Items that touch few bands are not visited in the others.
        assert_eq!(lists.tall.len(), 2);
        assert_eq!(BandLists::default().items_in(3), (&[][..], Vec::new()));
    }

    #[test]
    fn each_band_lists_the_pieces_that_touch_it() {
        let mut bin = TriangleBin { piece_bands: Bin::new(20, TALL_BANDS), ..TriangleBin::default() };
        for (id, span) in (100..).zip(SPANS) {
            bin.push_piece(id, [ScreenVertex::default(); 3], span.map(usize::from));
        }
        for band in 0..20 {
            let mut found: Vec<u32> = bin.pieces_in(band as usize).map(|(id, _)| id).collect();
            found.sort_unstable();
            assert_eq!(found, items_of(band), "band {band}");
        }
    }
}
