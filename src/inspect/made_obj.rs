//! OBJ files that tests make: cubes, rings, planes, spheres and rows of triangles, whose figures, such as the area or
//! the number of holes, are known.

/// An OBJ file in the making.
#[derive(Clone, Default)]
pub struct Obj {
    pub vertices: Vec<[f64; 3]>,
    /// Polygons, whose corners are numbered from 0.
    pub faces: Vec<Vec<usize>>,
    /// Lines that follow the faces. Numbers in them are those of the file.
    pub more: String,
}

/// The corners of a cube with sides of 2.
const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// Its sides, seen from outside.
pub const SIDES: [[usize; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

impl Obj {
    /// Adds a box around a place, whose sides are twice these lengths.
    pub fn cube(self, centre: [f64; 3], size: [f64; 3]) -> Self {
        self.cube_of(centre, size, &SIDES, false)
    }

    /// The same with some sides, turned inside out if so.
    pub fn cube_of(mut self, centre: [f64; 3], size: [f64; 3], sides: &[[usize; 4]], is_inward: bool) -> Self {
        let first = self.vertices.len();
        self.vertices.extend(CORNERS.map(|corner| std::array::from_fn(|k| centre[k] + size[k] * corner[k])));
        for side in sides {
            let mut side: Vec<usize> = side.iter().map(|corner| first + corner).collect();
            if is_inward {
                side.reverse();
            }
            self.faces.push(side);
        }
        self
    }

    /// Adds a box from one corner to the opposite one, turned inside out if so.
    pub fn block(self, low: [f64; 3], high: [f64; 3], is_inward: bool) -> Self {
        let of_both = |what: fn(f64, f64) -> f64| std::array::from_fn(|k| what(low[k], high[k]));
        self.cube_of(of_both(|a, b| (a + b) / 2.0), of_both(|a, b| (b - a) / 2.0), &SIDES, is_inward)
    }

    /// A ring with a square section, of so many segments.
    pub fn ring(segments: usize, radius: f64, half: f64) -> Self {
        let mut obj = Self::default();
        for segment in 0..segments {
            let angle = std::f64::consts::TAU * segment as f64 / segments as f64;
            for [r, y] in [[radius - half, -half], [radius + half, -half], [radius + half, half], [radius - half, half]]
            {
                obj.vertices.push([r * angle.cos(), y, r * angle.sin()]);
            }
        }
        for segment in 0..segments {
            let next = (segment + 1) % segments;
            for side in 0..4 {
                let other = (side + 1) % 4;
                obj.faces.push([4 * segment + side, 4 * segment + other, 4 * next + other, 4 * next + side].into());
            }
        }
        obj
    }

    /// A flat grid of n by n squares with sides of 1 / n, from (x, y, z) on.
    pub fn plane(n: usize, [x, y, z]: [f64; 3]) -> Self {
        let at = |i: usize| i as f64 / n as f64;
        let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| [x + at(i), y + at(j), z])).collect();
        let corner = |i: usize, j: usize| j * (n + 1) + i;
        let square = |i: usize, j: usize| vec![corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        let faces = (0..n).flat_map(|j| (0..n).map(move |i| square(i, j))).collect();
        Self { vertices, faces, more: String::new() }
    }

    /// A sphere of triangles, closed.
    pub fn sphere(rings: usize, radius: f64) -> Self {
        let (around, mut obj) = (2 * rings, Self::default());
        for ring in 0..=rings {
            let polar = std::f64::consts::PI * ring as f64 / rings as f64;
            // The last ring is one point, as the first.
            let is_pole = ring == rings;
            for step in 0..around {
                let turn = std::f64::consts::TAU * step as f64 / around as f64;
                let [s, c] = if is_pole { [0.0, -1.0] } else { [polar.sin(), polar.cos()] };
                obj.vertices.push([radius * s * turn.cos(), radius * s * turn.sin(), radius * c]);
            }
        }
        for ring in 0..rings {
            for step in 0..around {
                let at = |ring: usize, step: usize| ring * around + step % around;
                let [a, b, c, d] = [at(ring, step), at(ring + 1, step), at(ring + 1, step + 1), at(ring, step + 1)];
                obj.faces.extend([vec![a, b, c], vec![a, c, d]]);
            }
        }
        obj
    }

    /// A row of triangles apart from each other.
    pub fn row(count: usize) -> Self {
        let mut obj = Self::default();
        for i in 0..count {
            obj.vertices.extend([[i as f64, 0.0, 0.0], [i as f64, 1.0, 0.0], [i as f64, 0.0, 1.0]]);
            obj.faces.push([0, 1, 2].map(|corner| 3 * i + corner).to_vec());
        }
        obj
    }

    /// The same faces, with all vertices and faces in another order, and each face from another corner on.
    pub fn shuffled(&self) -> Self {
        let n = self.vertices.len();
        let faces = self.faces.iter().rev().map(|face| {
            let mut face: Vec<usize> = face.iter().map(|v| n - 1 - v).collect();
            // Quadrilaterals keep the diagonal by which they are divided.
            face.rotate_left(if self.faces[0].len() == 4 { 2 } else { 1 });
            face
        });
        Self { vertices: self.vertices.iter().rev().copied().collect(), faces: faces.collect(), more: String::new() }
    }

    /// With lines after the faces.
    pub fn and(mut self, lines: &str) -> Self {
        self.more += lines;
        self
    }

    pub fn without_face(mut self, face: usize) -> Self {
        self.faces.remove(face);
        self
    }

    pub fn map(mut self, each: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        self.vertices.iter_mut().for_each(|vertex| *vertex = each(*vertex));
        self
    }

    pub fn turned_about_x(self, degrees: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        self.map(|[x, y, z]| [x, cos * y - sin * z, sin * y + cos * z])
    }

    /// The file.
    pub fn text(&self) -> String {
        let vertices = self.vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let face = |face: &Vec<usize>| face.iter().map(|v| format!(" {}", v + 1)).collect::<String>();
        let faces = self.faces.iter().map(|corners| format!("f{}\n", face(corners)));
        vertices.chain(faces).chain([self.more.clone()]).collect()
    }
}
