//! Triangles and lines that reach behind the eye are where they should be.

use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, sample_offsets};

use crate::accuracy::wires::{SIZE_PX, line_plan, segment_ink};
use crate::oracle::vector::{V2, V3, cross, dot};
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{Errors, Gate, cases, drawn_ink, goal, renderers, scene, segments};

/// Goal 4, pixels, for ten thousand triangles.
const BEHIND_EYE_GOAL_PX: f64 = 0.01;
/// Of a hundred thousand triangles, how many samples may be farther off, and how far: f32 rounds a
/// corner that is 100 units behind an eye whose near plane is 0.001 units away, and what is seen of
/// its edges is a hundred thousand times nearer.
const FARTHER: (usize, f64) = (5, 0.03);
/// Lines, measured now: their ends in the picture are what is wrong. 0.01 px are 2.55/255 on a
/// line's border.
const LINES_NOW: Gate = Gate { rmse: 0.71, max: 51.0, ink: 0.005 };

/// From the origin along +z, 40 px at distance 1 across.
pub fn eye_plan<'a>(size: [u32; 2], positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]], near: f32) -> DrawPlan<'a> {
    let mut plan = scenes::screen_plan(size, 4, 1.0, positions, triangles);
    plan.projection.x = [40.0 * 256.0, 0.0, 0.0, 0.0];
    plan.projection.y = [0.0, 40.0 * 256.0, 0.0, 0.0];
    plan.projection.z = [0.0, 0.0, 0.0, near];
    plan.projection.w = [0.0, 0.0, 1.0, 0.0];
    plan.projection.near_w = near;
    plan.projection.clip = true;
    plan
}

#[test]
fn triangles_with_corners_behind_the_eye_are_where_they_should_be() {
    let mut random = Random(14);
    let (mut worst, mut seen, mut wrong) = (0.0_f64, 0, 0);
    let (mut drawn, count) = (0, cases(10_000, 100_000));
    for mut renderer in renderers() {
        let count = if renderer.kind().name() == "cpu" { count } else { count / 30 };
        for i in 0..count {
            let near = [0.001, 0.05, 0.3][i % 3];
            let behind = 1 + i / 3 % 2;
            let reach = [1.0, 4.0, 100.0][i / 6 % 3];
            let positions: Vec<[f32; 3]> = (0..3)
                .map(|k| {
                    let z = if k < behind { random.range(-reach, 0.0) } else { random.range(0.0, reach) };
                    [random.range(-reach, reach) as f32, random.range(-reach, reach) as f32, z as f32]
                })
                .collect();
            let triangles = [[0, 1, 2]];
            let plan = eye_plan([64, 48], &positions, &triangles, near as f32);
            let words = renderer.draw_visibility(&plan, &Deadline::default()).unwrap();
            let Some(region) = Region::new(&plan) else { continue };
            for (sample, word) in words.iter().enumerate() {
                let depth = f32::from_bits((word >> 32) as u32);
                assert!(*word == 0 || depth.is_finite(), "triangle {i}: depth {depth}");
                let error = region.error_px(sample_position(&plan, sample), *word != 0);
                wrong += usize::from(error > BEHIND_EYE_GOAL_PX);
                worst = worst.max(error);
                seen += usize::from(*word != 0);
            }
            drawn += 1;
        }
    }
    goal(4, &format!("farthest wrong sample {worst:.4} px of {drawn} triangles, {wrong} too far, no NaN"));
    assert!(drawn > cases(9_900, 99_000) && seen > 1_000_000, "{drawn} drawn, {seen} samples seen");
    let (farther, most_px) = cases((0, BEHIND_EYE_GOAL_PX), FARTHER);
    assert!(wrong <= farther && worst <= most_px, "{worst} px, {wrong} beyond {BEHIND_EYE_GOAL_PX} px");
}

fn sample_position(plan: &DrawPlan<'_>, sample: usize) -> V2 {
    let (pixel, offset) = (sample / 4, sample_offsets(4)[sample % 4]);
    let corner = [pixel % plan.width_px as usize, pixel / plan.width_px as usize];
    [0, 1].map(|k| corner[k] as f64 + f64::from(offset[k]) / 256.0)
}

/// The region in which a triangle is seen: four affine functions of the screen, each a signed
/// distance in pixels, are positive there. A point p of the screen is a sum of the corners'
/// homogeneous (x, y, w) with weights `l`, which have to be positive; and as those add up to 1 / W,
/// there is a line where W is the near plane's. This stays right for corners behind the eye (Olano and Greer 1997).
struct Region([V3; 4]);

impl Region {
    fn new(plan: &DrawPlan<'_>) -> Option<Self> {
        let scene = scene(plan);
        let [a, b, c] = scene.triangles[0].map(|v| {
            let h = scene.camera.homogeneous(scene.positions[v as usize]);
            [h[0], h[1], h[3]]
        });
        let volume = dot(a, cross(b, c));
        let weights = [cross(b, c), cross(c, a), cross(a, b)].map(|n| n.map(|v| v / volume));
        let near: V3 = std::array::from_fn(|k| {
            f64::from(u8::from(k == 2)) / scene.camera.near_w - weights.iter().map(|w| w[k]).sum::<f64>()
        });
        let [u, v, w] = weights;
        let distances = [u, v, w, near].map(|n| n.map(|c| c / n[0].hypot(n[1])));
        distances.iter().flatten().all(|c| c.is_finite()).then_some(Self(distances))
    }

    /// The distance of a sample on the wrong side, pixels.
    fn error_px(&self, p: V2, is_drawn: bool) -> f64 {
        let inside = self.0.iter().map(|n| n[0] * p[0] + n[1] * p[1] + n[2]).fold(f64::INFINITY, f64::min);
        if is_drawn { (-inside).max(0.0) } else { inside.max(0.0) }
    }
}

#[test]
fn lines_that_come_from_behind_the_eye_have_their_exact_coverage() {
    let mut random = Random(31);
    let mut missed = Vec::new();
    let mut rmse = 0.0_f64;
    let (mut drawn, count) = (0, cases(300, 10_000));
    for mut renderer in renderers() {
        let mut errors = Errors::default();
        let count = if renderer.kind().name() == "cpu" { count } else { count / 5 };
        for i in 0..count {
            let near = [0.001, 0.05, 0.3][i % 3];
            let mut end = |z: [f64; 2]| {
                [random.range(-1.0, 1.0) as f32, random.range(-1.0, 1.0) as f32, random.range(z[0], z[1]) as f32]
            };
            let ends = [end([-1.0, -0.1]), end([0.4, 2.0])];
            let width = [1.0, 3.0][i / 3 % 2];
            let mut plan = line_plan(&ends, &[[0, 1]], width);
            plan.projection = eye_plan([SIZE_PX; 2], &[], &[], near).projection;
            let [segment] = segments(&plan)[..] else { panic!("edge {i} is out of sight") };
            errors.add(&Errors::of(&drawn_ink(&plan, renderer.as_mut()), &segment_ink(segment, width)));
            drawn += 1;
        }
        let what = format!("4 lines from behind the eye, {}", renderer.kind().name());
        missed.extend(errors.check(&what, LINES_NOW).err());
        rmse = rmse.max(errors.rmse());
    }
    goal(4, &format!("{drawn} lines: RMSE {rmse:.2}/255"));
    assert_eq!(drawn, count + count / 5 * (renderers().len() - 1));
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
