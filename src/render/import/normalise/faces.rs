//! The choice of the faces of an imported mesh: its triangles with finite corners (coordinates
//! below about 2^1022) and an area that is not zero. Each gets a unit normal here. The others are
//! counted. Welding may drop more.

use super::geometry::{Geometry, Key as _};
use super::local::{CORNERS_MAX, Local};
use super::pow2::{Pow2, exponent, is_usable, max_abs};
use crate::limits::{Deadline, Stopped};
use crate::mesh::vector::{cross, dot, sub};
use crate::parallel::{map, map_with};

/// Triangles handed to a thread at a time.
const TRIANGLES_PER_PIECE: usize = 16_384;
const _: () = assert!(3 * TRIANGLES_PER_PIECE <= CORNERS_MAX);
/// Positions, likewise.
const POSITIONS_PER_PIECE: usize = 32_768;
/// Triangles whose normals are made unit at a time.
const BLOCK: usize = 64;

/// A box around some positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The smallest coordinates; infinite without a position.
    pub low: [f64; 3],
    /// The largest.
    pub high: [f64; 3],
}

impl Bounds {
    /// A box around nothing.
    pub const EMPTY: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    /// The box around this one and a position.
    #[inline(always)]
    #[must_use]
    pub fn with(mut self, p: [f64; 3]) -> Self {
        for (k, c) in p.into_iter().enumerate() {
            self.low[k] = if c < self.low[k] { c } else { self.low[k] };
            self.high[k] = if c > self.high[k] { c } else { self.high[k] };
        }
        self
    }

    /// The box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    /// The box scaled by a power of two.
    #[must_use]
    pub fn scaled(&self, by: Pow2) -> Self {
        Self { low: by.of3(self.low), high: by.of3(self.high) }
    }

    /// The largest magnitude of a coordinate; infinite without a position.
    pub fn largest(&self) -> f64 {
        max_abs(&self.low).max(max_abs(&self.high))
    }
}

/// Facts about some positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// The largest magnitude among usable ones.
    pub largest: f64,
    /// True if f32 has all usable ones exactly.
    pub is_f32: bool,
    /// True if all are usable.
    pub is_usable: bool,
}

/// Looks at all positions.
pub fn survey(positions: &[[f64; 3]], deadline: &Deadline) -> Result<Survey, Stopped> {
    let pieces = map(positions.chunks(POSITIONS_PER_PIECE).collect(), |piece: &[[f64; 3]]| {
        deadline.check()?;
        let (mut largest, mut is_f32, mut all_usable) = ([0.0_f64; 3], true, true);
        for p in piece {
            if !is_usable(p) {
                all_usable = false;
                continue;
            }
            for (largest, c) in largest.iter_mut().zip(p) {
                *largest = if c.abs() > *largest { c.abs() } else { *largest };
            }
            is_f32 &= has_f32(*p);
        }
        Ok(Survey { largest: max_abs(&largest), is_f32, is_usable: all_usable })
    });
    let mut all = Survey { largest: 0.0, is_f32: true, is_usable: true };
    for piece in pieces {
        let piece = piece?;
        all.largest = all.largest.max(piece.largest);
        all.is_f32 &= piece.is_f32;
        all.is_usable &= piece.is_usable;
    }
    Ok(all)
}

/// True if f32 has all coordinates of the usable triangles exactly.
pub fn have_f32<G: Geometry>(geometry: &G, deadline: &Deadline) -> Result<bool, Stopped> {
    for triangle in 0..geometry.triangles() {
        if triangle.is_multiple_of(TRIANGLES_PER_PIECE) {
            deadline.check()?;
        }
        let corners = geometry.corners(triangle);
        if corners.iter().all(is_usable) && !corners.into_iter().all(has_f32) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The faces of a mesh.
#[derive(Debug)]
pub struct Faces<K> {
    /// A unit normal for each.
    pub normals: Vec<[f32; 3]>,
    /// The corners of each face, as numbers in its piece; empty where keys are indices.
    pub triangles: Vec<[u32; 3]>,
    /// The pieces, in order.
    pub pieces: Vec<Piece<K>>,
    /// The triangle of each; None if all triangles are faces.
    pub kept: Option<Vec<u32>>,
    /// The box around them.
    pub bounds: Bounds,
    /// The box around the triangles whose corners are all usable.
    pub usable: Bounds,
    /// Triangles with a corner that is NaN or infinite.
    pub nonfinite: u64,
    /// Triangles without an area.
    pub degenerate: u64,
}

/// Some faces that follow each other.
#[derive(Debug)]
pub struct Piece<K> {
    /// Number of faces.
    pub faces: usize,
    /// Their distinct corners, in the order of their first use.
    pub keys: Vec<K>,
}

impl<K> Faces<K> {
    /// The triangle of a face.
    #[inline]
    pub fn triangle(&self, face: usize) -> usize {
        self.kept.as_ref().map_or(face, |kept| kept[face] as usize)
    }
}

/// Picks the faces. `down` brings their positions to about 1, so that no relevant product over- or
/// underflows. None is for positions that f32 has exactly: then none does anyway, and scaling by
/// powers of two changes no bit of a normal.
pub fn pick<G: Geometry>(geometry: &G, down: Option<Pow2>, deadline: &Deadline) -> Result<Faces<G::Key>, Stopped> {
    match down {
        None => pick_scaled(geometry, |p| p, deadline),
        Some(down) => pick_scaled(geometry, |p| down.of3(p), deadline),
    }
}

/// The corners of the first triangles without an area.
pub fn degenerate<G: Geometry>(geometry: &G, faces: &Faces<G::Key>, count: usize) -> Vec<[[f64; 3]; 3]> {
    let (Some(kept), true) = (&faces.kept, faces.degenerate > 0) else { return Vec::new() };
    let mut kept = kept.iter().copied().peekable();
    let is_dropped = |triangle: &usize| kept.next_if_eq(&(*triangle as u32)).is_none();
    let dropped = (0..geometry.triangles()).filter(is_dropped).map(|triangle| geometry.corners(triangle));
    dropped.filter(|corners| corners.iter().all(is_usable)).take(count).collect()
}

fn pick_scaled<G: Geometry>(
    geometry: &G,
    scale: impl Fn([f64; 3]) -> [f64; 3] + Sync + Send,
    deadline: &Deadline,
) -> Result<Faces<G::Key>, Stopped> {
    let count = geometry.triangles();
    let mut normals = vec![[0.0_f32; 3]; count];
    let mut triangles = vec![[0_u32; 3]; if G::Key::IS_INDEX { 0 } else { count }];
    let mut pieces = triangles.chunks_mut(TRIANGLES_PER_PIECE);
    let places = normals.chunks_mut(TRIANGLES_PER_PIECE).map(|normals| (normals, pieces.next().unwrap_or_default()));
    let done =
        map_with((0..).step_by(TRIANGLES_PER_PIECE).zip(places).collect(), Local::new, |local, (begin, (n, t))| {
            deadline.check()?;
            Ok(pick_piece(geometry, begin, &scale, n, t, local))
        });
    let mut faces = Faces {
        normals: Vec::new(),
        triangles: Vec::new(),
        pieces: Vec::with_capacity(done.len()),
        kept: None,
        bounds: Bounds::EMPTY,
        usable: Bounds::EMPTY,
        nonfinite: 0,
        degenerate: 0,
    };
    for done in done {
        let Picked { piece, bounds, usable, nonfinite, degenerate } = done?;
        faces.pieces.push(piece);
        faces.bounds = faces.bounds.union(bounds);
        faces.usable = faces.usable.union(usable);
        faces.nonfinite += nonfinite;
        faces.degenerate += degenerate;
    }
    if faces.nonfinite + faces.degenerate > 0 {
        let is_face = |normal: &[f32; 3]| !normal[0].is_nan();
        let kept = (0..).zip(&normals).filter(|(_, normal)| is_face(normal)).map(|(triangle, _)| triangle);
        faces.kept = Some(kept.collect());
        let mut of_triangles = normals.iter();
        triangles.retain(|_| of_triangles.next().is_some_and(is_face));
        normals.retain(is_face);
    }
    (faces.normals, faces.triangles) = (normals, triangles);
    Ok(faces)
}

/// The faces of a piece, with the bounds and counts of its triangles.
struct Picked<K> {
    piece: Piece<K>,
    bounds: Bounds,
    usable: Bounds,
    nonfinite: u64,
    degenerate: u64,
}

/// Fills in the normals of some triangles from `begin` on, with NaN for those that are no faces, and
/// the local numbers of the others' corners if there is room for them.
fn pick_piece<G: Geometry>(
    geometry: &G,
    begin: usize,
    scale: impl Fn([f64; 3]) -> [f64; 3],
    normals: &mut [[f32; 3]],
    triangles: &mut [[u32; 3]],
    local: &mut Local<G::Key>,
) -> Picked<G::Key> {
    let piece = begin..begin + normals.len();
    local.begin(piece.clone().map(|triangle| geometry.keys(triangle)));
    let (mut nonfinite, mut degenerate) = (0, 0);
    let mut places = triangles.chunks_mut(BLOCK);
    for (begin, normals) in piece.clone().step_by(BLOCK).zip(normals.chunks_mut(BLOCK)) {
        let places = places.next().unwrap_or_default();
        let mut block = Block::default();
        block.fill(begin..begin + normals.len(), geometry, &scale);
        block.units(normals);
        for (i, normal) in normals.iter_mut().enumerate() {
            let triangle = begin + i;
            if normal[0].is_nan() {
                match sliver(geometry.corners(triangle), &scale) {
                    Some(Some(n)) => *normal = n,
                    Some(None) => degenerate += 1,
                    None => nonfinite += 1,
                }
            }
            if !normal[0].is_nan() {
                let [a, b, c] = geometry.keys(triangle);
                let numbers = [local.number(a), local.number(b), local.number(c)];
                if let Some(place) = places.get_mut(i) {
                    *place = numbers;
                }
            }
        }
    }
    let keys = local.finish();
    let bounds = keys.iter().map(|key| geometry.position(*key)).fold(Bounds::EMPTY, Bounds::with);
    let mut usable = bounds;
    if degenerate > 0 {
        let corners = piece.map(|triangle| geometry.corners(triangle)).filter(|corners| corners.iter().all(is_usable));
        usable = corners.flatten().fold(Bounds::EMPTY, Bounds::with);
    }
    let faces = normals.len() - nonfinite as usize - degenerate as usize;
    Picked { piece: Piece { faces, keys }, bounds, usable, nonfinite, degenerate }
}

/// True if f32 has these coordinates exactly.
#[inline(always)]
fn has_f32(p: [f64; 3]) -> bool {
    let is_exact = |c: f64| f64::from(c as f32) == c;
    is_exact(p[0]) & is_exact(p[1]) & is_exact(p[2])
}

/// Normals of any length and the squares of their lengths, a list for each number.
struct Block {
    n: [[f64; BLOCK]; 3],
    length2: [f64; BLOCK],
}

impl Default for Block {
    fn default() -> Self {
        Self { n: [[0.0; BLOCK]; 3], length2: [0.0; BLOCK] }
    }
}

impl Block {
    /// The normals of some triangles. One with an unusable corner gets a length of zero, or one
    /// that is not finite.
    #[inline(always)]
    fn fill<G: Geometry>(
        &mut self,
        triangles: std::ops::Range<usize>,
        geometry: &G,
        scale: impl Fn([f64; 3]) -> [f64; 3],
    ) {
        let is_sure = geometry.unusable_shows();
        for (i, triangle) in triangles.enumerate().take(BLOCK) {
            let [a, b, c] = geometry.corners(triangle);
            if is_sure || is_usable(&a) & is_usable(&b) & is_usable(&c) {
                let (a, b, c) = (scale(a), scale(b), scale(c));
                let n = cross(sub(b, a), sub(c, a));
                (self.n[0][i], self.n[1][i], self.n[2][i]) = (n[0], n[1], n[2]);
                self.length2[i] = dot(n, n);
            }
        }
    }

    /// The unit normals; NaN for unusable corners, and for tiny edges or a sliver: products may
    /// have underflowed.
    #[inline(always)]
    fn units(&self, normals: &mut [[f32; 3]]) {
        let mut unit = [[0.0_f32; BLOCK]; 3];
        for (i, length2) in self.length2.into_iter().enumerate() {
            let is_long = length2 > 1e-200 && length2 < f64::INFINITY;
            let length = if is_long { length2 } else { f64::NAN }.sqrt();
            for (unit, n) in unit.iter_mut().zip(&self.n) {
                unit[i] = (n[i] / length) as f32;
            }
        }
        for (i, normal) in normals.iter_mut().enumerate().take(BLOCK) {
            *normal = [unit[0][i], unit[1][i], unit[2][i]];
        }
    }
}

/// The unit normal of any triangle with usable corners, or none if the area is exactly zero. Good
/// for edges of any length.
#[cold]
fn sliver(corners: [[f64; 3]; 3], scale: impl Fn([f64; 3]) -> [f64; 3]) -> Option<Option<[f32; 3]>> {
    if !corners.iter().all(is_usable) {
        return None;
    }
    let [a, b, c] = corners.map(scale);
    let normal = || {
        let (e, f) = (rescale(sub(b, a))?, rescale(sub(c, a))?);
        let n = rescale(cross(e, f))?;
        let length = dot(n, n).sqrt();
        Some(n.map(|x| (x / length) as f32))
    };
    Some(normal())
}

fn rescale(v: [f64; 3]) -> Option<[f64; 3]> {
    let size = max_abs(&v);
    (size > 0.0).then(|| Pow2::new(-exponent(size)).of3(v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::normalise::geometry::Indexed;
    use crate::import::test_random::Random;

    /// Triangles of f32 corners of any size, many without an area or a finite corner.
    fn odd_triangles(random: &mut Random, exponents: u64) -> Vec<[f64; 3]> {
        let mut corner = || {
            let sign = random.below(2) << 31;
            let exponent = 127 - exponents / 2 + random.below(exponents);
            let bits = (sign | exponent << 23 | random.below(1 << 23)) as u32;
            match random.below(40) {
                0 => f64::NAN,
                1..8 => 0.0,
                8..12 => 1.0,
                _ => f64::from(f32::from_bits(bits)),
            }
        };
        (0..60_000).map(|_| std::array::from_fn(|_| corner())).collect()
    }

    #[test]
    fn scaling_changes_no_face_of_f32() {
        let mut random = Random(7);
        let triangles: Vec<[u32; 3]> = (0..20_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for exponents in [1, 20, 254] {
            let mut positions = odd_triangles(&mut random, exponents);
            // Slivers and triangles without an area.
            for corners in positions.chunks_exact_mut(3).step_by(7) {
                corners[2] = std::array::from_fn(|k| corners[0][k] * 0.5 + corners[1][k] * 0.5);
                corners[2] = corners[2].map(|c| f64::from(c as f32));
            }
            let geometry = Indexed { positions, triangles: triangles.clone(), is_usable: false };
            let pick = |down: Option<i32>| pick(&geometry, down.map(Pow2::new), &Deadline::default()).unwrap();
            let plain = pick(None);
            assert!(plain.nonfinite > 100 && plain.degenerate > 10, "{} {}", plain.nonfinite, plain.degenerate);
            let bits = |faces: &Faces<u32>| faces.normals.iter().map(|n| n.map(f32::to_bits)).collect::<Vec<_>>();
            for down in [-128, -1, 3, 100] {
                let scaled = pick(Some(down));
                assert!(bits(&plain) == bits(&scaled) && plain.kept == scaled.kept, "{exponents} {down}");
                assert_eq!((plain.bounds, plain.usable), (scaled.bounds, scaled.usable));
                assert_eq!([plain.nonfinite, plain.degenerate], [scaled.nonfinite, scaled.degenerate]);
            }
        }
    }
}
