//! Stage mixed, per band: the triangles that its pixels are offered, in the order in which they are.

use std::ops::ControlFlow;

use crate::backend::cpu::RasterContext;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::geometry::transform::ScreenVertex;

/// The triangles of a band.
pub struct BandTriangles<'a> {
    context: &'a RasterContext<'a>,
    bins: &'a [TriangleBin],
    band: usize,
    /// By bin: the number of clipped pieces in those before it.
    pieces_before: Vec<u32>,
}

/// Highest bit of a [`ScreenTriangle::item`]: the others are the number of a piece. Ids are smaller.
const PIECE: u32 = 1 << 31;

/// A triangle, or a piece of one, on screen.
#[derive(Clone, Copy)]
pub struct ScreenTriangle {
    /// The triangle.
    pub id: u32,
    /// Its number among those of the picture, for [`BandTriangles::get`].
    pub item: u32,
    /// Its corners.
    pub corners: [ScreenVertex; 3],
}

/// The kinds of a bin's triangles, in the order in which they are offered: what faces away is mostly hidden by then.
#[derive(Clone, Copy)]
enum Kind {
    Pieces,
    Fronts,
    Backs,
    Thin,
}

impl<'a> BandTriangles<'a> {
    /// The triangles of band number `band`.
    pub fn new(context: &'a RasterContext<'a>, (bins, band): (&'a [TriangleBin], usize)) -> Self {
        let mut count = 0;
        let count_before = |bin: &TriangleBin| {
            count += bin.piece_count();
            count - bin.piece_count()
        };
        Self { context, bins, band, pieces_before: bins.iter().map(count_before).collect() }
    }

    /// Calls `each` for each triangle until it breaks off.
    #[inline(always)]
    pub fn for_each(&self, each: impl FnMut(ScreenTriangle) -> ControlFlow<()>) -> ControlFlow<()> {
        self.for_each_of(&[Kind::Pieces, Kind::Fronts, Kind::Backs], each)
    }

    /// The same of those that are thin. None of them is clipped.
    #[inline(always)]
    pub fn for_each_thin(&self, each: impl FnMut(ScreenTriangle) -> ControlFlow<()>) -> ControlFlow<()> {
        self.for_each_of(&[Kind::Thin], each)
    }

    #[inline(always)]
    fn for_each_of(&self, kinds: &[Kind], mut each: impl FnMut(ScreenTriangle) -> ControlFlow<()>) -> ControlFlow<()> {
        for kind in kinds {
            for (bin, before) in self.bins.iter().zip(&self.pieces_before) {
                // One place that calls `each`, so that it is inlined.
                let (listed, others) = match kind {
                    Kind::Pieces => {
                        (&[][..], bin.piece_numbers_in(self.band).map(|piece| PIECE | (before + piece)).collect())
                    }
                    Kind::Fronts => bin.fronts.items_in(self.band),
                    Kind::Backs => bin.backs.items_in(self.band),
                    Kind::Thin => bin.thin.items_in(self.band),
                };
                for ids in [listed, &others] {
                    for &item in ids {
                        each(self.get(item))?;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// The triangle of an [`item`](ScreenTriangle::item).
    #[inline(always)]
    pub fn get(&self, item: u32) -> ScreenTriangle {
        if item & PIECE == 0 {
            return ScreenTriangle { id: item, item, corners: self.context.screen_triangle(item) };
        }
        self.get_piece(item)
    }

    #[inline(never)]
    fn get_piece(&self, item: u32) -> ScreenTriangle {
        let number = item ^ PIECE;
        let bin = self.pieces_before.partition_point(|before| *before <= number).saturating_sub(1);
        let (id, corners) = self.bins[bin].piece(number - self.pieces_before[bin]);
        ScreenTriangle { id, item, corners: *corners }
    }
}
