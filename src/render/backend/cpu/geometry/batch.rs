//! The drawing of triangles in batches (stage visibility, which finds the nearest triangle of each sample). Eight
//! triangles at a time are made ready in vector instructions. Then small ones are drawn, sorted by size, so that the
//! processor predicts the lengths of loops.
//!
//! Larger triangles are drawn in the blocks of 8 x 8 pixels that `visibility` finds.

use fearless_simd::prelude::*;

use super::nearest::Nearest;
use super::samples::{HANGOVER, SampleBand};
use super::setups::{Boxes, Setups, class};
use super::tiles::Tiles;
use super::visibility;
use super::visibility::{Parts, Setup};
use crate::backend::cpu::bands::lists::BoxedFace;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::{Isa, LANES, with_simd, with_widest_simd};
use crate::plan::sample_offsets;

/// Triangles in a batch. Triangles of equal size are drawn one after the other, so that the
/// processor predicts the lengths of the loops over their rows and columns.
const BATCH: usize = 128;

/// Room for a batch, and for the triangles that are added at once.
const ROOM: usize = BATCH + LANES;

/// Collects triangles that need no clipping, and draws them.
pub struct Batch {
    ids: [u32; ROOM],
    len: usize,
    setups: [Setups; ROOM / LANES],
}

impl Batch {
    /// An empty batch.
    pub fn new() -> Self {
        Self { ids: [0; ROOM], len: 0, setups: [Setups::EMPTY; ROOM / LANES] }
    }

    /// True if the batch is full. It has to be drawn before more is added.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.len >= BATCH
    }

    /// Number of triangles in the batch.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Adds as many triangles as there is room for. Returns the others.
    #[inline(always)]
    pub fn fill<'i>(&mut self, ids: &'i [u32]) -> &'i [u32] {
        let len = self.len.min(BATCH);
        let (taken, rest) = ids.split_at(ids.len().min(BATCH - len));
        self.ids[len..len + taken.len()].copy_from_slice(taken);
        self.len = len + taken.len();
        rest
    }

    /// Adds those of up to [`LANES`] triangles that `tiles` do not hide. There is room for them
    /// unless the batch is full.
    #[inline(always)]
    pub fn push_seen(&mut self, isa: Isa, band: &SampleBand, tiles: &Tiles, faces: &[BoxedFace]) {
        let mut seen = tiles.seen(isa, faces, band.range()[1]);
        while seen != 0 {
            let l = seen.trailing_zeros() as usize;
            if let (Some(place), Some(face)) = (self.ids.get_mut(self.len), faces.get(l)) {
                *place = face.id;
                self.len += 1;
            }
            seen &= seen - 1;
        }
    }

    /// Draws what was added, and empties the batch. Returns the number of samples that were tested, which counts large
    /// triangles alone: those that are drawn block by block.
    #[inline(always)]
    pub fn draw<const S: usize>(&mut self, context: &RasterContext<'_>, band: &mut SampleBand) -> u64 {
        let len = std::mem::take(&mut self.len).min(ROOM);
        // Lanes without a triangle repeat the last one, which needs no clipping either.
        let last = self.ids[len.saturating_sub(1)];
        self.ids[len..len.next_multiple_of(LANES)].fill(last);
        let (groups, _) = self.ids.as_chunks::<LANES>();
        for (ids, setups) in groups.iter().zip(&mut self.setups).take(len.div_ceil(LANES)) {
            with_simd!(context.isa, simd => setups.set::<_, S>(simd, context, ids, band));
        }
        let (order, ends) = self.by_class(len);
        for &i in &order[..ends[class::SHORT as usize]] {
            let (group, l) = (usize::from(i) / LANES, usize::from(i) % LANES);
            let (isa, part, id) = (context.isa, &self.setups[group].parts, self.ids[usize::from(i)]);
            with_widest_simd!(isa, simd => draw_lane::<_, S, LANES>(simd, part, l, id, band));
        }
        let mut tested = 0;
        for &i in &order[ends[class::SHORT as usize]..ends[class::LONG as usize]] {
            let id = self.ids[usize::from(i)];
            if let Some(setup) = Setup::new(&context.screen_triangle(id)) {
                tested += draw_long::<S>(context, &setup, id, band);
            }
        }
        tested
    }

    /// Indices of triangles, sorted by class, and the end of each class among them.
    #[inline(always)]
    fn by_class(&self, len: usize) -> ([u8; ROOM], [usize; class::COUNT]) {
        let class_of = |i: usize| self.setups[i / LANES].classes[i % LANES] as usize % class::COUNT;
        let (mut order, mut ends) = ([0; ROOM], [0; class::COUNT]);
        for i in 0..len {
            ends[class_of(i)] += 1;
        }
        let mut sum = 0;
        for end in &mut ends {
            // The start, which the next loop moves to the end.
            sum += std::mem::replace(end, sum);
        }
        for i in 0..len {
            let end = &mut ends[class_of(i)];
            order[*end % ROOM] = i as u8;
            *end += 1;
        }
        (order, ends)
    }
}

/// Pixels and nearest depth of eight triangles.
#[inline(always)]
pub fn boxes<const S: usize>(context: &RasterContext<'_>, ids: &[u32; LANES], band: &SampleBand) -> Boxes {
    with_simd!(context.isa, simd => Boxes::new::<_, S>(simd, context, ids, band))
}

/// Draws a triangle block by block. Returns the number of samples tested.
#[inline(always)]
fn draw_long<const S: usize>(context: &RasterContext<'_>, setup: &Setup, id: u32, band: &mut SampleBand) -> u64 {
    if setup.depth_range[0] <= 0.0 {
        return visibility::draw::<S>(setup, id, &mut Nearest(band));
    }
    let mut parts = 0;
    let (size_px, range) = (band.size_px, band.range());
    visibility::for_each_part::<S>(setup, size_px, range, |part| {
        with_widest_simd!(context.isa, simd => draw_lane::<_, S, 1>(simd, part, 0, id, band));
        parts += 1;
    });
    parts * (64 * S as u64)
}

/// Draws part `l` of a triangle whose depths are above 0.
///
/// Goes down, then to the right: so less changes from a vector to the next, and all of it is in registers. Vectors may
/// reach 15 columns beyond a block of large triangles. There edge functions still fit 32 bits: 2^30, to which they are
/// clamped, and at most 2^29 + 2^28 from there.
#[inline(always)]
fn draw_lane<V: Simd, const S: usize, const N: usize>(simd: V, t: &Parts<N>, l: usize, id: u32, band: &mut SampleBand) {
    let lanes = V::i32s::LEN;
    let [[left, right], [top, bottom]] = t.bounds_of(l);
    let pixels = (lanes / S).max(1);
    let (rows, vectors) = ((bottom - top) as u32 as usize, (right - left) as u32 as usize / pixels);
    // From the first sample to the end of the last vector.
    let (first, stride) = (band.index(left, top, 0), band.stride);
    let width = (vectors + 1) * (pixels * S);
    let end = rows.saturating_mul(stride).saturating_add(width).saturating_add(first);
    let (Some(depths), Some(ids)) = (band.depth.get_mut(first..end), band.ids.get_mut(first..end)) else { return };
    let id = V::u32s::splat(simd, id);
    let range = [V::f32s::splat(simd, t.depth_range[0][l]), V::f32s::splat(simd, t.depth_range[1][l])];
    let (mut downs, mut rights) = ([V::i32s::splat(simd, 0); 3], [V::i32s::splat(simd, 0); 3]);
    for k in 0..3 {
        downs[k] = V::i32s::splat(simd, 16 * t.dx[k][l]);
        rights[k] = V::i32s::splat(simd, 16 * pixels as i32 * t.dy[k][l]);
    }
    for part in 0..S.div_ceil(lanes) {
        let [offset_x, offset_y] = offsets::<V, S>(simd, part);
        let mut edges = [offset_x; 3];
        for k in 0..3 {
            edges[k] = offset_y * t.dx[k][l] - offset_x * t.dy[k][l] + t.edges[k][l];
        }
        // Floats hold these integers, which are below 2^24.
        let mut x = V::f32s::float_from((offset_x << 4) + t.from[0][l]);
        let first_y = V::f32s::float_from((offset_y << 4) + t.from[1][l]);
        for vector in 0..=vectors {
            let across = x * t.depth[1][l] + t.depth[0][l];
            let [mut e0, mut e1, mut e2] = edges;
            let mut y = first_y;
            let mut at = vector * (pixels * S) + lanes * part;
            for _ in 0..=rows {
                let samples = at..at + lanes;
                let (Some(depths), Some(ids)) = (depths.get_mut(samples.clone()), ids.get_mut(samples)) else { return };
                let z = (across + y * t.depth[2][l]).max(range[0]).min(range[1]);
                update(simd, e0 | e1 | e2, z, id, depths, ids);
                (e0, e1, e2) = (e0 + downs[0], e1 + downs[1], e2 + downs[2]);
                y += 256.0;
                at += stride;
            }
            for k in 0..3 {
                edges[k] -= rights[k];
            }
            x += (256 * pixels) as f32;
        }
    }
}

/// As [`update`](super::nearest::update), for depths above 0.
#[inline(always)]
fn update<V: Simd>(simd: V, outside: V::i32s, z: V::f32s, id: V::u32s, depths: &mut [f32], ids: &mut [u32]) {
    // No depth is negative, so their bits have their order. -1 outside.
    let z = z.bitcast::<V::i32s>() | (outside >> 31);
    let old_depths: V::i32s = V::f32s::from_slice(simd, depths).bitcast();
    let old_ids = V::u32s::from_slice(simd, ids);
    let is_tied = z.simd_eq(old_depths) & id.simd_le(old_ids);
    z.max(old_depths).bitcast::<V::f32s>().store_slice(depths);
    (z.simd_gt(old_depths) | is_tied).select(id, old_ids).store_slice(ids);
}

/// Offset of each lane's sample from the corner of the vector's first pixel, 1/16 px: across, down.
/// The remainder modulo 16 that all samples share is in the corner already.
#[inline(always)]
fn offsets<V: Simd, const S: usize>(simd: V, part: usize) -> [V::i32s; 2] {
    let lanes = V::i32s::LEN * part..V::i32s::LEN * (part + 1);
    let [x, y] = &Offsets::<S>::ALL;
    [V::i32s::from_slice(simd, &x[lanes.clone()]), V::i32s::from_slice(simd, &y[lanes])]
}

/// Those of as many samples as the widest vectors have.
struct Offsets<const S: usize>;

impl<const S: usize> Offsets<S> {
    const ALL: [[i32; HANGOVER]; 2] = {
        let offsets = sample_offsets(S as u32);
        let mut all = [[0; HANGOVER]; 2];
        let mut i = 0;
        while i < HANGOVER {
            let [x, y] = offsets[i % S];
            (all[0][i], all[1][i]) = (16 * (i / S) as i32 + (x >> 4), y >> 4);
            i += 1;
        }
        all
    };
}
