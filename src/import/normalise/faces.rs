//! The faces of a raw mesh: its triangles with finite corners and an area.

use super::geometry::Geometry;
use super::pow2::{Pow2, exponent, is_usable, max_abs};
use crate::import::parallel::map;
use crate::limits::{Deadline, Stopped};
use crate::mesh::vector::{cross, dot, sub};
use std::ops::Range;

/// Triangles handed to a thread at a time.
const TRIANGLES_PER_PIECE: usize = 16_384;

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

    /// The largest magnitude of a coordinate; infinite without a position.
    pub fn largest(&self) -> f64 {
        max_abs(&self.low).max(max_abs(&self.high))
    }
}

/// The box around the triangles whose corners are all usable, and true if f32 has all of their
/// coordinates exactly.
pub fn survey<G: Geometry>(geometry: &G, deadline: &Deadline) -> Result<(Bounds, bool), Stopped> {
    let pieces = map(pieces(geometry.triangles()), |piece| {
        deadline.check()?;
        let (mut bounds, mut is_f32) = (Bounds::EMPTY, true);
        for triangle in piece {
            let [a, b, c] = geometry.corners(triangle);
            if is_usable(&a) & is_usable(&b) & is_usable(&c) {
                bounds = bounds.with(a).with(b).with(c);
                is_f32 &= has_f32(a) & has_f32(b) & has_f32(c);
            }
        }
        Ok((bounds, is_f32))
    });
    let mut all = (Bounds::EMPTY, true);
    for piece in pieces {
        let (bounds, is_f32) = piece?;
        all = (all.0.union(bounds), all.1 & is_f32);
    }
    Ok(all)
}

/// The faces of a mesh.
#[derive(Debug)]
pub struct Faces {
    /// A unit normal for each.
    pub normals: Vec<[f32; 3]>,
    /// The triangle of each; None if all triangles are faces.
    pub kept: Option<Vec<u32>>,
    /// The box around them, scaled.
    pub bounds: Bounds,
    /// Triangles with a corner that is NaN or infinite.
    pub nonfinite: u64,
    /// Triangles without an area.
    pub degenerate: u64,
}

impl Faces {
    /// The triangle of a face.
    #[inline]
    pub fn triangle(&self, face: usize) -> usize {
        self.kept.as_ref().map_or(face, |kept| kept[face] as usize)
    }
}

/// Picks the faces; `down` brings their positions to about 1, so that no relevant product over- or
/// underflows.
pub fn pick<G: Geometry>(geometry: &G, down: Pow2, deadline: &Deadline) -> Result<Faces, Stopped> {
    let mut normals = vec![[0.0_f32; 3]; geometry.triangles()];
    let places = pieces(geometry.triangles()).into_iter().zip(normals.chunks_mut(TRIANGLES_PER_PIECE)).collect();
    let done = map(places, |(piece, normals)| {
        deadline.check()?;
        let (mut bounds, mut nonfinite, mut degenerate) = (Bounds::EMPTY, 0, 0);
        for (triangle, place) in piece.zip(normals) {
            let [a, b, c] = geometry.corners(triangle);
            // NaN marks a triangle that is no face.
            *place = [f32::NAN; 3];
            if !(is_usable(&a) & is_usable(&b) & is_usable(&c)) {
                nonfinite += 1;
                continue;
            }
            let (a, b, c) = (down.of3(a), down.of3(b), down.of3(c));
            match face_normal(a, b, c) {
                Some([x, y, z]) => {
                    *place = [x as f32, y as f32, z as f32];
                    bounds = bounds.with(a).with(b).with(c);
                }
                None => degenerate += 1,
            }
        }
        Ok((bounds, nonfinite, degenerate))
    });
    let mut faces = Faces { normals: Vec::new(), kept: None, bounds: Bounds::EMPTY, nonfinite: 0, degenerate: 0 };
    for piece in done {
        let (bounds, nonfinite, degenerate) = piece?;
        faces.bounds = faces.bounds.union(bounds);
        faces.nonfinite += nonfinite;
        faces.degenerate += degenerate;
    }
    if faces.nonfinite + faces.degenerate > 0 {
        let is_face = |normal: &[f32; 3]| !normal[0].is_nan();
        let kept = (0..).zip(&normals).filter(|(_, normal)| is_face(normal)).map(|(triangle, _)| triangle);
        faces.kept = Some(kept.collect());
        normals.retain(is_face);
    }
    faces.normals = normals;
    Ok(faces)
}

/// True if f32 has these coordinates exactly.
#[inline(always)]
fn has_f32(p: [f64; 3]) -> bool {
    let is_exact = |c: f64| f64::from(c as f32) == c;
    is_exact(p[0]) & is_exact(p[1]) & is_exact(p[2])
}

fn pieces(triangles: usize) -> Vec<Range<usize>> {
    let begins = (0..triangles).step_by(TRIANGLES_PER_PIECE);
    begins.map(|begin| begin..(begin + TRIANGLES_PER_PIECE).min(triangles)).collect()
}

/// The unit normal, or none if the area is exactly zero. Good for edges of any length.
#[inline(always)]
fn face_normal(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> Option<[f64; 3]> {
    let (e, f) = (sub(b, a), sub(c, a));
    let n = cross(e, f);
    let length2 = dot(n, n);
    if length2 > 1e-200 {
        let length = length2.sqrt();
        return Some([n[0] / length, n[1] / length, n[2] / length]);
    }
    sliver_normal(e, f)
}

/// As [`face_normal`], for tiny edges or a sliver: products may have underflowed.
#[cold]
fn sliver_normal(e: [f64; 3], f: [f64; 3]) -> Option<[f64; 3]> {
    let (e, f) = (rescale(e)?, rescale(f)?);
    let n = rescale(cross(e, f))?;
    let length = dot(n, n).sqrt();
    Some(n.map(|x| x / length))
}

fn rescale(v: [f64; 3]) -> Option<[f64; 3]> {
    let size = max_abs(&v);
    (size > 0.0).then(|| Pow2::new(-exponent(size)).of3(v))
}
