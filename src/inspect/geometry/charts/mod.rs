//! UV charts: the pieces into which a texture unfolds a surface, how much each stretches the texture,
//! and how much faces overlap.
//!
//! A chart is a set of faces that are connected by edges along which both faces have the same texture
//! coordinates. Faces without area in the texture are in none. Coordinates are taken as they are: two
//! faces that meet only because the texture repeats do not overlap.

mod cover;
mod overlaps;
#[cfg(test)]
mod tests;

pub use overlaps::{Overlaps, overlaps};

use meshsnap_render::limits::{Budget, Deadline, Exhausted};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::union_find::UnionFind;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Texture coordinates.
type Uv = [f64; 2];

/// Memory per face: three numbered corners and three edges that are sorted, its set, its chart, and a
/// chart if each were one of its own.
const BYTES_PER_FACE: u64 = 3 * (16 + 4) + 3 * 12 + 4 + 4 + size_of::<Chart>() as u64;

/// Faces between two looks at the deadline.
const FACES_PER_POLL: usize = 1 << 16;

/// The charts of a mesh.
#[derive(Clone, Debug, Default)]
pub struct Charts {
    /// In the order of their first faces.
    pub all: Vec<Chart>,
    /// Faces without an area in the texture. They belong to no chart.
    pub faces_without_area: u64,
}

/// A chart, or several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chart {
    /// Its faces.
    pub faces: u64,
    /// Those of them that are turned over in the texture: they show its mirror image.
    pub flipped: u64,
    /// The sum of its faces' areas in the texture, which is 1.
    pub texture_area: f64,
    /// The area of its faces in the unit box.
    pub surface_area: f64,
    /// The integral of the squared L2 stretch over the surface.
    squares: f64,
    /// The largest singular value of the map from the texture to the surface.
    largest: f64,
}

/// The stretch of a texture on a surface: lengths on the surface over lengths in the texture, by Sander,
/// Snyder, Gortler and Hoppe, "Texture mapping progressive meshes", 2001. It is scaled so that 1 is the
/// least that is possible: the texture's area over the surface's is the same everywhere, and so in
/// all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The root mean square over all directions and the surface.
    pub l2: f64,
    /// The largest anywhere in any direction.
    pub linf: f64,
}

impl Charts {
    /// The charts of a mesh; none without texture coordinates.
    pub fn of(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Self, Exhausted> {
        if mesh.uvs.is_empty() {
            return Ok(Self::default());
        }
        let mut budget = budget.clone();
        budget.spend("the charts of the texture", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
        let corners = numbered_corners(mesh);
        deadline.check()?;
        let mut sets = UnionFind::new(mesh.triangles.len());
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * corners.len());
        let faces = (0_u32..).zip(&corners).filter(|&(face, _)| twice_area(uvs(mesh, face)) != 0.0);
        for (face, [a, b, c]) in faces {
            edges.extend([[*a, *b], [*b, *c], [*c, *a]].map(|[p, q]| ([p.min(q), p.max(q)], face)));
        }
        deadline.check()?;
        edges.sort_unstable();
        deadline.check()?;
        for pair in edges.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            sets.unite(pair[0].1, pair[1].1);
        }
        drop(edges);
        Self::by_set(mesh, &mut sets, deadline)
    }

    /// All charts as one.
    pub fn whole(&self) -> Chart {
        self.all.iter().fold(Chart::default(), |mut whole, chart| {
            whole.faces += chart.faces;
            whole.flipped += chart.flipped;
            whole.texture_area += chart.texture_area;
            whole.surface_area += chart.surface_area;
            whole.squares += chart.squares;
            whole.largest = whole.largest.max(chart.largest);
            whole
        })
    }

    fn by_set(mesh: &Mesh, sets: &mut UnionFind, deadline: &Deadline) -> Result<Self, Exhausted> {
        const NONE: u32 = u32::MAX;
        let mut numbers = vec![NONE; mesh.triangles.len()];
        let mut charts = Self::default();
        for face in 0..mesh.triangles.len() as u32 {
            if (face as usize).is_multiple_of(FACES_PER_POLL) {
                deadline.check()?;
            }
            let in_texture = uvs(mesh, face);
            if twice_area(in_texture) == 0.0 {
                charts.faces_without_area += 1;
                continue;
            }
            let number = &mut numbers[sets.find(face) as usize];
            if *number == NONE {
                *number = charts.all.len() as u32;
                charts.all.push(Chart::default());
            }
            let corners = mesh.triangles[face as usize].map(|v| mesh.positions[v as usize].map(f64::from));
            charts.all[*number as usize].add(corners, in_texture);
        }
        Ok(charts)
    }
}

impl Chart {
    /// Its stretch; none if it has no area on the surface, or numbers beyond f64.
    pub fn stretch(&self) -> Option<Stretch> {
        let Self { texture_area, surface_area, squares, largest, .. } = *self;
        let scale = (texture_area / surface_area).sqrt();
        let (l2, linf) = ((squares / surface_area).sqrt() * scale, largest * scale);
        (l2.is_finite() && linf.is_finite()).then_some(Stretch { l2, linf })
    }

    fn add(&mut self, corners: [[f64; 3]; 3], in_texture: [Uv; 3]) {
        let twice = twice_area(in_texture);
        let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let area = dot(normal, normal).sqrt() / 2.0;
        let [along_u, along_v] = derivatives(corners, in_texture, twice);
        let (a, b, c) = (dot(along_u, along_u), dot(along_u, along_v), dot(along_v, along_v));
        self.faces += 1;
        // v runs down, and so a face that is not turned over runs the other way round.
        self.flipped += u64::from(twice > 0.0);
        self.texture_area += twice.abs() / 2.0;
        self.surface_area += area;
        self.squares += area * (a + c) / 2.0;
        self.largest = self.largest.max((((a + c) + ((a - c) * (a - c) + 4.0 * b * b).sqrt()) / 2.0).sqrt());
    }
}

/// The derivatives of the map from the texture to the surface, by u and by v.
fn derivatives([q1, q2, q3]: [[f64; 3]; 3], [t1, t2, t3]: [Uv; 3], twice: f64) -> [[f64; 3]; 2] {
    let sum = |w1: f64, w2: f64, w3: f64| -> [f64; 3] {
        std::array::from_fn(|k| ((q1[k] * w1 + q2[k] * w2) + q3[k] * w3) / twice)
    };
    [sum(t2[1] - t3[1], t3[1] - t1[1], t1[1] - t2[1]), sum(t3[0] - t2[0], t1[0] - t3[0], t2[0] - t1[0])]
}

/// By face, its corners under numbers that are equal where both the vertex and its texture coordinates are.
fn numbered_corners(mesh: &Mesh) -> Vec<[u32; 3]> {
    let all = mesh.triangles.iter().zip(&mesh.attribute_triangles);
    let key = |vertex: u32, attribute: u32| {
        // Zero has two signs.
        let [u, v] = mesh.uvs[attribute as usize].map(|c| (c + 0.0).to_bits());
        [vertex, u, v]
    };
    let keys = all.flat_map(|(t, a)| (0..3).map(move |k| key(t[k], a[k])));
    let mut keyed: Vec<([u32; 3], u32)> = keys.zip(0..).collect();
    keyed.sort_unstable();
    let mut corners = vec![[0; 3]; mesh.triangles.len()];
    let (mut number, mut last) = (0, None);
    for (key, corner) in keyed {
        if last.is_some_and(|last| last != key) {
            number += 1;
        }
        last = Some(key);
        corners[corner as usize / 3][corner as usize % 3] = number;
    }
    corners
}

/// The corners of a face in the texture.
fn uvs(mesh: &Mesh, face: u32) -> [Uv; 3] {
    mesh.attribute_triangles[face as usize].map(|v| mesh.uvs[v as usize].map(f64::from))
}

/// Twice the area, by its sign; 0 for coordinates that are not finite.
fn twice_area([a, b, c]: [Uv; 3]) -> f64 {
    let twice = orientation(a, b, c);
    if twice.is_finite() { twice } else { 0.0 }
}

/// The sign is exact: which side of the line from `a` to `b` has `c`.
fn orientation(a: Uv, b: Uv, c: Uv) -> f64 {
    let [a, b, c] = [a, b, c].map(|[x, y]| robust::Coord { x, y });
    robust::orient2d(a, b, c)
}
