//! Finds equal positions by their bits.

use std::hash::{BuildHasher, RandomState};

/// A set of positions that numbers them in the order in which they were first seen. The hash is
/// keyed at random, so that no file can be made to collide; the numbers do not depend on it.
#[derive(Debug)]
pub struct PositionSet {
    /// The distinct positions.
    pub positions: Vec<[f32; 3]>,
    /// Indices into `positions`, or [`FREE`]. Open addressing; a power of two, at most half full.
    slots: Vec<u32>,
    keys: [u64; 2],
}

const FREE: u32 = u32::MAX;

impl PositionSet {
    /// An empty set with room for about `expected` positions.
    pub fn with_capacity(expected: usize) -> Self {
        let random = RandomState::new();
        Self {
            positions: Vec::with_capacity(expected),
            slots: vec![FREE; (expected * 2).next_power_of_two().max(16)],
            keys: [random.hash_one(0_u64), random.hash_one(1_u64)],
        }
    }

    /// The number of `p`. It must not have a negative zero, whose bits differ.
    pub fn number(&mut self, p: [f32; 3]) -> u32 {
        let bits = p.map(f32::to_bits);
        let mut at = self.start(bits);
        loop {
            match self.slots[at] {
                FREE => break,
                known if self.positions[known as usize].map(f32::to_bits) == bits => return known,
                _ => at = (at + 1) & (self.slots.len() - 1),
            }
        }
        let number = self.positions.len() as u32;
        self.slots[at] = number;
        self.positions.push(p);
        if self.positions.len() * 2 > self.slots.len() {
            self.grow();
        }
        number
    }

    /// The first slot for some bits, from both halves of a 128-bit product, as in wyhash.
    fn start(&self, [x, y, z]: [u32; 3]) -> usize {
        let a = (u64::from(x) | u64::from(y) << 32) ^ self.keys[0];
        let b = u64::from(z) ^ self.keys[1];
        let product = u128::from(a) * u128::from(b);
        (product as u64 ^ (product >> 64) as u64) as usize & (self.slots.len() - 1)
    }

    fn grow(&mut self) {
        let mask = self.slots.len() * 2 - 1;
        self.slots.clear();
        self.slots.resize(mask + 1, FREE);
        for (number, p) in (0_u32..).zip(&self.positions) {
            let mut at = self.start(p.map(f32::to_bits));
            while self.slots[at] != FREE {
                at = (at + 1) & mask;
            }
            self.slots[at] = number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_order_of_first_use_however_often_it_grows() {
        let mut set = PositionSet::with_capacity(0);
        let point = |i: u32| [i as f32, (i % 7) as f32 * 0.5, -(i as f32)];
        for i in (0..100_000).chain(0..100_000) {
            assert_eq!(set.number(point(i)), i);
        }
        assert_eq!(set.positions.len(), 100_000);
    }
}
