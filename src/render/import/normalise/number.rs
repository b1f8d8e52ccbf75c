//! The order of a mesh's positions. `weld` makes equal positions one, in an order that depends on a
//! random hash. So the distinct ones are numbered here in the order of their first use by
//! triangles, and then by lines and points. Those that nothing uses are left out.

use super::faces::{Faces, Piece};
use super::geometry::{Geometry, Key};
use super::weld::{Bits, NEW, Welded, weld};
use crate::limits::{Deadline, Stopped};
use crate::parallel::{concat, each_piece, map, map_items};
use bytemuck::allocation::zeroed_vec;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

/// Vertices that a thread welds at a time.
const VERTICES_PER_PIECE: usize = 32_768;
const UNSEEN: u32 = u32::MAX;

/// Bytes per distinct corner of a piece, and per vertex: a position and its number beside
/// the memory of welding, and the final position.
pub const BYTES_PER_VERTEX: u64 = 12 + 4 + super::weld::BYTES_PER_POSITION + 12;

/// Welded positions and what uses them.
#[derive(Debug, Default)]
pub struct Numbered {
    /// The positions.
    pub positions: Vec<[f32; 3]>,
    /// Faces, three positions each, some of them equal.
    pub triangles: Vec<[u32; 3]>,
    /// The ends of lines and points.
    pub ends: Vec<[u32; 2]>,
    /// Faces of which two corners became equal.
    pub collapsed: u64,
}

/// Welds the positions and numbers the corners of `faces`. `position` brings one into the unit box.
/// The positions of `geometry` are gone then, and its triangles too unless they are kept.
pub fn number<G: Geometry>(
    geometry: &mut G,
    faces: &mut Faces<G::Key>,
    ends: impl Iterator<Item = [u32; 2]> + Clone,
    position: impl Fn([f64; 3]) -> [f32; 3] + Sync,
    keeps_triangles: bool,
    deadline: &Deadline,
) -> Result<Numbered, Stopped> {
    let bits = |p: [f64; 3]| {
        let [x, y, z] = position(p);
        [x.to_bits(), y.to_bits(), z.to_bits()]
    };
    let pieces = std::mem::take(&mut faces.pieces);
    if let Some(indexed) = geometry.indexed() {
        let positions = std::mem::take(&mut indexed.positions);
        let all: Vec<Vec<Bits>> =
            map(positions.chunks(VERTICES_PER_PIECE).collect(), |chunk| chunk.iter().map(|p| bits(*p)).collect());
        drop(positions);
        let (positions, numbers) = number_vertices(all, &pieces, ends.clone().flatten(), deadline)?;
        let ends = ends.map(|ends| ends.map(|v| numbers[v as usize])).collect();
        let file = &mut indexed.triangles;
        let mut triangles = match &faces.kept {
            Some(kept) => map_items(kept, |triangle| file[*triangle as usize]),
            None if keeps_triangles => map_items(file, |triangle| *triangle),
            None => std::mem::take(file),
        };
        let collapsed = each_piece(&mut triangles, |piece| renumber(piece, &numbers)).iter().sum();
        return Ok(Numbered { positions, triangles, ends, collapsed });
    }
    let counts: Vec<usize> = pieces.iter().map(|piece| piece.faces).collect();
    let all: Vec<Vec<Bits>> =
        map(pieces, |piece: Piece<G::Key>| piece.keys.iter().map(|key| bits(geometry.position(*key))).collect());
    let Welded { numbers: tables, count } = weld(&slices(&all), deadline)?;
    let order = Order::of(count);
    // Positions are welded in the order of their use, so that the first of equal ones is marked.
    let firsts = map(tables.iter().collect(), |table: &Vec<u32>| {
        deadline.check()?;
        Ok((0..).zip(table).filter(|(_, number)| **number & NEW != 0).map(|(at, _)| at).collect())
    });
    let firsts = firsts.into_iter().collect::<Result<Vec<Vec<u32>>, Stopped>>()?;
    let positions = order.number(&firsts, |piece, at| (tables[piece][at as usize], all[piece][at as usize]));
    let mut triangles = std::mem::take(&mut faces.triangles);
    let mut tasks = Vec::with_capacity(counts.len());
    let mut rest = triangles.as_mut_slice();
    for (count, table) in counts.iter().zip(tables) {
        let (own, after) = rest.split_at_mut(*count);
        tasks.push((own, table));
        rest = after;
    }
    let collapsed = map(tasks, |(triangles, mut table)| {
        table.iter_mut().for_each(|number| *number = order.of_welded(*number));
        renumber(triangles, &table)
    });
    Ok(Numbered { positions, triangles, ends: Vec::new(), collapsed: collapsed.iter().sum() })
}

/// Welded positions in the order of their first use by faces and then by `ends`, and the number of
/// each vertex; those that are not used have none.
fn number_vertices<K: Key>(
    all: Vec<Vec<Bits>>,
    pieces: &[Piece<K>],
    ends: impl Iterator<Item = u32>,
    deadline: &Deadline,
) -> Result<(Vec<[f32; 3]>, Vec<u32>), Stopped> {
    let Welded { mut numbers, count } = weld(&slices(&all), deadline)?;
    let order = Order::of(count);
    let entry = |vertex: u32| {
        let (piece, at) = (vertex as usize / VERTICES_PER_PIECE, vertex as usize % VERTICES_PER_PIECE);
        (numbers[piece][at], all[piece][at])
    };
    let of_pieces = || (0..).zip(pieces).collect();
    map(of_pieces(), |(number, piece): (u32, &Piece<K>)| {
        deadline.check()?;
        piece.keys.iter().for_each(|key| order.see(entry(key.index()).0, number));
        Ok(())
    })
    .into_iter()
    .collect::<Result<(), Stopped>>()?;
    let firsts = map(of_pieces(), |(number, piece): (u32, &Piece<K>)| {
        let vertices = piece.keys.iter().map(|key| key.index());
        vertices.filter(|vertex| order.claim(entry(*vertex).0, number)).collect()
    });
    let mut positions = order.number(&firsts, |_, vertex| entry(vertex));
    for (vertex, since_poll) in ends.zip((0..VERTICES_PER_PIECE).cycle()) {
        if since_poll == 0 {
            deadline.check()?;
        }
        let (welded, bits) = entry(vertex);
        if order.of_welded(welded) == UNSEEN {
            order.set(welded, positions.len() as u32);
            positions.push(bits.map(f32::from_bits));
        }
    }
    drop(all);
    numbers = map(numbers, |mut piece| {
        piece.iter_mut().for_each(|number| *number = order.of_welded(*number));
        piece
    });
    Ok((positions, concat(numbers)))
}

fn slices(all: &[Vec<Bits>]) -> Vec<&[Bits]> {
    all.iter().map(Vec::as_slice).collect()
}

/// The order of first use, found by threads side by side: for each welded position first the piece
/// that uses it first, and then its number. They are stored as complements, so that the list begins as
/// zeros, which the system gives without a write.
struct Order(Vec<AtomicU32>);

/// Marks a piece that has counted its first use of a position.
const CLAIMED: u32 = 1 << 31;

impl Order {
    /// An order of so many welded positions.
    fn of(count: usize) -> Self {
        Self(zeroed_vec(count))
    }

    #[inline(always)]
    fn place(&self, welded: u32) -> &AtomicU32 {
        &self.0[(welded & !NEW) as usize]
    }

    /// Says that a piece uses a position.
    #[inline(always)]
    fn see(&self, welded: u32, piece: u32) {
        if self.of_welded(welded) > piece {
            self.place(welded).fetch_max(!piece, Relaxed);
        }
    }

    /// True if a piece, after all have said what they use, is the first to use a position, and has
    /// not asked before.
    #[inline(always)]
    fn claim(&self, welded: u32, piece: u32) -> bool {
        let is_first = self.of_welded(welded) == piece;
        if is_first {
            self.set(welded, piece | CLAIMED);
        }
        is_first
    }

    /// The number of a position, or what is known so far.
    #[inline(always)]
    fn of_welded(&self, welded: u32) -> u32 {
        !self.place(welded).load(Relaxed)
    }

    #[inline(always)]
    fn set(&self, welded: u32, number: u32) {
        self.place(welded).store(!number, Relaxed);
    }

    /// Numbers the positions that pieces are the first to use; `entry` gives a position's welded
    /// number and its bits. Returns the positions by number.
    fn number(&self, firsts: &[Vec<u32>], entry: impl Fn(usize, u32) -> (u32, Bits) + Sync + Send) -> Vec<[f32; 3]> {
        let mut positions = vec![[0.0; 3]; firsts.iter().map(Vec::len).sum()];
        let mut tasks = Vec::with_capacity(firsts.len());
        let (mut rest, mut begin) = (positions.as_mut_slice(), 0);
        for (piece, firsts) in firsts.iter().enumerate() {
            let (own, after) = rest.split_at_mut(firsts.len());
            tasks.push((piece, begin, firsts, own));
            (rest, begin) = (after, begin + firsts.len() as u32);
        }
        map(tasks, |(piece, begin, firsts, places): (usize, u32, &Vec<u32>, &mut [[f32; 3]])| {
            for ((number, at), place) in (begin..).zip(firsts).zip(places) {
                let (welded, bits) = entry(piece, *at);
                self.set(welded, number);
                *place = bits.map(f32::from_bits);
            }
        });
        positions
    }
}

/// Replaces the corners of triangles by their values in a table. Returns how many triangles have
/// equal corners then.
fn renumber(triangles: &mut [[u32; 3]], table: &[u32]) -> u64 {
    let mut collapsed = 0;
    for triangle in triangles {
        let [a, b, c] = *triangle;
        *triangle = [table[a as usize], table[b as usize], table[c as usize]];
        collapsed += u64::from(is_collapsed(triangle));
    }
    collapsed
}

/// True if two corners are equal.
#[inline(always)]
pub fn is_collapsed([a, b, c]: &[u32; 3]) -> bool {
    (a == b) | (b == c) | (c == a)
}
