//! The comparison of two faces by what decides their colours: the step from one to the other is none, slight or
//! hard (stage mixed). Where faces with a step meet, pixels are drawn a second time, from more points. Steps of
//! recent pairs are remembered, because neighbouring pixels show the same pairs of faces.

use super::coarse::CoarseLooks;
use super::look::{Look, Step, step_of_linked};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::NOTHING;

/// Pairs that are remembered.
const STEPS: usize = 1024;

/// Looks that are remembered.
const LOOKS: usize = 512;

/// Pairs of faces that were compared last, and the looks that were made last: neighbouring pixels show the same ones.
pub struct Pairs<'a> {
    steps: [Pair; STEPS],
    /// Id and look of a face.
    looks: [(u32, Look); LOOKS],
    /// Looks in bytes, of the faces that samples showed last.
    pub coarse: &'a mut CoarseLooks,
}

#[derive(Clone, Copy)]
struct Pair {
    ids: [u32; 2],
    step: Step,
}

impl<'a> Pairs<'a> {
    /// None but of nothing and nothing.
    pub fn new(coarse: &'a mut CoarseLooks) -> Self {
        coarse.reset();
        Self {
            steps: [Pair { ids: [NOTHING; 2], step: Step::None }; STEPS],
            looks: [(NOTHING, Look::NOTHING); LOOKS],
            coarse,
        }
    }

    /// The step of colours from one of two ids to the other.
    #[inline(always)]
    pub fn step(&mut self, context: &RasterContext<'_>, a: u32, b: u32) -> Step {
        if a == b {
            return Step::None;
        }
        let ids = [a.min(b), a.max(b)];
        let place = ids[0].wrapping_mul(5).wrapping_add(ids[1]) as usize % STEPS;
        if self.steps[place].ids != ids {
            if self.coarse.are_alike(ids) {
                return Step::None;
            }
            self.steps[place] = Pair { ids, step: self.new_step(context, ids) };
        }
        self.steps[place].step
    }

    #[inline(never)]
    fn new_step(&mut self, context: &RasterContext<'_>, [a, b]: [u32; 2]) -> Step {
        let (of_a, of_b) = (self.look(context, a), self.look(context, b));
        match of_a.step_to(&of_b) {
            Step::None => Step::None,
            // Links cannot lower this step: the normals were compared.
            step if of_a.is_of_one_normal() && of_b.is_of_one_normal() => step,
            step => step.min(step_of_linked(context, a, b)),
        }
    }

    /// Remembers the look of an id, unless shortcuts are not taken.
    #[inline(always)]
    pub fn remember(&mut self, context: &RasterContext<'_>, id: u32) {
        if id != NOTHING && !context.is_plain() && !self.coarse.has(id) {
            let look = self.look(context, id);
            self.coarse.put(id, &look);
        }
    }

    #[inline(always)]
    fn look(&mut self, context: &RasterContext<'_>, id: u32) -> Look {
        let (of, look) = &mut self.looks[id as usize % LOOKS];
        if *of != id {
            (*of, *look) = (id, Look::of(context, id));
        }
        *look
    }
}
