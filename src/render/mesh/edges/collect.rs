//! The search for the edges of a mesh: all sides of its triangles are sorted by counting sort, and sides
//! between the same two vertices become one edge. Several threads share the work.
//!
//! A side of triangle `t` has the number `3 t + i` and goes from corner `i` to corner `i + 1`. Sides are
//! sorted into buckets by the lower of their two vertex numbers. Those in a bucket that have the same
//! upper vertex, too, are called mates: they are one edge. The first side of each set of mates becomes
//! that edge, so edges come in the order of their first triangles. Loops avoid branches, because the
//! order of a mesh's triangles cannot be predicted.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use bytemuck::allocation::zeroed_vec;

use super::{Edge, EdgeList, FACE_COUNT, HAS_INCONSISTENT_WINDING, IS_POLYGON_EDGE};
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::parallel::map;

/// Pieces that the sides are counted and sorted in. Each takes a number per vertex. Their number is
/// fixed so that budgets do not depend on the number of threads.
const SORTED_AT_ONCE: usize = 4;

/// Triangles from which a mesh is shared among threads.
const SHARED_FROM: usize = 1 << 13;

/// Triangles and vertices per piece where pieces take no memory.
const PIECE: usize = 1 << 14;

/// The longest bucket that is searched pair by pair. The hub of a hostile fan has millions of sides.
const PAIRS_MAX: usize = 24;

/// Sides in a block: those of a block that come first are found, and then made into edges.
const BLOCK: usize = 384;

/// A side that has mates and is not the first of them.
const IS_LATER: u32 = u32::MAX;

/// The edges of `mesh`.
pub fn collect(mesh: &Mesh, budget: &mut Budget) -> Result<EdgeList, LimitExceeded> {
    let (vertices, sides) = (mesh.positions.len(), 3 * mesh.triangles.len());
    let pieces = if mesh.triangles.len() < SHARED_FROM { 1 } else { SORTED_AT_ONCE };
    budget.spend("the edges", vertices as u64, 4 * (pieces as u64 + 1))?;
    // Sorted sides, and their mates.
    budget.spend("the edges", sides as u64, 8 + 4)?;
    let buckets = Buckets::of(mesh, pieces);
    // Each thread may sort a copy of a bucket.
    budget.spend("the edges", buckets.in_long_ones as u64, 8)?;
    let mates: Vec<AtomicU32> = zeroed_vec(sides);
    let crowded_counts: Vec<usize> = in_pieces(vertices, |range| {
        let mut count = 0;
        buckets.mark_mates(&mates, range, &mut |_| count += 1);
        count
    });
    let crowded_count = crowded_counts.iter().sum();
    budget.spend("the edges", crowded_count as u64, size_of::<[u32; 2]>() as u64)?;
    let mut crowded = Vec::with_capacity(crowded_count);
    for (range, _) in pieces_of(vertices).into_iter().zip(crowded_counts).filter(|(_, count)| *count > 0) {
        buckets.mark_mates(&mates, range, &mut |mate| crowded.push(mate));
    }
    drop(buckets);
    let counts = in_pieces(mesh.triangles.len(), |range| first_sides(&mates, range).count());
    let count = counts.iter().sum();
    budget.spend("the edges", count as u64, size_of::<Edge>() as u64 + 1)?;
    let (mut edges, mut kinds) = (zeroed_vec(count), zeroed_vec(count));
    fill(mesh, &mates, &counts, &mut edges, &mut kinds);
    let further_faces = add_further_faces(mesh, &mates, crowded, (&counts, &mut kinds));
    Ok(EdgeList { edges: Arc::new(edges), further_faces, kinds })
}

/// The results of `each` for ranges of a long list, in order. A short one is a single range.
fn in_pieces<R: Send>(count: usize, each: impl Fn(Range<usize>) -> R + Sync + Send) -> Vec<R> {
    map(pieces_of(count), each)
}

/// The ranges of [`in_pieces`].
fn pieces_of(count: usize) -> Vec<Range<usize>> {
    if count < SHARED_FROM { ranges(count, count) } else { ranges(count, PIECE) }
}

fn ranges(count: usize, length: usize) -> Vec<Range<usize>> {
    (0..count).step_by(length.max(1)).map(|from| from..count.min(from + length)).collect()
}

/// The lower and the upper vertex of each side of a triangle.
#[inline(always)]
fn keys([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// The sides sorted by their lower vertex and, at each vertex, by number.
struct Buckets {
    /// By vertex: the start of its bucket; and the end of the last.
    starts: Vec<u32>,
    /// The upper vertex above the number of each side. Threads write to places of their own.
    sides: Vec<AtomicU64>,
    /// The number of sides in buckets longer than [`PAIRS_MAX`].
    in_long_ones: usize,
}

impl Buckets {
    /// Sorts the sides in so many pieces.
    fn of(mesh: &Mesh, pieces: usize) -> Self {
        let vertices = mesh.positions.len();
        let triangles = ranges(mesh.triangles.len(), mesh.triangles.len().div_ceil(pieces));
        let count = |range: &Range<usize>| {
            let mut counts = vec![0_u32; vertices];
            for [lower, _] in mesh.triangles[range.clone()].iter().flat_map(|triangle| keys(*triangle)) {
                counts[lower as usize] += 1;
            }
            counts
        };
        // By piece and vertex: first the number of sides, then the place of the next one.
        let mut places: Vec<Vec<u32>> = map(triangles.iter().collect(), count);
        let mut starts = vec![0_u32; vertices + 1];
        let (mut next, mut in_long_ones) = (0_u32, 0);
        for (vertex, start) in starts.iter_mut().enumerate() {
            *start = next;
            for place in places.iter_mut().filter_map(|places| places.get_mut(vertex)) {
                // Most pieces have no side at a vertex. Their memory is not touched.
                if *place != 0 {
                    next += std::mem::replace(place, next);
                }
            }
            let length = (next - *start) as usize;
            in_long_ones += if length > PAIRS_MAX { length } else { 0 };
        }
        let sides: Vec<AtomicU64> = zeroed_vec(3 * mesh.triangles.len());
        let scatter = |(range, places): (Range<usize>, &mut Vec<u32>)| {
            for (triangle, number) in mesh.triangles[range.clone()].iter().zip((3 * range.start as u64..).step_by(3)) {
                for ([lower, upper], number) in keys(*triangle).into_iter().zip(number..) {
                    let place = &mut places[lower as usize];
                    sides[*place as usize].store(u64::from(upper) << 32 | number, Relaxed);
                    *place += 1;
                }
            }
        };
        map(triangles.into_iter().zip(&mut places).collect(), scatter);
        Self { starts, sides, in_long_ones }
    }

    /// Sets, by side, the second of its mates if it is the first, 0 if it has none, and else
    /// [`IS_LATER`]. Calls `each` with the third and further mates, each after the first one.
    fn mark_mates(&self, mates: &[AtomicU32], vertices: Range<usize>, each: &mut impl FnMut([u32; 2])) {
        let mut copy = Vec::new();
        for vertex in vertices {
            let bucket = &self.sides[self.starts[vertex] as usize..self.starts[vertex + 1] as usize];
            match bucket.len() {
                0..=8 => pair_up::<8>(bucket, mates, each),
                9..=PAIRS_MAX => pair_up::<PAIRS_MAX>(bucket, mates, each),
                _ => {
                    copy.clear();
                    copy.reserve_exact(bucket.len());
                    copy.extend(bucket.iter().map(|side| side.load(Relaxed)));
                    copy.sort_unstable();
                    copy.chunk_by(|a, b| a >> 32 == b >> 32).for_each(|same| mark(same, mates, each));
                }
            }
        }
    }
}

/// Marks the mates in a bucket of at most `MAX` sides.
#[inline(always)]
fn pair_up<const MAX: usize>(bucket: &[AtomicU64], mates: &[AtomicU32], each: &mut impl FnMut([u32; 2])) {
    let (mut uppers, mut numbers) = ([0_u32; MAX], [0_u32; MAX]);
    for ((side, upper), number) in bucket.iter().zip(&mut uppers).zip(&mut numbers) {
        let side = side.load(Relaxed);
        (*upper, *number) = ((side >> 32) as u32, side as u32);
    }
    for i in 0..bucket.len().min(MAX) {
        // Bits of the sides that have the same upper vertex. Places without a side have vertex 0, which
        // is never an upper one.
        let mut same = 0_u32;
        for (j, upper) in uppers.iter().enumerate() {
            same |= u32::from(*upper == uppers[i]) << j;
        }
        let (earlier, later) = (same & ((1 << i) - 1), same >> i >> 1);
        // Without a later one, an index that is not used.
        let second = numbers[(i + 1 + later.trailing_zeros() as usize) % MAX];
        let mate = if later == 0 { 0 } else { second };
        mates[numbers[i] as usize].store(if earlier == 0 { mate } else { IS_LATER }, Relaxed);
        if earlier & earlier.wrapping_sub(1) != 0 {
            each([numbers[earlier.trailing_zeros() as usize % MAX], numbers[i]]);
        }
    }
}

/// Marks the sides of one edge, in order, as mates.
fn mark(same: &[u64], mates: &[AtomicU32], each: &mut impl FnMut([u32; 2])) {
    let first = same[0] as u32;
    for (i, side) in same.iter().map(|&side| side as u32).enumerate().skip(1) {
        mates[side as usize].store(IS_LATER, Relaxed);
        match i {
            1 => mates[first as usize].store(side, Relaxed),
            _ => each([first, side]),
        }
    }
}

/// The sides of a range of triangles that are the first of their mates.
fn first_sides(mates: &[AtomicU32], triangles: Range<usize>) -> impl Iterator<Item = usize> {
    (3 * triangles.start..3 * triangles.end).filter(|&side| mates[side].load(Relaxed) != IS_LATER)
}

/// Writes the edges, of which there are so many in each piece of triangles.
fn fill(mesh: &Mesh, mates: &[AtomicU32], counts: &[usize], mut edges: &mut [Edge], mut kinds: &mut [u8]) {
    let mut pieces = Vec::with_capacity(counts.len());
    for (range, &count) in pieces_of(mesh.triangles.len()).into_iter().zip(counts) {
        let (own_edges, other_edges) = edges.split_at_mut(count);
        let (own_kinds, other_kinds) = kinds.split_at_mut(count);
        pieces.push((range, own_edges, own_kinds));
        (edges, kinds) = (other_edges, other_kinds);
    }
    map(pieces, |(range, edges, kinds): (Range<usize>, &mut [Edge], &mut [u8])| {
        let mut places = edges.iter_mut().zip(kinds);
        let mut firsts = [0_u32; BLOCK];
        for block in ranges(3 * range.len(), BLOCK) {
            // The sides that become edges, without a branch for each.
            let (mut count, from) = (0, 3 * range.start + block.start);
            for (mate, side) in mates[from..][..block.len()].iter().zip(from as u32..) {
                firsts[count] = side;
                count += usize::from(mate.load(Relaxed) != IS_LATER);
            }
            for (&side, (edge, kind)) in firsts[..count].iter().zip(&mut places) {
                (*edge, *kind) = edge_of(mesh, side, mates[side as usize].load(Relaxed));
            }
        }
    });
}

/// The edge of a side and its second mate (0: none), and its kind.
#[inline(always)]
fn edge_of(mesh: &Mesh, side: u32, mate: u32) -> (Edge, u8) {
    // Without a mate, itself.
    let other = if mate == 0 { side } else { mate };
    let [(face, corner), (other_face, other_corner)] = [side, other].map(|side| (side / 3, side % 3));
    let triangle = mesh.triangles[face as usize];
    let start = triangle[corner as usize];
    let end = triangle[if corner == 2 { 0 } else { corner as usize + 1 }];
    let masks = mesh.edge_masks[face as usize] >> corner | mesh.edge_masks[other_face as usize] >> other_corner;
    let is_inconsistent = (mate != 0) & (mesh.triangles[other_face as usize][other_corner as usize] == start);
    let second = if mate == 0 { Edge::NO_FACE } else { other_face };
    let flags = (masks & 1) * IS_POLYGON_EDGE + u8::from(is_inconsistent) * HAS_INCONSISTENT_WINDING;
    let kind = 1 + u8::from(mate != 0) + flags;
    (Edge::new(&mesh.positions, [start, end], [face, second]), kind)
}

/// Adds third and further sides to the kinds of their edges, of which there are so many in each piece
/// of triangles. They come with the first side of their edge, and are returned as edges and faces, in
/// mesh order.
fn add_further_faces(
    mesh: &Mesh,
    mates: &[AtomicU32],
    mut sides: Vec<[u32; 2]>,
    (counts, kinds): (&[usize], &mut [u8]),
) -> Vec<[u32; 2]> {
    sides.sort_unstable_by_key(|[first, _]| *first);
    let (mut firsts, mut next_edge) = (sides.iter().map(|[first, _]| *first as usize).peekable(), 0);
    for (range, &count) in pieces_of(mesh.triangles.len()).into_iter().zip(counts) {
        let end = 3 * range.end;
        if firsts.peek().is_some_and(|first| *first < end) {
            // By first side: its edge.
            for (side, edge) in first_sides(mates, range).zip(next_edge..) {
                mates[side].store(edge, Relaxed);
            }
            while firsts.next_if(|first| *first < end).is_some() {}
        }
        next_edge += count as u32;
    }
    sides.sort_unstable_by_key(|[_, side]| *side);
    for [first, side] in &mut sides {
        let start = |side: u32| mesh.triangles[side as usize / 3][side as usize % 3];
        let edge = mates[*first as usize].load(Relaxed);
        let (face, corner) = (*side / 3, *side % 3);
        let kind = &mut kinds[edge as usize];
        *kind |= FACE_COUNT;
        *kind |= (mesh.edge_masks[face as usize] >> corner & 1) * IS_POLYGON_EDGE;
        *kind |= u8::from(start(*first) == start(*side)) * HAS_INCONSISTENT_WINDING;
        (*first, *side) = (edge, face);
    }
    sides
}
