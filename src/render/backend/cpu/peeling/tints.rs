//! The tints that lines take from the transparent layers in front of them: what each layer adds to
//! a pixel, and its depth there (stage peeling). From the fourth layer on, all count as one. Twin of
//! `shaders/peeling/tints.wgsl`.
//!
//! The depth of a layer is known at samples, which may lie beside the line. So a layer counts as in
//! front of a line only if it would still be nearer after a step of the length
//! [`tint_reach`](crate::plan::LinePass::tint_reach) down its slope, away from the viewer.
//! Otherwise a line would count as behind the very faces whose edge it is.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::steepness::{NEARER_RATIO, steepness_of};
use crate::plan::{ALPHA_MIN, DrawPlan, TINTS};

/// The steepness of a triangle that is seen from the edge: it is in front of nothing.
pub const EDGE_ON: f32 = 1e30;

/// The layers of a band's pixels: means over each pixel's samples.
#[derive(Default)]
pub struct Tints {
    rounds: [Round; TINTS],
    /// The rounds so far that are told apart.
    count: usize,
    /// False where layers tint no line.
    is_kept: bool,
    /// The triangle that was added last, and its steepness.
    last: Option<(u32, f32)>,
}

/// One layer of each pixel of the band.
#[derive(Default)]
struct Round {
    seen: Vec<Seen>,
    /// The colour that it adds to each pixel, premultiplied linear RGBA.
    colors: Vec<[f32; 4]>,
}

/// The place of a pixel's layer.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// The farthest of its depths; 0 where there is none.
    depth: f32,
    /// The greatest of its changes of depth per 1/256 px.
    steepness: f32,
}

impl Tints {
    /// Bytes per pixel.
    pub const PIXEL_BYTES: usize = TINTS * (size_of::<Seen>() + size_of::<[f32; 4]>());

    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        let of =
            |round: &Round| round.seen.capacity() * size_of::<Seen>() + round.colors.capacity() * size_of::<[f32; 4]>();
        self.rounds.iter().map(of).sum()
    }

    /// Forgets all layers, before those of another band.
    pub fn begin(&mut self, plan: &DrawPlan<'_>) {
        (self.count, self.last, self.is_kept) = (0, None, plan.tints_lines());
    }

    /// Makes room for the next layer of so many pixels.
    pub fn begin_round(&mut self, pixels: usize) {
        if !self.is_kept {
            return;
        }
        if let Some(round) = self.rounds.get_mut(self.count) {
            round.seen.clear();
            round.seen.resize(pixels, Seen::default());
            // Written before they are read.
            round.colors.resize(pixels, [0.0; 4]);
            self.count += 1;
        }
    }

    /// False where layers tint no line.
    #[inline(always)]
    pub fn are_kept(&self) -> bool {
        self.is_kept
    }

    /// Adds a triangle of the current layer to a pixel: the colour that it adds to the pixel's, and its depth at one of its
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
            _ => steepness_of(context, id).unwrap_or(EDGE_ON),
        };
        self.last = Some((id, steepness));
        let seen = &mut round.seen[pixel];
        if seen.depth == 0.0 {
            (*seen, round.colors[pixel]) = (Seen { depth, steepness }, color);
        } else {
            *seen = Seen { depth: seen.depth.min(depth), steepness: seen.steepness.max(steepness) };
            for k in 0..4 {
                round.colors[pixel][k] += color[k];
            }
        }
    }

    /// The colour (premultiplied) of a line in a pixel at this depth, with what lies in front of it; `reach` is its
    /// [`tint_reach`](crate::plan::LinePass::tint_reach). Its alpha is what it hides: the layers in front of it are in the
    /// picture already.
    #[inline(always)]
    pub fn tinted(&self, pixel: usize, (depth, reach): (f32, f32), color: [f32; 4]) -> [f32; 4] {
        let least = depth * NEARER_RATIO;
        let mut front = [0.0; 4];
        for round in &self.rounds[..self.count] {
            let seen = round.seen[pixel];
            if seen.depth - seen.steepness * reach > least {
                for k in 0..4 {
                    front[k] += round.colors[pixel][k];
                }
            }
        }
        let rest = 1.0 - front[3];
        [0, 1, 2, 3].map(|k| if k == 3 { color[3] } else { rest * color[k] + color[3] * front[k] })
    }
}
