//! Stage mixed, per band: the triangles that its pixels are offered, in the order in which they are.

use std::borrow::Cow;
use std::ops::ControlFlow;

use crate::backend::cpu::RasterContext;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::geometry::transform::ScreenVertex;

/// The triangles of a band.
pub struct BandTriangles<'a> {
    context: &'a RasterContext<'a>,
    /// Ids and corners of clipped pieces.
    pieces: Vec<(u32, &'a [ScreenVertex; 3])>,
    /// All items: pieces, then what faces the viewer, then the rest, which is mostly hidden by then.
    items: Vec<Cow<'a, [u32]>>,
}

/// Highest bit of a [`ScreenTriangle::item`]: the others are the index of a piece. Ids are smaller.
const PIECE: u32 = 1 << 31;

/// A triangle, or a piece of one, on screen.
#[derive(Clone, Copy)]
pub struct ScreenTriangle {
    /// The triangle.
    pub id: u32,
    /// Its number among those of the band, for [`BandTriangles::get`].
    pub item: u32,
    /// Its corners.
    pub corners: [ScreenVertex; 3],
}

impl<'a> BandTriangles<'a> {
    /// The triangles of band number `band`.
    pub fn new(context: &'a RasterContext<'a>, (bins, band): (&'a [TriangleBin], usize)) -> Self {
        let pieces: Vec<_> = bins.iter().flat_map(|bin| bin.pieces_in(band)).collect();
        let mut items = vec![Cow::Owned((0..pieces.len() as u32).map(|i| PIECE | i).collect())];
        for is_front in [true, false] {
            for bin in bins {
                let (listed, others) = if is_front { &bin.fronts } else { &bin.backs }.items_in(band);
                items.extend([Cow::Borrowed(listed), Cow::Owned(others)]);
            }
        }
        Self { context, pieces, items }
    }

    /// Calls `each` for each triangle until it breaks off.
    #[inline(always)]
    pub fn for_each(&self, mut each: impl FnMut(ScreenTriangle) -> ControlFlow<()>) -> ControlFlow<()> {
        for items in &self.items {
            for &item in items.iter() {
                each(self.get(item))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// The triangle of an [`item`](ScreenTriangle::item).
    #[inline(always)]
    pub fn get(&self, item: u32) -> ScreenTriangle {
        match self.pieces.get((item ^ PIECE) as usize) {
            Some((id, corners)) => ScreenTriangle { id: *id, item, corners: **corners },
            None => ScreenTriangle { id: item, item, corners: self.context.screen_triangle(item) },
        }
    }
}
