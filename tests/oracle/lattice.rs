//! Points that fill a pixel evenly.

/// `side * side` points in the unit square: a rank-1 lattice (Korobov's) with a generator near the
/// golden section. A regular grid of as many points has only `side` distinct columns and is wrong
/// by 1 / side on a line along them; this has `side * side`.
pub fn points(side: u32) -> Vec<[f64; 2]> {
    let n = u64::from(side) * u64::from(side);
    let mut generator = ((n as f64) * 0.618_033_988_749_894_9).round() as u64;
    while gcd(generator, n) != 1 {
        generator += 1;
    }
    let at = |i: u64| (i as f64 + 0.5) / n as f64;
    (0..n).map(|i| [at(i), at(i * generator % n)]).collect()
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}
