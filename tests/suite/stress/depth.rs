//! Of two surfaces a millionth of their distance apart the nearer one is seen, from a millimetre to
//! a million kilometres.

use glam::{DVec2, DVec3};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, Projection};
use meshsnap_render::scene::camera::Camera;
use meshsnap_render::spec;

use crate::oracle::obj::Shape;
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{cases, renderers};

/// 2^-20
const SEPARATION: f64 = 1.0 / 1_048_576.0;
const NEAREST: f64 = 1e-3;
const FARTHEST: f64 = 1e9;

const SIZE_PX: u32 = 100;

/// Eye at the origin, looking along -z, the half picture 1.25 wide at distance 1; all distances in
/// one range.
fn projection() -> Projection {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let camera = Camera {
        axes,
        center: DVec2::ZERO,
        distance: 0.0,
        half_size: DVec2::splat(1.25),
        kind: spec::ProjectionKind::Perspective,
        near: 0.5 * NEAREST,
        far: 2.0 * FARTHEST,
        contains_mesh: true,
        reach: DVec2::INFINITY,
    };
    let [x, y, z, w] = camera.rows([SIZE_PX; 2]);
    Projection {
        x,
        y,
        z,
        w,
        near_w: camera.near as f32,
        ..scenes::screen_plan([SIZE_PX; 2], 1, 1.0, &[], &[]).projection
    }
}

fn any_distance(random: &mut Random) -> f64 {
    (random.range(NEAREST.ln(), FARTHEST.ln())).exp()
}

/// In every pixel two triangles, one behind the other; the ids of those in front.
struct Pairs {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    nearer: Vec<u32>,
}

impl Pairs {
    fn new(random: &mut Random) -> Self {
        let mut pairs = Self { positions: Vec::new(), triangles: Vec::new(), nearer: Vec::new() };
        for pixel in 0..SIZE_PX * SIZE_PX {
            let near = f64::from(any_distance(random) as f32);
            let is_first = random.next().is_multiple_of(2);
            pairs.nearer.push(2 * pixel + u32::from(!is_first));
            let far = near * (1.0 + SEPARATION);
            for distance in if is_first { [near, far] } else { [far, near] } {
                pairs.add(pixel, distance);
            }
        }
        pairs
    }

    /// Around the middle of a pixel and in no other.
    fn add(&mut self, pixel: u32, distance: f64) {
        let first = self.positions.len() as u32;
        let half = 0.5 * f64::from(SIZE_PX);
        let at = [pixel % SIZE_PX, pixel / SIZE_PX].map(|v| f64::from(v) + 0.5 - half);
        for [dx, dy] in [[-0.4, 0.4], [0.4, 0.4], [0.0, -0.4]] {
            let slope = 1.25 / half * distance;
            self.positions.push([(at[0] + dx) * slope, -(at[1] + dy) * slope, -distance].map(|v| v as f32));
        }
        self.triangles.push([first, first + 1, first + 2]);
    }
}

#[test]
fn the_nearer_of_a_million_pairs_is_seen() {
    let mut random = Random(51);
    let (mut seen, mut wanted) = (0, 0);
    for mut renderer in renderers() {
        let pictures = if renderer.kind().name() == "cpu" { cases(1, 100) } else { cases(1, 10) };
        for _ in 0..pictures {
            let pairs = Pairs::new(&mut random);
            let plan = scenes::screen_plan([SIZE_PX; 2], 1, 1.0, &pairs.positions, &pairs.triangles);
            let plan = DrawPlan { projection: projection(), ..plan };
            let words = renderer.draw_visibility(&plan, &Deadline::default()).unwrap();
            for (pixel, (&word, &nearer)) in words.iter().zip(&pairs.nearer).enumerate() {
                let distance = -pairs.positions[nearer as usize * 3][2];
                assert_ne!(word, 0, "pixel {pixel}: nothing at {distance}");
                assert_eq!(!(word as u32), nearer, "pixel {pixel}: the farther one is seen at {distance}");
                seen += 1;
            }
        }
        wanted += pictures * 10_000;
    }
    println!("- depth: no inversion in {seen} pairs from {NEAREST} to {FARTHEST}");
    assert_eq!(seen, wanted);
}

/// The whole way from a file: two sheets as large as the picture, their distance a millionth of the
/// eye's.
#[test]
fn the_nearer_of_two_sheets_is_seen_in_every_sample() {
    let mut random = Random(52);
    let (mut pictures, mut samples) = (0, 0);
    let (count, mut renderers) = (cases(40, 1000), renderers());
    for i in 0..count {
        let distance = any_distance(&mut random);
        let depth = |j: usize| if (j < 5) == (i % 2 == 0) { -SEPARATION * distance } else { 0.0 };
        let sheet = Shape::net([4, 9], |i, j| {
            [0.3 * distance * (i as f64 - 2.0), 0.3 * distance * ((j % 5) as f64 - 2.0), depth(j)]
        });
        // Not the quads between the sheets.
        let polygons: Vec<Vec<usize>> =
            sheet.polygons.chunks(4).enumerate().filter(|(j, _)| *j != 4).flat_map(|(_, row)| row.to_vec()).collect();
        let mesh = scenes::mesh(&Shape { polygons, ..sheet }.text());
        let is_nearer = |id: u32| (id < 32) != (i % 2 == 0);
        let eye = format!("0,0,{distance}");
        let keys = [("style", "flat"), ("size", "64"), ("camera.eye", &eye), ("camera.target", "0,0,0")];
        let plan = scenes::plan(&mesh, &scenes::spec(&keys));
        assert_eq!(plan.triangles.len(), 64);
        for renderer in &mut renderers {
            for word in renderer.draw_visibility(&plan, &Deadline::default()).unwrap() {
                assert!(word != 0 && is_nearer(!(word as u32)), "at {distance}: triangle {}", !(word as u32));
                samples += 1;
            }
            pictures += 1;
        }
    }
    assert_eq!((pictures, samples), (count * renderers.len(), count * renderers.len() * 64 * 64 * 4));
}
