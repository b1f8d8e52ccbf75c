//! Random numbers for tests, the same in every run.

/// A generator by its state, which is not 0 (Marsaglia 2003, xorshift).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// A number below `n`.
    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % n
    }
}
