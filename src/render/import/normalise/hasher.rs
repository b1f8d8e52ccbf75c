//! The hash of three 32-bit words, for tables that find equal positions or equal indices. Its key
//! is random, so that no file can be made whose values all collide.

use std::hash::{BuildHasher, RandomState};

/// Keyed at random, so that no file can be made to collide; no result depends on it.
pub struct Hasher([u64; 2]);

impl Hasher {
    /// A hasher with a new key.
    pub fn new() -> Self {
        let random = RandomState::new();
        Self([random.hash_one(0_u64), random.hash_one(1_u64)])
    }

    /// The hash, from both halves of a 128-bit product as in wyhash.
    #[inline(always)]
    pub fn hash(&self, [x, y, z]: [u32; 3]) -> u64 {
        let a = (u64::from(x) | u64::from(y) << 32) ^ self.0[0];
        let b = u64::from(z) ^ self.0[1];
        let product = u128::from(a) * u128::from(b);
        product as u64 ^ (product >> 64) as u64
    }

    /// The share of a hash, from bits that tables do not use.
    #[inline(always)]
    pub fn share(&self, hash: u64, shares: usize) -> usize {
        (hash >> 48) as usize & (shares - 1)
    }
}
