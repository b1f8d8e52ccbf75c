//! The triangles that touch each band or its margin, before the stage visibility. A band is a range of
//! pixel rows that one thread draws at a time. A [`TriangleBin`] has those of one chunk of the
//! triangles, so that several threads can sort them.
//!
//! There are separate lists of triangles that face the viewer, of those that face away, and of the
//! pieces that are left of triangles after clipping. The stage visibility draws those that face away
//! last, because most of them are hidden by then. If samples are adaptive, thin triangles, which
//! samples may miss, are also in a list of their own: the stage mixed looks for them.

use std::ops::Range;

use super::bin::Bin;
use super::keep::{Bounds, Sides, TrianglePass, keep};
use super::lists::{BandLists, TALL_BANDS};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::clip::clip_triangle;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous};
use crate::backend::cpu::geometry::visibility::{area, passes_culling};
use crate::plan::Faces;

/// A chunk's triangles by band.
#[derive(Default)]
pub struct TriangleBin {
    /// The chunk's ids.
    pub ids: Range<usize>,
    /// Triangles that face the viewer and need no clipping; with boxes if the picture has mixed pixels.
    pub fronts: BandLists,
    /// Those that face away, with boxes.
    pub backs: BandLists,
    /// Those of both that are thin, with boxes, if the picture has mixed pixels.
    pub thin: BandLists,
    /// The sides that the chunk's triangles show.
    pub sides: Vec<Sides>,
    /// Id and pieces of clipped triangles.
    pieces: Vec<(u32, [ScreenVertex; 3])>,
    /// Indices into `pieces`.
    piece_bands: Bin,
}

impl TriangleBin {
    /// Sorts a pass's triangles into bands of `rows`, and into those to which they are as close as
    /// `margin` rows.
    pub fn new(context: &RasterContext<'_>, [rows, margin]: [u32; 2], pass: &TrianglePass) -> Self {
        let plan = context.plan;
        let bands = plan.height_px.div_ceil(rows) as usize;
        let bounds = Bounds::new(plan, [rows, margin], pass);
        let kept = keep(context, &bounds, pass);
        let mut bin = Self {
            ids: pass.ids.clone(),
            fronts: BandLists::new(kept.fronts, bands),
            backs: BandLists::new(kept.backs, bands),
            thin: BandLists::new(kept.thin, bands),
            sides: kept.sides,
            pieces: Vec::new(),
            piece_bands: Bin::new(bands, TALL_BANDS),
        };
        for &id in &kept.outside {
            let Some(faces) = pass.faces_of(plan, id as usize) else { continue };
            bin.push_clipped(context, &bounds, id, faces);
        }
        // Only their lists by band are read.
        bin.thin.all = Vec::new();
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

    /// True if the band has no triangle.
    pub fn is_empty_in(&self, band: usize) -> bool {
        self.fronts.is_empty_in(band) && self.backs.is_empty_in(band) && self.pieces_in(band).next().is_none()
    }

    /// The band's triangles that need no clipping.
    pub fn whole_in(&self, band: usize) -> impl Iterator<Item = u32> {
        [&self.fronts, &self.backs].into_iter().flat_map(move |lists| {
            let (listed, tall) = lists.items_in(band);
            listed.iter().copied().chain(tall)
        })
    }

    /// Number of clipped pieces, in all bands.
    pub fn piece_count(&self) -> u32 {
        self.pieces.len() as u32
    }

    /// Numbers of the band's clipped pieces.
    pub fn piece_numbers_in(&self, band: usize) -> impl Iterator<Item = u32> {
        self.piece_bands.items_in(band)
    }

    /// The id and the corners of clipped piece number `i`.
    pub fn piece(&self, i: u32) -> (u32, &[ScreenVertex; 3]) {
        let (id, piece) = &self.pieces[i as usize];
        (*id, piece)
    }

    /// The band's clipped pieces with their ids.
    pub fn pieces_in(&self, band: usize) -> impl Iterator<Item = (u32, &[ScreenVertex; 3])> {
        self.piece_numbers_in(band).map(|i| self.piece(i))
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
