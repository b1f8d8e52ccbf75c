//! Huffman codes of limited length: RFC 1951, 3.2.2.

/// Bits of the longest code that Deflate has for literals and lengths.
const BITS_MAX: usize = 15;

/// A code's length in the lowest six bits, and above them the code as it is written, lowest bit
/// first. Lengths of a few codes add up where they are, and processors shift by the lowest six bits.
pub type Code = u32;

/// The length of a code, bits; or that of some codes whose sum this is.
#[inline(always)]
pub fn length(code: Code) -> u32 {
    code & 63
}

/// The bits of a code.
#[inline(always)]
pub fn bits(code: Code) -> u64 {
    u64::from(code >> 6)
}

/// The lengths of a complete code for symbols that occur so often, none longer than `max` bits. A
/// symbol that never occurs has none.
pub fn lengths(counts: &[u32], max: usize) -> Vec<u8> {
    let mut symbols: Vec<usize> = (0..counts.len()).filter(|&symbol| counts[symbol] > 0).collect();
    symbols.sort_unstable_by_key(|&symbol| (counts[symbol], symbol));
    let mut lengths = vec![0; counts.len()];
    let per_length = match symbols.len() {
        0 => return lengths,
        1 => vec![0, 1],
        _ => limited(depths(symbols.iter().map(|&symbol| u64::from(counts[symbol])).collect()), max),
    };
    // The most frequent symbols have the shortest codes.
    let mut next = symbols.iter().rev();
    for (length, count) in per_length.into_iter().enumerate() {
        for &symbol in next.by_ref().take(count) {
            lengths[symbol] = length as u8;
        }
    }
    lengths
}

/// The depths of the leaves of Huffman's tree, for at least two weights in ascending order. Sums are
/// made in ascending order too, so that two queues take the place of a heap.
fn depths(mut weights: Vec<u64>) -> Vec<usize> {
    let leaves = weights.len();
    let mut parents = vec![0; 2 * leaves - 1];
    let (mut leaf, mut node) = (0, leaves);
    for parent in leaves..2 * leaves - 1 {
        let mut sum = 0;
        for _ in 0..2 {
            let is_leaf = leaf < leaves && (node == parent || weights[leaf] <= weights[node]);
            let next = if is_leaf { &mut leaf } else { &mut node };
            sum += weights[*next];
            parents[*next] = parent;
            *next += 1;
        }
        weights.push(sum);
    }
    let mut depths = vec![0; 2 * leaves - 1];
    for at in (0..2 * leaves - 2).rev() {
        depths[at] = depths[parents[at]] + 1;
    }
    depths.truncate(leaves);
    depths
}

/// How many codes have each length, when none may be longer than `max`. The tree stays complete: a
/// leaf above the limit becomes a node, and takes a leaf of the limit beside it.
fn limited(depths: Vec<usize>, max: usize) -> Vec<usize> {
    let mut per_length = vec![0; max + 1];
    depths.into_iter().for_each(|depth| per_length[depth.min(max)] += 1);
    let mut sum: usize = per_length.iter().zip((0..=max).rev()).map(|(count, up)| count << up).sum();
    while sum > 1 << max {
        let Some(length) = (1..max).rev().find(|&length| per_length[length] > 0) else { break };
        per_length[length] -= 1;
        per_length[length + 1] += 2;
        per_length[max] -= 1;
        sum -= 1;
    }
    per_length
}

/// The canonical codes of these lengths.
pub fn codes(lengths: &[u8]) -> impl Iterator<Item = Code> {
    let mut count = [0; BITS_MAX + 1];
    lengths.iter().filter(|&&length| length > 0).for_each(|&length| count[usize::from(length)] += 1);
    let mut next = [0; BITS_MAX + 1];
    for length in 1..=BITS_MAX {
        next[length] = (next[length - 1] + count[length - 1]) << 1;
    }
    lengths.iter().map(move |&length| {
        if length == 0 {
            return 0;
        }
        let code: u32 = next[usize::from(length)];
        next[usize::from(length)] += 1;
        (code.reverse_bits() >> (32 - u32::from(length))) << 6 | u32::from(length)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts that grow as Fibonacci's numbers make the deepest trees.
    fn fibonacci(count: usize) -> Vec<u32> {
        let mut counts = vec![1, 1];
        while counts.len() < count {
            counts.push(counts[counts.len() - 1] + counts[counts.len() - 2]);
        }
        counts
    }

    #[test]
    fn codes_are_complete_and_no_longer_than_the_limit() {
        let lists = [
            vec![3, 1],
            vec![0, 5, 0, 1, 1],
            vec![1; 286],
            fibonacci(30),
            fibonacci(20),
            (0..286).map(|i| 1 + i * i * i).collect(),
        ];
        for counts in &lists {
            for max in [9, 14, 15] {
                let lengths = lengths(counts, max);
                let used = || lengths.iter().filter(|&&length| length > 0);
                assert!(counts.iter().zip(&lengths).all(|(count, length)| (*count > 0) == (*length > 0)));
                assert!(used().all(|&length| usize::from(length) <= max), "{lengths:?}");
                assert_eq!(used().map(|&length| 1_u32 << (15 - length)).sum::<u32>(), 1 << 15, "{lengths:?}");
                // No code begins with another one.
                let codes: Vec<Code> = codes(&lengths).filter(|&code| code != 0).collect();
                for (i, a) in codes.iter().enumerate() {
                    for b in &codes[i + 1..] {
                        let shared = (1 << length(*a).min(length(*b))) - 1;
                        assert_ne!(bits(*a) & shared, bits(*b) & shared);
                    }
                }
            }
        }
        assert_eq!(lengths(&[0, 7], 7), [0, 1], "a single symbol takes a bit");
        assert_eq!(lengths(&[5, 1, 1, 2], 7), [1, 3, 3, 2]);
    }
}
