//! Stage visibility, many triangles at a time: set-up in lanes, and a short way for small ones.
//!
//! Larger triangles are drawn in the blocks of `visibility`.

use super::nearest::{Nearest, update};
use super::samples::SampleBand;
use super::setups::{Boxes, Corners, Setups, class, lane_offsets};
use super::tiles::Tiles;
use super::visibility;
use super::visibility::{Parts, Setup};
use crate::backend::cpu::bands::lists::BoxedFace;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::{Isa, LANES};

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

    /// Draws what was added. Returns the number of samples tested of triangles that are drawn in
    /// blocks.
    #[inline(always)]
    pub fn draw<const S: usize>(&mut self, context: &RasterContext<'_>, band: &mut SampleBand) -> u64 {
        let len = std::mem::take(&mut self.len).min(ROOM);
        // Lanes without a triangle repeat the last one, which needs no clipping either.
        let last = self.ids[len.saturating_sub(1)];
        self.ids[len..len.next_multiple_of(LANES)].fill(last);
        let (groups, _) = self.ids.as_chunks::<LANES>();
        for (ids, setups) in groups.iter().zip(&mut self.setups).take(len.div_ceil(LANES)) {
            set_up::<S>(context, ids, band, setups);
        }
        let (order, ends) = self.by_class(len);
        for &i in &order[..ends[class::SHORT as usize]] {
            let (group, l) = (usize::from(i) / LANES, usize::from(i) % LANES);
            draw_lane::<S, LANES>(context.isa, &self.setups[group].parts, l, self.ids[usize::from(i)], band);
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
#[allow(unsafe_code)]
pub fn boxes<const S: usize>(context: &RasterContext<'_>, ids: &[u32; LANES], band: &SampleBand) -> Boxes {
    #[cfg(target_arch = "x86_64")]
    if context.isa.has_avx2() {
        // SAFETY: the processor has AVX2, as `isa` says.
        return unsafe { super::batch_avx2::boxes::<S>(context, ids, band) };
    }
    Boxes::new::<S>(&Corners::load(context, ids), band)
}

#[inline(always)]
#[allow(unsafe_code)]
fn set_up<const S: usize>(context: &RasterContext<'_>, ids: &[u32; LANES], band: &SampleBand, setups: &mut Setups) {
    #[cfg(target_arch = "x86_64")]
    if context.isa.has_avx2() {
        // SAFETY: the processor has AVX2, as `isa` says.
        return unsafe { super::batch_avx2::set_up::<S>(context, ids, band, setups) };
    }
    *setups = Setups::new::<S>(&Corners::load(context, ids), band);
}

/// Draws a triangle block by block. Returns the number of samples tested.
#[inline(always)]
fn draw_long<const S: usize>(context: &RasterContext<'_>, setup: &Setup, id: u32, band: &mut SampleBand) -> u64 {
    if !context.isa.has_own_batch() || setup.depth_range[0] <= 0.0 {
        return visibility::draw::<S>(setup, id, &mut Nearest(band));
    }
    let mut parts = 0;
    let (size_px, range) = (band.size_px, band.range());
    visibility::for_each_part::<S>(setup, size_px, range, |part| {
        draw_lane::<S, 1>(context.isa, part, 0, id, band);
        parts += 1;
    });
    parts * (64 * S as u64)
}

/// Draws part `l` of a triangle whose depths are above 0.
#[inline(always)]
#[allow(unsafe_code)]
fn draw_lane<const S: usize, const N: usize>(isa: Isa, parts: &Parts<N>, l: usize, id: u32, band: &mut SampleBand) {
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx512() {
        // SAFETY: the processor has AVX-512, as `isa` says.
        return unsafe { super::batch_avx512::draw_lane::<S, N>(parts, l, id, band) };
    }
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx2() {
        // SAFETY: the processor has AVX2, as `isa` says.
        return unsafe { super::batch_avx2::draw_lane::<S, N>(parts, l, id, band) };
    }
    let _ = isa;
    draw_part::<S, N>(parts, l, id, band);
}

#[inline(always)]
fn draw_part<const S: usize, const N: usize>(parts: &Parts<N>, l: usize, id: u32, band: &mut SampleBand) {
    let [[left, right], [top, bottom]] = parts.bounds_of(l);
    let [dx, dy, edges] = [&parts.dx, &parts.dy, &parts.edges].map(|v| [v[0][l], v[1][l], v[2][l]]);
    let from = [parts.from[0][l], parts.from[1][l]];
    let depth = [parts.depth[0][l], parts.depth[1][l], parts.depth[2][l]];
    let depth_range = [parts.depth_range[0][l], parts.depth_range[1][l]];
    let pixels = (LANES / S).max(1);
    for part in 0..S.div_ceil(LANES) {
        let [offset_x, offset_y] = lane_offsets::<S>(part);
        let (mut steps, mut x) = ([[0; LANES]; 3], [0; LANES]);
        for i in 0..LANES {
            for k in 0..3 {
                steps[k][i] = edges[k] + (dx[k] * offset_y[i] - dy[k] * offset_x[i]);
            }
            x[i] = from[0] + 16 * offset_x[i];
        }
        for row in 0..=bottom - top {
            let mut depth_y = [0.0; LANES];
            for i in 0..LANES {
                depth_y[i] = depth[2] * (from[1] + 256 * row + 16 * offset_y[i]) as f32;
            }
            let mut at = band.index(left, top + row, 0) + LANES * part;
            for column in (0..=right - left).step_by(pixels) {
                let (mut outside, mut z) = ([0; LANES], [0.0; LANES]);
                for k in 0..3 {
                    let base = 16 * (dx[k] * row - dy[k] * column);
                    for i in 0..LANES {
                        outside[i] |= base + steps[k][i];
                    }
                }
                for i in 0..LANES {
                    let across = depth[0] + depth[1] * (x[i] + 256 * column) as f32;
                    z[i] = visibility::clamp(across + depth_y[i], depth_range);
                }
                if let Some((depths, ids)) = band.lanes_mut(at) {
                    update(&outside, &z, id, depths, ids);
                }
                at += pixels * S;
            }
        }
    }
}
