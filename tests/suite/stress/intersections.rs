//! Self-intersections and T-junctions of small meshes of every kind, against exact clipping of all pairs
//! (`tests/oracle/contacts.rs`).

use meshsnap_inspect::geometry::intersections::{self_intersections, t_junctions};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;

use crate::oracle::contacts::{self, Point};

/// Pseudo-random numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, n: i64) -> i64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % n as u64) as i64
    }

    /// From `-n` to `n`.
    fn around(&mut self, n: i64) -> i64 {
        self.below(2 * n + 1) - n
    }
}

/// Distinct vertices, and triangles of three different ones.
#[derive(Default)]
struct Small {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

impl Small {
    fn vertex(&mut self, at: Point) -> u32 {
        let known = self.vertices.iter().position(|known| *known == at);
        known.unwrap_or_else(|| {
            self.vertices.push(at);
            self.vertices.len() - 1
        }) as u32
    }

    fn triangle(&mut self, corners: [Point; 3]) {
        let triangle = corners.map(|at| self.vertex(at));
        if triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0] {
            self.triangles.push(triangle);
        }
    }

    fn corners(&self, face: usize) -> [Point; 3] {
        self.triangles[face].map(|v| self.vertices[v as usize])
    }
}

/// A mesh of one of ten kinds.
fn small(kind: u64, random: &mut Random) -> Small {
    let mut mesh = Small::default();
    let count = 4 + random.below(9);
    match kind {
        // Triangles anywhere: on a coarse grid, on a fine one, small ones.
        0..=2 => {
            let (reach, size) = [(3, 3), (8, 8), (13, 3)][kind as usize];
            for _ in 0..count {
                let at: Point = std::array::from_fn(|_| random.around(reach));
                mesh.triangle(std::array::from_fn(|_| at.map(|c| (c + random.around(size)).clamp(-16, 16))));
            }
        }
        // Triangles of few vertices, so that most have corners in common.
        3 => {
            let pool: Vec<Point> = (0..7).map(|_| std::array::from_fn(|_| random.around(5))).collect();
            for _ in 0..count {
                mesh.triangle(std::array::from_fn(|_| pool[random.below(7) as usize]));
            }
        }
        // In a plane along two axes, and in an oblique one.
        4 | 5 => {
            for _ in 0..count {
                mesh.triangle(std::array::from_fn(|_| {
                    let (u, v) = (random.around(4), random.around(4));
                    if kind == 4 { [u, 3, v] } else { [u, v, u + v] }
                }));
            }
        }
        // A rolling grid, which intersects nothing; and one with a triangle through it.
        6 | 7 => {
            let heights: Vec<i64> = (0..16).map(|_| random.around(2)).collect();
            let at = |x: i64, y: i64| [4 * x - 6, 4 * y - 6, heights[(4 * y + x) as usize]];
            for (x, y) in (0..3).flat_map(|y| (0..3).map(move |x| (x, y))) {
                mesh.triangle([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
                mesh.triangle([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
            }
            if kind == 7 {
                mesh.triangle(std::array::from_fn(|_| std::array::from_fn(|_| random.around(6))));
            }
        }
        // Boxes that are apart, touch or overlap.
        8 => {
            for _ in 0..2 {
                let (low, size): (Point, i64) = (std::array::from_fn(|_| random.around(3)), 1 + random.below(4));
                let at = |i: usize| std::array::from_fn(|k| low[k] + size * (i >> k & 1) as i64);
                for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
                {
                    mesh.triangle([at(a), at(b), at(c)]);
                    mesh.triangle([at(a), at(c), at(d)]);
                }
            }
        }
        // A fan, whose blades all have a corner in common.
        _ => {
            for _ in 0..count {
                let [a, b]: [Point; 2] = std::array::from_fn(|_| std::array::from_fn(|_| random.around(3)));
                mesh.triangle([[0; 3], a, b]);
            }
        }
    }
    mesh
}

/// The mesh with coordinates that f32 has exactly: moved far from the origin, or flattened by powers of
/// two, which changes no contact.
fn in_f32(small: &Small, is_moved: bool, scale: [i32; 3]) -> Mesh {
    let coordinate = |c: i64, k: usize| {
        let whole = if is_moved { c as f32 / 1_048_576.0 + 0.375 } else { c as f32 / 32.0 };
        whole * 2.0_f32.powi(scale[k])
    };
    let positions = small.vertices.iter().map(|at| std::array::from_fn(|k| coordinate(at[k], k))).collect();
    Mesh { positions, triangles: small.triangles.clone(), ..Mesh::default() }
}

#[test]
fn a_thousand_meshes_agree_with_exact_clipping_of_all_pairs() {
    let mut random = Random(5);
    let (budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let (mut meeting, mut apart, mut junctions) = ([0; 10], [0; 10], 0);
    for i in 0..1000_u64 {
        let kind = i % 10;
        let small = small(kind, &mut random);
        let scale = [[0; 3], [-3, 0, -60], [-100, -20, 0]][(i / 10 % 3) as usize];
        let mesh = in_f32(&small, i / 30 % 2 == 0, scale);

        let faces = 0..small.triangles.len();
        let meets = |&face: &usize| {
            faces.clone().any(|other| face != other && contacts::intersect(small.corners(face), small.corners(other)))
        };
        let expected: Vec<u32> = faces.clone().filter(meets).map(|face| face as u32).collect();
        let found = self_intersections(&mesh, &budget, &deadline).unwrap().unwrap();
        assert_eq!(found, expected, "mesh {i}: {:?} {:?}", small.vertices, small.triangles);
        meeting[kind as usize] += found.len();
        apart[kind as usize] += faces.len() - found.len();

        let with_area = |face: &usize| contacts::has_area(small.corners(*face));
        let edges = faces.filter(with_area).flat_map(|face| {
            let [a, b, c] = small.corners(face);
            [[a, b], [b, c], [c, a]]
        });
        let edges: Vec<[Point; 2]> = edges.collect();
        let is_corner = |v: usize| small.triangles.iter().flatten().any(|corner| *corner as usize == v);
        let is_junction =
            |&v: &usize| is_corner(v) && edges.iter().any(|edge| contacts::is_within(small.vertices[v], *edge));
        let expected = (0..small.vertices.len()).filter(is_junction).count() as u64;
        assert_eq!(t_junctions(&mesh, &budget, &deadline).unwrap(), Some(expected), "mesh {i}");
        junctions += expected;
    }
    // Each kind has what it is for.
    assert_eq!(meeting[6], 0);
    assert!(meeting.iter().enumerate().all(|(kind, count)| kind == 6 || *count > 10), "{meeting:?}");
    assert!(apart.iter().all(|count| *count > 30), "{apart:?}");
    assert!(junctions > 300, "{junctions}");
}
