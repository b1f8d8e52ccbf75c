//! Union-find (disjoint sets): finds what is connected.
//!
//! Paths are halved at each search, so n steps take at most O(n log n), whatever their order
//! (Tarjan and van Leeuwen, Worst-case analysis of set union algorithms, 1984).

/// A partition of the numbers `0..count` into disjoint sets.
#[derive(Debug)]
pub struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// Each number in a set of its own.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The representative of the set of `v`: its lowest number.
    pub fn find(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            let up = self.parent[self.parent[v as usize] as usize];
            self.parent[v as usize] = up;
            v = up;
        }
        v
    }

    /// Unites the sets of `a` and `b`. Returns whether they were different.
    pub fn unite(&mut self, a: u32, b: u32) -> bool {
        if self.parent[a as usize] == self.parent[b as usize] {
            return false;
        }
        let (a, b) = (self.find(a), self.find(b));
        // No ranks are kept: taking the lower number keeps trees shallow for meshes in any usual
        // order.
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// A partition with parity: each member of a set is on one of two sides, known relative to the
/// other members.
///
/// Members are faces, and the side says whether a face has to be turned over to agree with the
/// representative.
#[derive(Debug)]
pub struct ParityUnionFind {
    /// Twice the parent's number, plus 1 if the parent is on the other side.
    parent: Vec<u32>,
}

impl ParityUnionFind {
    /// Each number in a set of its own. `count` is below 2^31.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).map(|v| v << 1).collect() }
    }

    /// The representative of the set of `v`, and whether `v` is on the other side than it.
    pub fn find(&mut self, mut v: u32) -> (u32, bool) {
        let mut is_other = 0;
        loop {
            let up = self.parent[v as usize];
            if up >> 1 == v {
                return (v, is_other == 1);
            }
            let top = self.parent[(up >> 1) as usize] ^ (up & 1);
            self.parent[v as usize] = top;
            is_other ^= top & 1;
            v = top >> 1;
        }
    }

    /// Unites the sets of `a` and `b`, which are on opposite sides or not. If the sets are one
    /// already, nothing changes.
    pub fn unite(&mut self, a: u32, b: u32, are_opposite: bool) {
        let ((a, a_side), (b, b_side)) = (self.find(a), self.find(b));
        if a != b {
            self.parent[a.max(b) as usize] = a.min(b) << 1 | u32::from(a_side ^ b_side ^ are_opposite);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_in_either_order_is_one_set() {
        let n = 100_000;
        for is_reversed in [false, true] {
            let (mut sets, mut sided) = (UnionFind::new(n as usize), ParityUnionFind::new(n as usize));
            for i in 0..n - 1 {
                let v = if is_reversed { n - 2 - i } else { i };
                assert!(sets.unite(v, v + 1));
                sided.unite(v, v + 1, true);
            }
            assert!(!sets.unite(0, n - 1));
            assert!((0..n).all(|v| sets.find(v) == 0 && sided.find(v) == (0, v % 2 == 1)));
        }
    }

    #[test]
    fn sides_survive_any_order_of_unions() {
        let mut state = 1_u32;
        let mut random = |n: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % n
        };
        // The sides are fixed beforehand; unions state pairs only.
        let side: Vec<bool> = (0..1000).map(|_| random(2) == 1).collect();
        let mut sets = ParityUnionFind::new(1000);
        for _ in 0..5000 {
            let (a, b) = (random(1000), random(1000));
            sets.unite(a, b, side[a as usize] != side[b as usize]);
        }
        for v in 0..1000 {
            let (root, is_other) = sets.find(v);
            assert_eq!(is_other, side[v as usize] != side[root as usize]);
        }
    }
}
