//! Union-find: which things are connected. Paths are halved, so that any order of any number of steps takes n log n.

/// A partition of the numbers below a count.
#[derive(Debug)]
pub struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// Each number by itself.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The number that stands for the set of `v`: its lowest.
    pub fn find(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            let up = self.parent[self.parent[v as usize] as usize];
            self.parent[v as usize] = up;
            v = up;
        }
        v
    }

    /// Makes one set of two. Whether they were two.
    pub fn unite(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        // The lower number wins, which keeps trees shallow for meshes in any sensible order.
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// A partition whose members are on one of two sides each, known relative to each other: faces that are turned alike or not.
#[derive(Debug)]
pub struct SidedSets {
    /// The parent, times two, and one if it is on the other side.
    parent: Vec<u32>,
}

impl SidedSets {
    /// Each number by itself. Counts are below 2^31.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).map(|v| v << 1).collect() }
    }

    /// The number that stands for the set of `v`, and whether `v` is on its other side.
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

    /// Makes one set of two; where they already are one, what is known of their sides stays.
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
            let (mut sets, mut sided) = (Sets::new(n as usize), SidedSets::new(n as usize));
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
        // Each number's side is given beforehand; unions tell pairs only.
        let side: Vec<bool> = (0..1000).map(|_| random(2) == 1).collect();
        let mut sets = SidedSets::new(1000);
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
