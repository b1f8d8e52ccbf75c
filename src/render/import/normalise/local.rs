//! Local numbers of corners. Normalisation works on a mesh in pieces of consecutive triangles with
//! at most 65,535 corners. Within a piece each distinct corner gets a number, in the order of first
//! use. These numbers fit 16 bits, so that the table by which they are found is small.

use super::geometry::Key;
use super::hasher::Hasher;

/// Most corners of a piece: numbers, and the mark of a free slot, fit 16 bits.
pub const CORNERS_MAX: usize = 65_535;
/// A free slot.
const FREE: u16 = u16::MAX;
/// Most slots by index, for indices that lie close together.
const SLOTS_MAX: usize = 1 << 17;
/// Slots of a hash table at first.
const SLOTS_MIN: usize = 1 << 16;

/// The distinct corners of one piece after the other.
pub struct Local<K> {
    /// One for each index from `base` on, or a hash table.
    slots: Vec<u16>,
    keys: Vec<K>,
    base: Option<u32>,
    hasher: Hasher,
}

impl<K: Key> Local<K> {
    /// Memory for pieces.
    pub fn new() -> Self {
        Self { slots: Vec::new(), keys: Vec::new(), base: None, hasher: Hasher::new() }
    }

    /// Begins a piece of some triangles, of at most [`CORNERS_MAX`] corners. Indices that lie close
    /// together need no hash.
    pub fn begin(&mut self, triangles: impl Iterator<Item = [K; 3]>) {
        self.keys.clear();
        self.slots.clear();
        self.base = None;
        let mut slots = SLOTS_MIN;
        if K::IS_INDEX {
            let (mut low, mut high) = (u32::MAX, 0);
            for [a, b, c] in triangles.map(|keys| keys.map(K::index)) {
                low = low.min(a).min(b).min(c);
                high = high.max(a).max(b).max(c);
            }
            let range = high.saturating_sub(low) as usize + 1;
            if range <= SLOTS_MAX {
                (self.base, slots) = (Some(low), range);
            }
        }
        self.slots.resize(slots, FREE);
    }

    /// The number of a corner.
    #[inline(always)]
    pub fn number(&mut self, key: K) -> u32 {
        if let Some(base) = self.base {
            let slot = &mut self.slots[key.index().wrapping_sub(base) as usize];
            if *slot == FREE {
                *slot = self.keys.len() as u16;
                self.keys.push(key);
            }
            return u32::from(*slot);
        }
        let mask = self.slots.len() - 1;
        let mut at = self.hasher.hash(key.words()) as usize & mask;
        loop {
            let known = self.slots[at];
            if known == FREE {
                return self.add(key, at);
            }
            if self.keys[usize::from(known)] == key {
                return u32::from(known);
            }
            at = (at + 1) & mask;
        }
    }

    /// Adds a new corner to the hash table, at a free slot.
    fn add(&mut self, key: K, at: usize) -> u32 {
        let number = self.keys.len();
        self.slots[at] = number as u16;
        self.keys.push(key);
        if self.keys.len() * 4 > self.slots.len() {
            self.grow();
        }
        number as u32
    }

    /// Doubles the hash table.
    #[cold]
    fn grow(&mut self) {
        let slots = self.slots.len() * 2;
        self.slots.clear();
        self.slots.resize(slots, FREE);
        for (key, number) in self.keys.iter().zip(0..) {
            let mut at = self.hasher.hash(key.words()) as usize & (slots - 1);
            while self.slots[at] != FREE {
                at = (at + 1) & (slots - 1);
            }
            self.slots[at] = number;
        }
    }

    /// The distinct corners of the piece, by their number.
    pub fn finish(&self) -> Vec<K> {
        self.keys.to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<K: Key + std::hash::Hash>(local: &mut Local<K>, keys: &[K], is_by_index: bool) {
        let mut known = std::collections::HashMap::new();
        local.begin(keys.iter().map(|key| [*key; 3]));
        assert_eq!(local.base.is_some(), is_by_index);
        for key in keys {
            let next = known.len() as u32;
            assert_eq!(local.number(*key), *known.entry(*key).or_insert(next));
        }
        let distinct = local.finish();
        assert_eq!(distinct.len(), known.len());
        assert!((0..).zip(&distinct).all(|(number, key)| known[key] == number));
    }

    #[test]
    fn indices_and_positions_are_numbered_alike() {
        let (mut by_index, mut by_position) = (Local::new(), Local::new());
        let lists: [(Vec<u32>, bool); 6] = [
            ((7..20_000).chain(7..20_000).collect(), true),
            ((0..CORNERS_MAX as u32).map(|i| i.wrapping_mul(7919) % 4001 + (1 << 31)).collect(), true),
            ((0..CORNERS_MAX as u32).map(|i| u32::MAX - i).collect(), true),
            ((0..CORNERS_MAX as u32).map(|i| i * 1000).collect(), false),
            ((0..9000_u32).map(|i| i / 6 * 2_654_435).collect(), false),
            (vec![u32::MAX, 0, u32::MAX], false),
        ];
        for (list, is_close) in &lists {
            check(&mut by_index, list, *is_close);
            let positions: Vec<[u32; 3]> = list.iter().map(|i| [*i, i % 3, !i]).collect();
            check(&mut by_position, &positions, false);
        }
    }
}
