//! Stage shade, per pixel: what layers add to it, by their depths. Lines behind them take their tint. Twin of
//! `shaders/peeling/tints.wgsl`.
//!
//! A line counts as behind a layer only where this is sure: the layer must be nearer than the line even at its farthest
//! within the line's reach. Otherwise a line would be behind the faces that it runs along.

use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::steepness::{NEARER_RATIO, steepness_of};
use crate::plan::{ALPHA_MIN, DrawPlan, TINTS};

/// The layers of a band's pixels: means over each pixel's samples.
#[derive(Default)]
pub struct Tints {
    rounds: [Round; TINTS],
    /// The rounds so far that are told apart.
    count: usize,
    /// The triangle that was added last, and its steepness.
    last: Option<(u32, Option<f32>)>,
    /// How far from a pixel a line is that covers a part of it, at most, 1/256 px. 0 where no line asks.
    reach: f32,
}

/// One of a pixel's layers, for each pixel of the band.
#[derive(Default)]
struct Round {
    /// The farthest that it may be within a line's reach; 0 where there is none.
    depth: Vec<f32>,
    /// What it adds to the pixel's colour, premultiplied linear RGBA.
    colors: Vec<[f32; 4]>,
}

impl Tints {
    /// Bytes per pixel.
    pub const PIXEL_BYTES: usize = TINTS * (size_of::<f32>() + size_of::<[f32; 4]>());

    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        let of =
            |round: &Round| round.depth.capacity() * size_of::<f32>() + round.colors.capacity() * size_of::<[f32; 4]>();
        self.rounds.iter().map(of).sum()
    }

    /// Forgets all layers, and takes on a plan.
    pub fn begin(&mut self, plan: &DrawPlan<'_>) {
        (self.count, self.last, self.reach) = (0, None, plan.tint_reach());
    }

    /// Takes on the next layer of so many pixels, if a line asks.
    pub fn begin_round(&mut self, pixels: usize) {
        if !self.are_kept() {
            return;
        }
        if let Some(round) = self.rounds.get_mut(self.count) {
            round.depth.clear();
            round.depth.resize(pixels, 0.0);
            // Written before they are read.
            round.colors.resize(pixels, [0.0; 4]);
            self.count += 1;
        }
    }

    /// True if a line asks.
    #[inline(always)]
    pub fn are_kept(&self) -> bool {
        self.reach > 0.0
    }

    /// Adds a triangle of the current layer to a pixel: what it adds to the pixel's colour, and its depth at one of its
    /// samples.
    #[inline(always)]
    pub fn add(&mut self, context: &RasterContext<'_>, pixel: usize, (id, depth): (u32, f32), color: [f32; 4]) {
        let Some(round) = self.count.checked_sub(1).and_then(|last| self.rounds.get_mut(last)) else { return };
        if color[3] <= ALPHA_MIN {
            return;
        }
        // Most neighbours show one triangle.
        let steepness = match self.last {
            Some((last, steepness)) if last == id => steepness,
            _ => steepness_of(context, id),
        };
        self.last = Some((id, steepness));
        let farthest = match steepness {
            Some(steepness) => (depth - steepness * self.reach).max(f32::MIN_POSITIVE),
            None => f32::MIN_POSITIVE,
        };
        if round.depth[pixel] == 0.0 {
            (round.depth[pixel], round.colors[pixel]) = (farthest, color);
        } else {
            round.depth[pixel] = round.depth[pixel].min(farthest);
            for k in 0..4 {
                round.colors[pixel][k] += color[k];
            }
        }
    }

    /// The colour (premultiplied) of a line in a pixel at this depth, with what lies in front of it. Its alpha is what
    /// it hides: the layers in front of it are in the picture already.
    #[inline(always)]
    pub fn tinted(&self, pixel: usize, depth: f32, color: [f32; 4]) -> [f32; 4] {
        let least = depth * NEARER_RATIO;
        let mut front = [0.0; 4];
        for round in &self.rounds[..self.count] {
            if round.depth[pixel] > least {
                for k in 0..4 {
                    front[k] += round.colors[pixel][k];
                }
            }
        }
        let rest = 1.0 - front[3];
        [0, 1, 2, 3].map(|k| if k == 3 { color[3] } else { rest * color[k] + color[3] * front[k] })
    }
}
