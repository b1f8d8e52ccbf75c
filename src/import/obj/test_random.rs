//! Random numbers for this format's tests, the same in every run.

/// A generator by its state, which is not 0 (Marsaglia 2003, xorshift).
pub(in crate::import::obj) struct Random(pub(in crate::import::obj) u64);

impl Random {
    /// A number below `n`.
    pub(in crate::import::obj) fn below(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % n
    }
}
