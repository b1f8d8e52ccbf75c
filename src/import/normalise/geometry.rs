//! The part of a raw mesh that normalisation reads: triangles, and the positions of their corners
//! in f64.

use crate::import::raw::Soup;

/// Triangles and positions, wherever they are stored.
pub trait Geometry: Sync {
    /// Number of triangles.
    fn triangles(&self) -> usize;
    /// Number of vertices.
    fn vertices(&self) -> usize;
    /// The vertices of a triangle.
    fn triangle(&self, triangle: usize) -> [u32; 3];
    /// The position of a vertex, in the file's units.
    fn position(&self, vertex: u32) -> [f64; 3];

    /// The corners of a triangle.
    #[inline(always)]
    fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        let [a, b, c] = self.triangle(triangle);
        [self.position(a), self.position(b), self.position(c)]
    }
}

/// Triangles that are indices of positions.
pub struct Indexed<'a> {
    /// The positions.
    pub positions: &'a [[f64; 3]],
    /// The triangles.
    pub triangles: &'a [[u32; 3]],
}

impl Geometry for Indexed<'_> {
    fn triangles(&self) -> usize {
        self.triangles.len()
    }

    fn vertices(&self) -> usize {
        self.positions.len()
    }

    #[inline(always)]
    fn triangle(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle]
    }

    #[inline(always)]
    fn position(&self, vertex: u32) -> [f64; 3] {
        self.positions[vertex as usize]
    }
}

impl Geometry for Soup {
    fn triangles(&self) -> usize {
        Soup::triangles(self)
    }

    fn vertices(&self) -> usize {
        Soup::triangles(self) * 3
    }

    #[inline(always)]
    fn triangle(&self, triangle: usize) -> [u32; 3] {
        let first = triangle as u32 * 3;
        [first, first + 1, first + 2]
    }

    #[inline(always)]
    fn position(&self, vertex: u32) -> [f64; 3] {
        self.corner(vertex as usize / 3, vertex as usize % 3)
    }
}
