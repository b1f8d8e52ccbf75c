//! Welded positions, numbered in the order of their first use by faces, and then by lines and
//! points.

use super::faces::{Faces, Piece};
use super::geometry::{Geometry, Key};
use super::weld::{Bits, NEW, Welded, weld};
use crate::import::parallel::map;
use crate::limits::{Deadline, Stopped};

/// Vertices that a thread welds at a time.
const VERTICES_PER_PIECE: usize = 32_768;
const UNSEEN: u32 = u32::MAX;

/// Bytes per distinct corner of a piece, and per vertex: a position and its number beside
/// the memory of welding, and the final position.
pub const BYTES_PER_VERTEX: u64 = 12 + 4 + super::weld::BYTES_PER_POSITION + 12;

/// Welded positions and what uses them.
#[derive(Debug)]
pub struct Numbered {
    /// The positions.
    pub positions: Vec<[f32; 3]>,
    /// The ends of lines and points.
    pub ends: Vec<[u32; 2]>,
    /// Faces of which two corners became equal.
    pub collapsed: u64,
}

/// Welds the positions and makes the triangles of `faces` refer to them. `position` brings one into
/// the unit box.
pub fn number<G: Geometry>(
    geometry: &G,
    faces: &mut Faces<G::Key>,
    ends: impl ExactSizeIterator<Item = [u32; 2]>,
    position: impl Fn([f64; 3]) -> [f32; 3] + Sync,
    deadline: &Deadline,
) -> Result<Numbered, Stopped> {
    let bits = |p: [f64; 3]| {
        let [x, y, z] = position(p);
        [x.to_bits(), y.to_bits(), z.to_bits()]
    };
    let pieces = std::mem::take(&mut faces.pieces);
    let counts: Vec<usize> = pieces.iter().map(|piece| piece.faces).collect();
    let mut order = Order::default();
    let mut of_ends = Vec::new();
    let tables = match geometry.vertices() {
        Some(vertices) => {
            let chunks = vertices.chunks(VERTICES_PER_PIECE).collect();
            let all = map(chunks, |chunk: &[[f64; 3]]| chunk.iter().map(|p| bits(*p)).collect());
            let of_pieces: Vec<Vec<u32>> =
                map(pieces, |piece: Piece<G::Key>| piece.keys.iter().map(|key| key.index()).collect());
            let welded = weld(&slices(&all), deadline)?;
            order.reserve(welded.count);
            let mut tables = of_pieces;
            let mut number = |vertex: u32| {
                let (piece, at) = (vertex as usize / VERTICES_PER_PIECE, vertex as usize % VERTICES_PER_PIECE);
                order.number(welded.numbers[piece][at], all[piece][at])
            };
            for table in &mut tables {
                deadline.check()?;
                table.iter_mut().for_each(|vertex| *vertex = number(*vertex));
            }
            of_ends = ends.map(|[a, b]| [number(a), number(b)]).collect();
            tables
        }
        None => {
            let all = map(pieces, |piece: Piece<G::Key>| {
                piece.keys.iter().map(|key| bits(geometry.position(*key))).collect()
            });
            let Welded { numbers: mut tables, count } = weld(&slices(&all), deadline)?;
            order.reserve(count);
            for (table, bits) in tables.iter_mut().zip(&all) {
                deadline.check()?;
                table.iter_mut().zip(bits).for_each(|(number, bits)| *number = order.number(*number, *bits));
            }
            tables
        }
    };
    let collapsed = renumber(&mut faces.triangles, &counts, &tables);
    Ok(Numbered { positions: order.positions, ends: of_ends, collapsed })
}

fn slices(all: &[Vec<Bits>]) -> Vec<&[Bits]> {
    all.iter().map(Vec::as_slice).collect()
}

/// The order of first use.
#[derive(Default)]
struct Order {
    /// By the number among the welded positions.
    numbers: Vec<u32>,
    positions: Vec<[f32; 3]>,
}

impl Order {
    /// Makes room for so many welded positions.
    fn reserve(&mut self, count: usize) {
        self.numbers = vec![UNSEEN; count];
        self.positions.reserve_exact(count);
    }

    /// The number of a welded position.
    #[inline(always)]
    fn number(&mut self, welded: u32, bits: Bits) -> u32 {
        let number = &mut self.numbers[(welded & !NEW) as usize];
        if *number == UNSEEN {
            *number = self.positions.len() as u32;
            let [x, y, z] = bits;
            self.positions.push([f32::from_bits(x), f32::from_bits(y), f32::from_bits(z)]);
        }
        *number
    }
}

/// Turns the numbers of pieces, each of so many triangles, into those of their tables. Returns how
/// many triangles have equal corners then.
fn renumber(triangles: &mut [[u32; 3]], counts: &[usize], tables: &[Vec<u32>]) -> u64 {
    let mut tasks = Vec::with_capacity(counts.len());
    let mut rest = triangles;
    for (count, table) in counts.iter().zip(tables) {
        let (own, after) = rest.split_at_mut(*count);
        tasks.push((own, table));
        rest = after;
    }
    let collapsed = map(tasks, |(triangles, table): (&mut [[u32; 3]], &Vec<u32>)| {
        let mut collapsed = 0;
        for triangle in triangles {
            let [a, b, c] = *triangle;
            *triangle = [table[a as usize], table[b as usize], table[c as usize]];
            collapsed += u64::from(is_collapsed(triangle));
        }
        collapsed
    });
    collapsed.iter().sum()
}

/// True if two corners are equal.
#[inline(always)]
pub fn is_collapsed([a, b, c]: &[u32; 3]) -> bool {
    (a == b) | (b == c) | (c == a)
}
