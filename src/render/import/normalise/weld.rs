//! Welding: positions with equal bits get one number.
//!
//! The caller passes positions in pieces of at most 65,535. First, each piece is sorted into shares
//! (partitions) by the hash of each position, so that equal positions of all pieces meet in one
//! share. Then each share is searched for equal positions with a hash table of its own, which
//! usually fits a core's cache. Finally the numbers go back to the pieces. Threads work on whole
//! pieces, then on whole shares, then on whole pieces again, and need no lock.

use super::hasher::Hasher;
use crate::limits::{Deadline, Stopped};
use crate::parallel::{map, map_with};
use std::ops::Range;

/// Positions of a share, about.
const SHARE: usize = 2048;
/// Most shares.
const SHARES_MAX: usize = 4096;
/// Marks the first of equal positions.
pub const NEW: u32 = 1 << 31;
/// A free slot of a share's table.
const UNUSED: u32 = u32::MAX;

/// Bytes per position while they are welded: sorted, their order, and a number in a share and in
/// a piece.
pub const BYTES_PER_POSITION: u64 = 12 + 2 + 4 + 4;

/// The bits of a position, which is not negative zero in any coordinate: its bits differ.
pub type Bits = [u32; 3];

/// Numbers of welded positions.
#[derive(Debug, Default, PartialEq)]
pub struct Welded {
    /// For each position of each piece the number of the distinct one, with [`NEW`] where it is the
    /// first.
    pub numbers: Vec<Vec<u32>>,
    /// Number of distinct positions.
    pub count: usize,
}

/// Welds the positions of some pieces, each of at most 65,535.
pub fn weld(pieces: &[&[Bits]], deadline: &Deadline) -> Result<Welded, Stopped> {
    let hasher = Hasher::new();
    let (pieces, shares) = sort_into_shares(pieces, &hasher, deadline)?;
    compare_shares(pieces, shares, &hasher, deadline)
}

/// The positions of a piece, by their share.
struct Piece {
    /// The positions, share by share.
    sorted: Vec<Bits>,
    /// Their indices in the piece.
    order: Vec<u16>,
    /// Index of each share's first position in `sorted`, then the length of `sorted`.
    begins: Vec<u32>,
}

impl Piece {
    fn share(&self, share: usize) -> Range<usize> {
        self.begins[share] as usize..self.begins[share + 1] as usize
    }
}

fn sort_into_shares(pieces: &[&[Bits]], hasher: &Hasher, deadline: &Deadline) -> Result<(Vec<Piece>, usize), Stopped> {
    let total: usize = pieces.iter().map(|piece| piece.len()).sum();
    let shares = (total / SHARE).next_power_of_two().min(SHARES_MAX);
    let share_of = |bits: &Bits| hasher.share(hasher.hash(*bits), shares);
    let pieces = map(pieces.to_vec(), |positions| {
        deadline.check()?;
        let mut begins = vec![0_u32; shares + 1];
        positions.iter().for_each(|bits| begins[share_of(bits) + 1] += 1);
        for share in 0..shares {
            begins[share + 1] += begins[share];
        }
        let mut next = begins.clone();
        let mut order = vec![0_u16; positions.len()];
        let mut sorted = vec![[0; 3]; positions.len()];
        for (bits, index) in positions.iter().zip(0..=u16::MAX) {
            let place = &mut next[share_of(bits)];
            order[*place as usize] = index;
            sorted[*place as usize] = *bits;
            *place += 1;
        }
        Ok(Piece { sorted, order, begins })
    });
    Ok((pieces.into_iter().collect::<Result<_, _>>()?, shares))
}

/// Finds the positions of pieces that are equal.
fn compare_shares(pieces: Vec<Piece>, shares: usize, hasher: &Hasher, deadline: &Deadline) -> Result<Welded, Stopped> {
    let found = map_with((0..shares).collect(), Default::default, |memory, share| {
        deadline.check()?;
        Ok(compare_share(&pieces, share, memory, hasher))
    });
    let found = found.into_iter().collect::<Result<Vec<_>, Stopped>>()?;
    // Positions of a share are numbered after those of the shares before it.
    let mut count = 0;
    let mut begins = Vec::with_capacity(shares);
    for (_, distinct) in &found {
        begins.push(count as u32);
        count += distinct;
    }
    let mut ends = vec![0; shares];
    let mut tasks = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let read_from = ends.clone();
        (0..shares).for_each(|share| ends[share] += piece.share(share).len());
        tasks.push((piece, read_from));
    }
    let numbers = map(tasks, |(piece, read_from)| {
        let mut numbers = vec![0; piece.order.len()];
        for share in 0..shares {
            let from_share = &found[share].0[read_from[share]..];
            for (index, number) in piece.order[piece.share(share)].iter().zip(from_share) {
                // The mark is the highest bit and stays.
                numbers[usize::from(*index)] = number + begins[share];
            }
        }
        numbers
    });
    Ok(Welded { numbers, count })
}

/// For each position of a share its number among the distinct ones of the share, with [`NEW`] where
/// it is the first; and how many there are.
fn compare_share(
    pieces: &[Piece],
    share: usize,
    (slots, distinct): &mut (Vec<u32>, Vec<Bits>),
    hasher: &Hasher,
) -> (Vec<u32>, usize) {
    let total: usize = pieces.iter().map(|piece| piece.share(share).len()).sum();
    let mut numbers = Vec::with_capacity(total);
    distinct.clear();
    slots.clear();
    slots.resize((total * 2).next_power_of_two(), UNUSED);
    let mask = slots.len() - 1;
    for piece in pieces {
        for &bits in &piece.sorted[piece.share(share)] {
            let mut at = hasher.hash(bits) as usize & mask;
            loop {
                let known = slots[at];
                if known == UNUSED {
                    slots[at] = distinct.len() as u32;
                    numbers.push(slots[at] | NEW);
                    distinct.push(bits);
                    break;
                }
                if distinct[known as usize] == bits {
                    numbers.push(known);
                    break;
                }
                at = (at + 1) & mask;
            }
        }
    }
    (numbers, distinct.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The plain way: the first of each distinct position, by piece and index.
    fn expected(pieces: &[&[Bits]]) -> Vec<Vec<(usize, usize)>> {
        let mut known = std::collections::HashMap::new();
        let number = |piece: usize| {
            let known = &mut known;
            pieces[piece].iter().enumerate().map(|(at, bits)| *known.entry(*bits).or_insert((piece, at))).collect()
        };
        (0..pieces.len()).map(number).collect()
    }

    #[test]
    fn threads_and_pieces_change_nothing() {
        let point = |i: u32| [i as f32, (i % 7) as f32 * 0.5, -(i as f32)].map(f32::to_bits);
        let lists: [Vec<Bits>; 6] = [
            (0..100_000).chain(0..100_000).map(point).collect(),
            (0..150_000_u32).map(|i| point(i.wrapping_mul(2_654_435_761) >> 16)).collect(),
            (0..100_000).map(|i| point(i / 6)).collect(),
            vec![[0; 3]; 70_000],
            vec![[1; 3]],
            vec![],
        ];
        let mut compared = 0;
        for list in &lists {
            for (threads, piece) in [(1, 1000), (2, 1000), (5, 1000), (1, 65_535), (2, 65_535), (5, 65_535)] {
                let pieces: Vec<&[Bits]> = list.chunks(piece).collect();
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let welded = pool.install(|| weld(&pieces, &Deadline::default())).unwrap();
                let mut firsts = vec![None; welded.count];
                for (at_piece, (numbers, expected)) in welded.numbers.iter().zip(expected(&pieces)).enumerate() {
                    assert_eq!(numbers.len(), expected.len());
                    for (at, (number, expected)) in numbers.iter().zip(expected).enumerate() {
                        let first = &mut firsts[(number & !NEW) as usize];
                        if number & NEW != 0 {
                            assert!(first.replace((at_piece, at)).is_none());
                        }
                        assert_eq!(*first, Some(expected), "{threads} threads, pieces of {piece}");
                    }
                }
                assert!(firsts.iter().all(Option::is_some));
                compared += 1;
            }
        }
        assert_eq!(compared, 36);
        let stopped = Deadline::default();
        stopped.stop();
        assert_eq!(weld(&[&[[0; 3]]], &stopped), Err(Stopped));
    }
}
