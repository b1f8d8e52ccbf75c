//! The triangles of a band (a range of pixel rows) in the order in which mixed pixels test them:
//! clipped pieces, then triangles that face the viewer, then those that face away, which are mostly
//! hidden by then (stage mixed). Mixed pixels are drawn a second time, from 64 or 256 points each.

use std::borrow::Cow;
use std::ops::ControlFlow;

use super::points::POINT_GRID;
use crate::backend::cpu::bands::lists::{BandLists, BoxedFace, pair};
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::transform::ScreenVertex;

/// The triangles of a band.
pub struct BandTriangles<'a> {
    context: &'a RasterContext<'a>,
    bins: &'a [TriangleBin],
    band: usize,
    /// By bin: the number of clipped pieces in those before it.
    pieces_before: Vec<u32>,
}

/// An item names a triangle of a band: it is the triangle's id or, with this bit, the number of a clipped piece.
const PIECE: u32 = 1 << 31;

/// A triangle, or a piece of one, on screen.
#[derive(Clone, Copy)]
pub struct ScreenTriangle {
    /// The triangle.
    pub id: u32,
    /// Its corners.
    pub corners: [ScreenVertex; 3],
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
    pub fn for_each(&self, mut each: impl FnMut(ScreenTriangle) -> ControlFlow<()>) -> ControlFlow<()> {
        self.boxed().try_for_each(|list| list.iter().try_for_each(|face| each(self.get(face.id))))
    }

    /// Its triangles, each with the pixels that may have points in it, and with its item in place of its id. Clipped
    /// pieces come first, then what faces the viewer: what faces away is mostly hidden by then.
    pub fn boxed(&self) -> impl Iterator<Item = Cow<'a, [BoxedFace]>> {
        let pieces = self.bins.iter().zip(&self.pieces_before).map(|(bin, before)| {
            let boxed = |i: u32| self.with_box(PIECE | (before + i), bin.piece(i).1);
            Cow::Owned(bin.piece_numbers_in(self.band).map(boxed).collect())
        });
        pieces.chain(self.boxed_of(|bin| &bin.fronts)).chain(self.boxed_of(|bin| &bin.backs))
    }

    /// Those that are thin. None of them is clipped.
    pub fn thin(&self) -> impl Iterator<Item = Cow<'a, [BoxedFace]>> {
        self.boxed_of(|bin| &bin.thin)
    }

    fn boxed_of(&self, list_of: fn(&'a TriangleBin) -> &'a BandLists) -> impl Iterator<Item = Cow<'a, [BoxedFace]>> {
        self.bins.iter().flat_map(move |bin| {
            let (listed, others) = list_of(bin).boxed_in(self.band);
            if self.context.is_plain() {
                // Boxes that culling has no part in.
                let boxed = |face: &BoxedFace| self.with_box(face.id, &self.get(face.id).corners);
                return [listed, &others].map(|faces| Cow::Owned(faces.iter().map(boxed).collect()));
            }
            [Cow::Borrowed(listed), Cow::Owned(others)]
        })
    }

    fn with_box(&self, item: u32, corners: &[ScreenVertex; 3]) -> BoxedFace {
        let plan = self.context.plan;
        let pixels = |of: fn(&ScreenVertex) -> i32, size: u32| {
            let [a, b, c] = corners.each_ref().map(|v| of(v) + 128 * size as i32);
            pair(POINT_GRID.pixels([a.min(b).min(c), a.max(b).max(c)], [0, size as i32]))
        };
        let [a, b, c] = corners.each_ref().map(|v| v.z);
        BoxedFace {
            id: item,
            columns: pixels(|v| v.x, plan.width_px),
            rows: pixels(|v| v.y, plan.height_px),
            depth_max: a.max(b).max(c),
        }
    }

    /// The triangle of an item.
    #[inline(always)]
    pub fn get(&self, item: u32) -> ScreenTriangle {
        if item & PIECE == 0 {
            return ScreenTriangle { id: item, corners: self.context.screen_triangle(item) };
        }
        self.get_piece(item)
    }

    #[inline(never)]
    fn get_piece(&self, item: u32) -> ScreenTriangle {
        let number = item ^ PIECE;
        let bin = self.pieces_before.partition_point(|before| *before <= number).saturating_sub(1);
        let (id, corners) = self.bins[bin].piece(number - self.pieces_before[bin]);
        ScreenTriangle { id, corners: *corners }
    }
}
