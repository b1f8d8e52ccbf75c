//! The state of depth peeling, which finds transparent layers from front to back: what each sample keeps from one
//! layer to the next, such as the colour so far (stage peeling). Twin of `shaders/peeling/state.wgsl`.

use super::tints::Tints;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::plan::ALPHA_MIN;

/// Depth peeling of a band: buffers for the rows that are shown, without the margin rows.
pub struct PeelBand {
    /// The layer of this round; starts as a copy of the surface that hides all layers behind it.
    pub found: SampleBand,
    /// The layer of the previous round; depth 0 where a sample is finished.
    pub previous: SampleBand,
    /// Premultiplied linear RGBA so far, laid out as the samples.
    pub colors: Vec<[f32; 4]>,
    /// Materials of the layers so far, one bit each, modulo 32.
    pub materials: Vec<u32>,
    /// Per triangle of the band, in the order of its bins: true if a later round may find it.
    pub pending: Vec<bool>,
    /// The layers of each pixel, where they tint lines.
    pub tints: Tints,
}

impl PeelBand {
    /// Bytes per sample: two depths and ids, a colour, and materials.
    pub const SAMPLE_BYTES: usize = 8 + 8 + 16 + 4;

    /// Buffers for bands like `base` that show `rows` rows.
    pub fn new(base: &SampleBand, rows: u32) -> Self {
        let like = || SampleBand::new(base.size_px, 0, rows, base.samples);
        let (found, previous) = (like(), like());
        let (colors, materials) = (vec![[0.0; 4]; found.depth.len()], vec![0; found.depth.len()]);
        Self { found, previous, colors, materials, pending: Vec::new(), tints: Tints::default() }
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.colors.len() * Self::SAMPLE_BYTES + self.pending.capacity() + self.tints.bytes()
    }

    /// Alpha of the layers so far at a sample of pixel (x, y), 0 to 1.
    #[inline(always)]
    pub fn alpha(&self, x: u32, y: u32, s: u32) -> f32 {
        self.colors[self.found.index(x as i32, y as i32, s)][3]
    }

    /// True if layers that count are seen at some sample of pixel (x, y).
    pub fn has_layer(&self, x: u32, y: u32) -> bool {
        self.colors_of(x, y).iter().any(|color| color[3] > ALPHA_MIN)
    }

    /// True if layers have not changed any sample of pixel (x, y).
    #[inline(always)]
    pub fn is_clear(&self, x: u32, y: u32) -> bool {
        self.colors_of(x, y).iter().all(|color| *color == [0.0; 4])
    }

    #[inline(always)]
    fn colors_of(&self, x: u32, y: u32) -> &[[f32; 4]] {
        let first = self.found.index(x as i32, y as i32, 0);
        &self.colors[first..first + self.found.samples as usize]
    }

    /// Clears the state and moves it to the shown rows of `base`.
    pub fn reset(&mut self, base: &SampleBand) {
        for samples in [&mut self.found, &mut self.previous] {
            (samples.first_row, samples.rows, samples.shown) =
                (base.shown[0] as i32, base.shown[1] - base.shown[0], base.shown);
        }
        self.previous.depth.fill(f32::INFINITY);
        self.previous.ids.fill(0);
        self.colors.fill([0.0; 4]);
        self.materials.fill(0);
        self.pending.clear();
    }

    /// Starts a round. Its layer must be in front of `base`, if there is one.
    pub fn begin_round(&mut self, base: Option<&SampleBand>) {
        match base {
            Some(base) => {
                let stride = self.found.stride;
                let depths = self.found.depth.chunks_exact_mut(stride);
                for ((y, depths), ids) in (0..).zip(depths).zip(self.found.ids.chunks_exact_mut(stride)) {
                    // The last band of a picture may have fewer rows than there is room for.
                    if y < self.found.rows as i32 {
                        let from = base.index(0, self.found.first_row + y, 0);
                        depths.copy_from_slice(&base.depth[from..from + stride]);
                        ids.copy_from_slice(&base.ids[from..from + stride]);
                    }
                }
            }
            None => self.found.clear(),
        }
    }

    /// True if nothing was found for `count` samples from `first` on (from index `in_base` on in the base). They are
    /// finished then.
    #[inline(always)]
    pub fn are_finished(&mut self, base: Option<&SampleBand>, first: usize, in_base: usize, count: usize) -> bool {
        let (depths, ids) = (&self.found.depth[first..first + count], &self.found.ids[first..first + count]);
        let mut difference = 0;
        match base {
            Some(base) => {
                let all = in_base..in_base + count;
                for (depth, base) in depths.iter().zip(&base.depth[all.clone()]) {
                    difference |= depth.to_bits() ^ base.to_bits();
                }
                for (id, base) in ids.iter().zip(&base.ids[all]) {
                    difference |= id ^ base;
                }
            }
            None => {
                for (depth, id) in depths.iter().zip(ids) {
                    difference |= depth.to_bits() | (id ^ NOTHING);
                }
            }
        }
        if difference == 0 {
            self.previous.depth[first..first + count].fill(0.0);
        }
        difference == 0
    }

    /// Moves the layer found at sample `at` (index `in_base` in the base) to `previous`. Returns
    /// its id, or None if the sample is finished.
    #[inline(always)]
    pub fn take_layer(&mut self, base: Option<&SampleBand>, at: usize, in_base: usize) -> Option<u32> {
        let (depth, id) = (self.found.depth[at], self.found.ids[at]);
        // Not in a closure, which would be compiled for the baseline.
        let (base_depth, base_id) = match base {
            Some(base) => (base.depth[in_base], base.ids[in_base]),
            None => (0.0, NOTHING),
        };
        if depth == base_depth && id == base_id {
            self.previous.depth[at] = 0.0;
            return None;
        }
        (self.previous.depth[at], self.previous.ids[at]) = (depth, id);
        Some(id)
    }

    /// Composites a colour under the colours so far of some samples of the pixel at `first`. Returns the number of these
    /// samples, less what the colours so far hide of them.
    #[inline(always)]
    pub fn accumulate<const S: usize>(&mut self, first: usize, same: [bool; S], color: [f32; 4]) -> f32 {
        let mut seen = 0.0;
        for s in (0..S).filter(|&s| same[s]) {
            let so_far = &mut self.colors[first + s];
            let rest = 1.0 - so_far[3];
            seen += rest;
            for k in 0..4 {
                so_far[k] += rest * color[k];
            }
            if so_far[3] >= 1.0 {
                self.previous.depth[first + s] = 0.0;
            }
        }
        seen
    }
}
