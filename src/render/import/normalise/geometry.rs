//! The trait `Geometry`, through which normalisation reads the triangles of an imported mesh. It is
//! the same for the two ways in which importers deliver them: as indices of vertices, or as
//! positions that are left where they lie in the file (binary STL).

use crate::import::raw::Soup;

/// Triangles and positions, wherever they are stored.
pub trait Geometry: Sync {
    /// The identity of a corner: corners with equal keys have equal positions.
    type Key: Key;

    /// Number of triangles.
    fn triangles(&self) -> usize;
    /// The keys of a triangle's corners.
    fn keys(&self, triangle: usize) -> [Self::Key; 3];
    /// The position of a corner, in the file's units.
    fn position(&self, key: Self::Key) -> [f64; 3];
    /// The vertices and triangles that keys are indices of, or none where keys are positions.
    fn indexed(&mut self) -> Option<&mut Indexed>;

    /// True if no scaled triangle with an unusable corner has a normal of finite length.
    fn unusable_shows(&self) -> bool;

    /// The corners of a triangle.
    #[inline(always)]
    fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        let [a, b, c] = self.keys(triangle);
        [self.position(a), self.position(b), self.position(c)]
    }
}

/// The identity of a corner.
pub trait Key: Copy + Eq + Send + Sync {
    /// True if keys are indices.
    const IS_INDEX: bool;
    /// The index, if keys are.
    fn index(self) -> u32;
    /// Three words that equal keys, and they alone, have in common.
    fn words(self) -> [u32; 3];
}

impl Key for u32 {
    const IS_INDEX: bool = true;

    #[inline(always)]
    fn index(self) -> u32 {
        self
    }

    #[inline(always)]
    fn words(self) -> [u32; 3] {
        [self, 0, 0]
    }
}

/// The bits of a position.
impl Key for [u32; 3] {
    const IS_INDEX: bool = false;

    #[inline(always)]
    fn index(self) -> u32 {
        0
    }

    #[inline(always)]
    fn words(self) -> [u32; 3] {
        self
    }
}

/// Triangles that are indices of positions.
pub struct Indexed {
    /// The positions.
    pub positions: Vec<[f64; 3]>,
    /// The triangles.
    pub triangles: Vec<[u32; 3]>,
    /// True if all positions are usable.
    pub is_usable: bool,
}

impl Geometry for Indexed {
    type Key = u32;

    fn triangles(&self) -> usize {
        self.triangles.len()
    }

    #[inline(always)]
    fn keys(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle]
    }

    #[inline(always)]
    fn position(&self, vertex: u32) -> [f64; 3] {
        self.positions[vertex as usize]
    }

    fn indexed(&mut self) -> Option<&mut Indexed> {
        Some(self)
    }

    fn unusable_shows(&self) -> bool {
        self.is_usable
    }
}

impl Geometry for Soup {
    type Key = [u32; 3];

    fn triangles(&self) -> usize {
        Soup::triangles(self)
    }

    #[inline(always)]
    fn keys(&self, triangle: usize) -> [[u32; 3]; 3] {
        Soup::corners(self, triangle)
    }

    #[inline(always)]
    fn position(&self, [x, y, z]: [u32; 3]) -> [f64; 3] {
        [f64::from(f32::from_bits(x)), f64::from(f32::from_bits(y)), f64::from(f32::from_bits(z))]
    }

    fn indexed(&mut self) -> Option<&mut Indexed> {
        None
    }

    /// A normal of finite f32 has a finite length in f64. An infinite or NaN coordinate makes all
    /// or two of a normal's so, because the products of its differences do not cancel out.
    fn unusable_shows(&self) -> bool {
        true
    }
}
