//! The loop that stages are compared with. It stays as it is: stored ratios refer to it.

/// Words of memory that the loop goes through: more than a first-level cache has.
const WORDS: usize = 1 << 17;

/// Keeps the loop's memory, so that a call allocates nothing.
pub struct Reference {
    words: Vec<u32>,
    sums: Vec<f32>,
}

impl Reference {
    pub fn new() -> Self {
        Self { words: (0..WORDS as u32).map(|i| i.wrapping_mul(0x9E37_79B9)).collect(), sums: vec![0.0; WORDS] }
    }

    /// Integer arithmetic, float arithmetic and scattered writes in about equal parts, a few
    /// milliseconds long.
    pub fn run(&mut self) -> f32 {
        let mut state = 1_u32;
        for round in 0..4 {
            for (word, sum) in self.words.iter_mut().zip(&mut self.sums) {
                *word = word.wrapping_mul(747_796_405).wrapping_add(round);
                *sum = *sum * 0.5 + (*word >> 8) as f32 * (1.0 / 16_777_216.0);
            }
            for _ in 0..WORDS / 4 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let at = (state >> 15) as usize;
                self.sums[at] = (self.sums[at] + 1.0).sqrt();
            }
        }
        std::hint::black_box(self.sums[state as usize >> 15])
    }
}
