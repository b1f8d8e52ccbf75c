//! Welded positions, numbered in the order of their first use by faces, and then by lines and
//! points.

use super::faces::{Faces, Piece};
use super::geometry::{Geometry, Key};
use super::weld::{Bits, NEW, Welded, weld};
use crate::import::parallel::{concat, each_piece, map, map_items};
use crate::limits::{Deadline, Stopped};

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
    (keeps_triangles, deadline): (bool, &Deadline),
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
        let of_faces = pieces.iter().flat_map(|piece| piece.keys.iter().map(|key| key.index()));
        let (positions, numbers) = number_vertices(all, of_faces.chain(ends.clone().flatten()), deadline)?;
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
    let Welded { numbers: mut tables, count } = weld(&slices(&all), deadline)?;
    let mut order = Order::of(count);
    for (table, bits) in tables.iter_mut().zip(&all) {
        deadline.check()?;
        table.iter_mut().zip(bits).for_each(|(number, bits)| *number = order.number(*number, *bits));
    }
    let mut triangles = std::mem::take(&mut faces.triangles);
    let mut tasks = Vec::with_capacity(counts.len());
    let mut rest = triangles.as_mut_slice();
    for (count, table) in counts.iter().zip(&tables) {
        let (own, after) = rest.split_at_mut(*count);
        tasks.push((own, table));
        rest = after;
    }
    let collapsed = map(tasks, |(triangles, table)| renumber(triangles, table)).iter().sum();
    Ok(Numbered { positions: order.positions, triangles, ends: Vec::new(), collapsed })
}

/// Welded positions in the order of their first use, and the number of each vertex; those that are
/// not used have none.
fn number_vertices(
    all: Vec<Vec<Bits>>,
    used: impl Iterator<Item = u32>,
    deadline: &Deadline,
) -> Result<(Vec<[f32; 3]>, Vec<u32>), Stopped> {
    let Welded { numbers, count } = weld(&slices(&all), deadline)?;
    let mut order = Order::of(count);
    for (vertex, since_poll) in used.zip((0..VERTICES_PER_PIECE).cycle()) {
        if since_poll == 0 {
            deadline.check()?;
        }
        let (piece, at) = (vertex as usize / VERTICES_PER_PIECE, vertex as usize % VERTICES_PER_PIECE);
        order.number(numbers[piece][at], all[piece][at]);
    }
    drop(all);
    let Order { numbers: of_welded, positions } = order;
    let numbers = map(numbers, |mut piece| {
        piece.iter_mut().for_each(|number| *number = of_welded[(*number & !NEW) as usize]);
        piece
    });
    Ok((positions, concat(numbers)))
}

fn slices(all: &[Vec<Bits>]) -> Vec<&[Bits]> {
    all.iter().map(Vec::as_slice).collect()
}

/// The order of first use.
struct Order {
    /// By the number among the welded positions.
    numbers: Vec<u32>,
    positions: Vec<[f32; 3]>,
}

impl Order {
    /// An order of so many welded positions.
    fn of(count: usize) -> Self {
        Self { numbers: vec![UNSEEN; count], positions: Vec::with_capacity(count) }
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
