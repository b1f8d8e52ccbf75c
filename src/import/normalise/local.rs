//! Numbers the corners of a piece of a mesh, in the order of their first use.

use super::geometry::Key;
use super::hasher::Hasher;

/// Most corners of a piece: numbers, and the mark of a free slot, fit 16 bits.
pub const CORNERS_MAX: usize = 65_535;
/// A free slot.
const FREE: u16 = u16::MAX;

/// The distinct corners of one piece after the other.
pub struct Local<K> {
    /// A hash table, or one by the index after `base`.
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

    /// Begins a piece of at most [`CORNERS_MAX`] corners with the given keys. Indices that lie
    /// close together need no hash.
    pub fn begin(&mut self, corners: usize, keys: impl Iterator<Item = K>) {
        debug_assert!(corners <= CORNERS_MAX);
        let slots = (corners * 2).next_power_of_two();
        self.keys.clear();
        self.slots.clear();
        self.slots.resize(slots, FREE);
        let range = keys.map_while(K::index).fold((u32::MAX, 0), |(low, high), at| (at.min(low), at.max(high)));
        self.base = (range.0 <= range.1 && ((range.1 - range.0) as usize) < slots).then_some(range.0);
    }

    /// The number of a corner.
    #[inline(always)]
    pub fn number(&mut self, key: K) -> u32 {
        let mask = self.slots.len() - 1;
        let begin = match (key.index(), self.base) {
            (Some(index), Some(base)) => index.wrapping_sub(base) as usize,
            _ => self.hasher.hash(key.words()) as usize,
        };
        let mut at = begin & mask;
        loop {
            let known = self.slots[at];
            if known == FREE {
                self.slots[at] = self.keys.len() as u16;
                self.keys.push(key);
                return self.keys.len() as u32 - 1;
            }
            if self.keys[usize::from(known)] == key {
                return u32::from(known);
            }
            at = (at + 1) & mask;
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
        local.begin(keys.len(), keys.iter().copied());
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
