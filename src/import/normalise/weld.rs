//! Welds positions that have equal bits, and numbers them in the order of their first use.
//!
//! Positions are taken in pieces. A piece finds its own distinct positions; then those of all
//! pieces are compared, in shares by their hash that each fit a core's cache. Threads take pieces
//! and shares, and never wait for each other's memory.

use crate::import::parallel::map;
use crate::limits::{Deadline, Stopped};
use std::hash::{BuildHasher, RandomState};
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Positions of a piece. Its own numbers fit 16 bits.
const PIECE: usize = 32_768;
/// Distinct positions of a share, about.
const SHARE: usize = 2048;
/// Most shares.
const SHARES_MAX: usize = 4096;
/// Marks the first of equal positions.
const NEW: u32 = 1 << 31;
/// A free slot of a piece's table.
const FREE: u16 = u16::MAX;
/// A free slot of a share's table.
const UNUSED: u32 = u32::MAX;

/// Bytes per position, while and after they are welded.
pub const BYTES_PER_POSITION: u64 = 4 + 12 + 12 + 12 + 2 + 4 + 4 + 4 + 12;

type Bits = [u32; 3];

/// Welded positions.
#[derive(Debug, Default, PartialEq)]
pub struct Welded {
    /// The distinct positions, in the order of their first use.
    pub positions: Vec<[f32; 3]>,
    /// For each given position the number of the distinct one.
    pub numbers: Vec<u32>,
}

/// Welds `count` positions, which must not have a negative zero: its bits differ.
pub fn weld(count: usize, position: impl Fn(u32) -> [f32; 3] + Sync, deadline: &Deadline) -> Result<Welded, Stopped> {
    weld_in(PIECE, count, position, deadline)
}

fn weld_in(
    piece: usize,
    count: usize,
    position: impl Fn(u32) -> [f32; 3] + Sync,
    deadline: &Deadline,
) -> Result<Welded, Stopped> {
    let hasher = Hasher::new();
    let mut numbers = vec![0_u32; count];
    let places = (0_u32..).step_by(piece).zip(numbers.chunks_mut(piece)).collect();
    let distinct = map(places, |(begin, places)| {
        deadline.check()?;
        Ok(distinct(begin, places, &position, &hasher))
    });
    let mut distinct = distinct.into_iter().collect::<Result<Vec<Vec<Bits>>, _>>()?;
    if distinct.len() < 2 {
        // A piece numbers in the order of first use, too.
        let positions = distinct.pop().unwrap_or_default().into_iter().map(|bits| bits.map(f32::from_bits)).collect();
        return Ok(Welded { positions, numbers });
    }
    let (mut pieces, shares) = sort_into_shares(distinct, &hasher, deadline)?;
    let total = compare_shares(&mut pieces, shares, &hasher, deadline)?;
    let positions = number(&pieces, total, (piece, &mut numbers), deadline)?;
    Ok(Welded { positions, numbers })
}

/// The distinct positions of a piece, in the order of their first use; writes the number of each
/// position among them.
fn distinct(
    begin: u32,
    numbers: &mut [u32],
    position: &(impl Fn(u32) -> [f32; 3] + Sync),
    hasher: &Hasher,
) -> Vec<Bits> {
    let mut slots = vec![FREE; (numbers.len() * 2).next_power_of_two()];
    let mask = slots.len() - 1;
    let mut distinct: Vec<Bits> = Vec::with_capacity(numbers.len() / 4 + 16);
    for (at, place) in (begin..).zip(numbers) {
        let [x, y, z] = position(at);
        let bits = [x.to_bits(), y.to_bits(), z.to_bits()];
        let mut slot = hasher.hash(bits) as usize & mask;
        *place = loop {
            let known = slots[slot];
            if known == FREE {
                slots[slot] = distinct.len() as u16;
                distinct.push(bits);
                break distinct.len() as u32 - 1;
            }
            if distinct[usize::from(known)] == bits {
                break u32::from(known);
            }
            slot = (slot + 1) & mask;
        };
    }
    distinct
}

/// The distinct positions of a piece.
struct Piece {
    positions: Vec<Bits>,
    /// The same, share by share.
    sorted: Vec<Bits>,
    /// Their indices in `positions`.
    order: Vec<u16>,
    /// Index of each share's first position in `sorted`, then the length of `sorted`.
    begins: Vec<u32>,
    /// For each position the one among those of all pieces, with [`NEW`] where it is the first.
    merged: Vec<u32>,
}

impl Piece {
    fn share(&self, share: usize) -> Range<usize> {
        self.begins[share] as usize..self.begins[share + 1] as usize
    }
}

fn sort_into_shares(
    distinct: Vec<Vec<Bits>>,
    hasher: &Hasher,
    deadline: &Deadline,
) -> Result<(Vec<Piece>, usize), Stopped> {
    let total: usize = distinct.iter().map(Vec::len).sum();
    let shares = (total / SHARE).next_power_of_two().min(SHARES_MAX);
    let share_of = |bits: &Bits| hasher.share(hasher.hash(*bits), shares);
    let pieces = map(distinct, |positions| {
        deadline.check()?;
        let mut begins = vec![0_u32; shares + 1];
        positions.iter().for_each(|bits| begins[share_of(bits) + 1] += 1);
        for share in 0..shares {
            begins[share + 1] += begins[share];
        }
        let mut next = begins.clone();
        let mut order = vec![0_u16; positions.len()];
        let mut sorted = vec![[0; 3]; positions.len()];
        for (index, bits) in (0..).zip(&positions) {
            let place = &mut next[share_of(bits)];
            order[*place as usize] = index;
            sorted[*place as usize] = *bits;
            *place += 1;
        }
        Ok(Piece { positions, sorted, order, begins, merged: Vec::new() })
    });
    Ok((pieces.into_iter().collect::<Result<_, _>>()?, shares))
}

/// Fills in which positions of pieces are equal. Returns the number of distinct ones.
fn compare_shares(pieces: &mut [Piece], shares: usize, hasher: &Hasher, deadline: &Deadline) -> Result<usize, Stopped> {
    let found = map((0..shares).collect(), |share| {
        deadline.check()?;
        Ok(compare_share(pieces, share, hasher))
    });
    let found = found.into_iter().collect::<Result<Vec<_>, Stopped>>()?;
    // Positions of a share are numbered after those of the shares before it.
    let mut total = 0;
    let mut begins = Vec::with_capacity(shares);
    for (_, distinct) in &found {
        begins.push(total as u32);
        total += distinct;
    }
    let mut ends = vec![0; shares];
    let mut tasks = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let read_from = ends.clone();
        (0..shares).for_each(|share| ends[share] += piece.share(share).len());
        tasks.push((piece, read_from));
    }
    map(tasks, |(piece, read_from)| {
        let mut merged = vec![0; piece.positions.len()];
        for share in 0..shares {
            let from_share = &found[share].0[read_from[share]..];
            for (index, number) in piece.order[piece.share(share)].iter().zip(from_share) {
                // The mark is the highest bit and stays.
                merged[usize::from(*index)] = number + begins[share];
            }
        }
        piece.merged = merged;
        (piece.sorted, piece.order) = (Vec::new(), Vec::new());
    });
    Ok(total)
}

/// For each position of a share its number among the distinct ones of the share, with [`NEW`] where
/// it is the first; and how many there are.
fn compare_share(pieces: &[Piece], share: usize, hasher: &Hasher) -> (Vec<u32>, usize) {
    let total: usize = pieces.iter().map(|piece| piece.share(share).len()).sum();
    let mut numbers = Vec::with_capacity(total);
    let mut slots = vec![([0_u32; 3], UNUSED); (total * 2).next_power_of_two()];
    let mask = slots.len() - 1;
    let mut distinct = 0;
    for piece in pieces {
        for &bits in &piece.sorted[piece.share(share)] {
            let mut at = hasher.hash(bits) as usize & mask;
            loop {
                let slot = &mut slots[at];
                if slot.1 == UNUSED {
                    *slot = (bits, distinct);
                    numbers.push(distinct | NEW);
                    distinct += 1;
                    break;
                }
                if slot.0 == bits {
                    numbers.push(slot.1);
                    break;
                }
                at = (at + 1) & mask;
            }
        }
    }
    (numbers, distinct as usize)
}

/// Numbers the distinct positions in the order of their first use: piece by piece, each from where
/// those before it end.
fn number(
    pieces: &[Piece],
    total: usize,
    (piece_len, numbers): (usize, &mut [u32]),
    deadline: &Deadline,
) -> Result<Vec<[f32; 3]>, Stopped> {
    let final_numbers: Vec<AtomicU32> = (0..total).map(|_| AtomicU32::new(0)).collect();
    let mut positions = vec![[0.0_f32; 3]; total];
    let (mut tasks, mut rest, mut next) = (Vec::with_capacity(pieces.len()), positions.as_mut_slice(), 0_u32);
    for piece in pieces {
        let new = piece.merged.iter().filter(|merged| **merged & NEW != 0).count();
        let (own, after) = rest.split_at_mut(new);
        tasks.push((piece, next, own));
        (rest, next) = (after, next + new as u32);
    }
    map(tasks, |(piece, begin, places)| {
        let new = piece.positions.iter().zip(&piece.merged).filter(|(_, merged)| **merged & NEW != 0);
        for ((number, place), ([x, y, z], merged)) in (begin..).zip(places).zip(new) {
            *place = [f32::from_bits(*x), f32::from_bits(*y), f32::from_bits(*z)];
            final_numbers[(merged & !NEW) as usize].store(number, Ordering::Relaxed);
        }
    });
    deadline.check()?;
    map(numbers.chunks_mut(piece_len).zip(pieces).collect(), |(numbers, piece): (&mut [u32], &Piece)| {
        let of_piece: Vec<u32> =
            piece.merged.iter().map(|merged| final_numbers[(merged & !NEW) as usize].load(Ordering::Relaxed)).collect();
        for number in numbers {
            *number = of_piece[*number as usize];
        }
    });
    Ok(positions)
}

/// Hashes positions. Keyed at random, so that no file can be made to collide; no result depends on
/// it.
struct Hasher([u64; 2]);

impl Hasher {
    fn new() -> Self {
        let random = RandomState::new();
        Self([random.hash_one(0_u64), random.hash_one(1_u64)])
    }

    /// From both halves of a 128-bit product, as in wyhash.
    #[inline(always)]
    fn hash(&self, [x, y, z]: Bits) -> u64 {
        let a = (u64::from(x) | u64::from(y) << 32) ^ self.0[0];
        let b = u64::from(z) ^ self.0[1];
        let product = u128::from(a) * u128::from(b);
        product as u64 ^ (product >> 64) as u64
    }

    /// The share of a hash, from bits that tables do not use.
    #[inline(always)]
    fn share(&self, hash: u64, shares: usize) -> usize {
        (hash >> 48) as usize & (shares - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The plain way.
    fn expected(positions: &[[f32; 3]]) -> Welded {
        let mut known = std::collections::HashMap::new();
        let mut welded = Welded::default();
        for p in positions {
            let next = known.len() as u32;
            let number = *known.entry(p.map(f32::to_bits)).or_insert(next);
            if number == next {
                welded.positions.push(*p);
            }
            welded.numbers.push(number);
        }
        welded
    }

    #[test]
    fn threads_and_pieces_change_nothing() {
        let point = |i: u32| [i as f32, (i % 7) as f32 * 0.5, -(i as f32)];
        let lists: [Vec<[f32; 3]>; 6] = [
            (0..100_000).chain(0..100_000).map(point).collect(),
            (0..150_000_u32).map(|i| point(i.wrapping_mul(2_654_435_761) >> 16)).collect(),
            (0..100_000).map(|i| point(i / 6)).collect(),
            vec![[0.0; 3]; 70_000],
            vec![[1.0; 3]],
            vec![],
        ];
        let mut compared = 0;
        for list in &lists {
            let expected = expected(list);
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                for piece in [1000, PIECE] {
                    let weld = || weld_in(piece, list.len(), |i| list[i as usize], &Deadline::default()).unwrap();
                    let welded = pool.install(weld);
                    assert!(welded == expected, "{threads} threads, {} positions in pieces of {piece}", list.len());
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 36);
        let stopped = Deadline::default();
        stopped.stop();
        assert_eq!(weld(3, |_| [0.0; 3], &stopped), Err(Stopped));
    }
}
