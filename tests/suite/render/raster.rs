//! The CPU rasterizer against an independent brute-force count in integers.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, sample_offsets};

use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::work::assert_stops_at_any_poll;

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;

/// Unit-box x, y become pixels from the centre divided by `SCALE`; z is the depth.
const SCALE: f32 = 64.0;

#[test]
fn shared_edges_own_every_sample_exactly_once() {
    let mut samples_checked = 0;
    for seed in 0..12 {
        let (positions, triangles) = jittered_grid(seed);
        for samples in [1, 4, 8, 16] {
            let plan = plan(&positions, &triangles, samples);
            let words = CpuRenderer::new(1).draw_visibility(&plan, &Deadline::default()).unwrap();
            for (i, word) in words.iter().enumerate() {
                let owners = owners(&plan, i);
                assert_eq!(owners.len(), 1, "seed {seed}: sample {i} belongs to {owners:?}");
                assert_eq!(!(*word as u32), owners[0], "seed {seed}: sample {i}");
                samples_checked += 1;
            }
        }
    }
    assert_eq!(samples_checked, 12 * (WIDTH * HEIGHT * 29) as usize);
}

#[test]
fn soups_are_the_same_with_every_instruction_set_and_thread_count_and_have_the_nearest_owner() {
    let mut cases = 0;
    for seed in 0..40 {
        let (positions, triangles) = soup(seed);
        for samples in [1, 4, 8, 16] {
            let plan = plan(&positions, &triangles, samples);
            let words = CpuRenderer::with_isa(1, Isa::baseline()).draw_visibility(&plan, &Deadline::default()).unwrap();
            for renderer in [&mut CpuRenderer::new(1), &mut CpuRenderer::new(3)] {
                assert_eq!(words, renderer.draw_visibility(&plan, &Deadline::default()).unwrap(), "seed {seed}");
            }
            for (i, word) in words.iter().enumerate() {
                check_sample(&plan, i, *word, seed);
            }
            cases += 1;
        }
    }
    assert_eq!(cases, 160);
}

/// The owner covers the sample, and no other triangle that does is clearly nearer.
fn check_sample(plan: &DrawPlan<'_>, sample: usize, word: u64, seed: u64) {
    let owners = owners(plan, sample);
    if word == 0 {
        assert!(owners.is_empty(), "seed {seed}: sample {sample} is empty, but {owners:?} cover it");
        return;
    }
    let (id, depth) = (!(word as u32), f64::from(f32::from_bits((word >> 32) as u32)));
    assert!(owners.contains(&id), "seed {seed}: sample {sample} went to {id}, of {owners:?}");
    let own = depth_of(plan, id, sample);
    let error = depth_error(plan, id);
    assert!((own - depth).abs() < error, "seed {seed}: sample {sample}: depth {depth}, want {own} +- {error}");
    for other in owners {
        let error = error + depth_error(plan, other);
        assert!(depth_of(plan, other, sample) <= own + error, "seed {seed}: sample {sample}: {other} lies before {id}");
    }
}

/// Ids of all triangles that cover a sample by the top-left rule, in plain 64-bit integers.
fn owners(plan: &DrawPlan<'_>, sample: usize) -> Vec<u32> {
    let [px, py] = sample_position(plan, sample);
    let covers = |triangle: &[u32; 3]| {
        let mut v = triangle.map(|i| snapped(plan.positions[i as usize]));
        let area = cross(v[0], v[1], v[2]);
        if area < 0 {
            v.swap(1, 2);
        }
        area != 0
            && (0..3).all(|k| {
                let (a, b) = (v[k], v[(k + 1) % 3]);
                let value = cross(a, b, [px, py]);
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                value > 0 || (value == 0 && (dy < 0 || (dy == 0 && dx > 0)))
            })
    };
    (0..).zip(plan.triangles.iter()).filter(|(_, t)| covers(t)).map(|(id, _)| id).collect()
}

fn cross(a: [i64; 2], b: [i64; 2], p: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

fn depth_of(plan: &DrawPlan<'_>, id: u32, sample: usize) -> f64 {
    let [px, py] = sample_position(plan, sample);
    let corners = plan.triangles[id as usize].map(|i| plan.positions[i as usize]);
    let v = corners.map(snapped);
    let area = cross(v[0], v[1], v[2]) as f64;
    let weight = |k: usize| cross(v[(k + 1) % 3], v[(k + 2) % 3], [px, py]) as f64 / area;
    (0..3).map(|k| weight(k) * f64::from(corners[k][2])).sum()
}

/// The error of depth in f32: larger on slivers, whose gradient is a small difference divided by a
/// small area.
fn depth_error(plan: &DrawPlan<'_>, id: u32) -> f64 {
    let v = plan.triangles[id as usize].map(|i| snapped(plan.positions[i as usize]));
    let side = |a: [i64; 2], b: [i64; 2]| ((b[0] - a[0]).pow(2) + (b[1] - a[1]).pow(2)) as f64;
    let longest = side(v[0], v[1]).max(side(v[1], v[2])).max(side(v[2], v[0]));
    5e-6 + 4e-7 * longest / cross(v[0], v[1], v[2]).abs() as f64
}

/// In 1/256 px from the picture's centre.
fn sample_position(plan: &DrawPlan<'_>, sample: usize) -> [i64; 2] {
    let per_pixel = plan.samples as usize;
    let (pixel, s) = (sample / per_pixel, sample % per_pixel);
    let offset = sample_offsets(plan.samples)[s].map(i64::from);
    let (x, y) = (pixel % plan.width_px as usize, pixel / plan.width_px as usize);
    [
        x as i64 * 256 - i64::from(plan.width_px) * 128 + offset[0],
        y as i64 * 256 - i64::from(plan.height_px) * 128 + offset[1],
    ]
}

fn snapped(p: [f32; 3]) -> [i64; 2] {
    [p[0], p[1]].map(|v| (f64::from(v) * f64::from(SCALE) * 256.0).round_ties_even() as i64)
}

/// Vertices on multiples of 1/256 px, so that snapping rounds nothing, inside the picture and
/// beyond its borders.
fn jittered_grid(seed: u64) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut random = Random(seed);
    let n = 10_u32;
    let mut positions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let at =
                |k: u32, size: u32, jitter: f64| (f64::from(k) / f64::from(n) - 0.5) * f64::from(size) * 1.5 + jitter;
            let border = i == 0 || j == 0 || i == n || j == n;
            let mut jitter = || if border { 0.0 } else { random.range(-3.4, 3.4) };
            let p = [at(i, WIDTH, jitter()), at(j, HEIGHT, jitter())];
            // Some vertices exactly on sample positions, where only the rule decides.
            let p = p.map(|v| if (i + j) % 3 == 0 { v.round() + 0.5 } else { v });
            let unit = p.map(|v| ((v * 256.0).round() / 256.0 / f64::from(SCALE)) as f32);
            positions.push([unit[0], unit[1], 0.5]);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let at = |di: u32, dj: u32| (j + dj) * (n + 1) + i + di;
            let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
            if random.next().is_multiple_of(2) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[b, c, d], [d, a, b]]);
            }
        }
    }
    (positions, triangles)
}

fn soup(seed: u64) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut random = Random(1000 + seed);
    let mut positions = Vec::new();
    for i in 0..60 {
        let size = [0.02, 0.1, 0.5, 3.0][i % 4];
        let center = [random.range(-0.9, 0.9), random.range(-0.6, 0.6)];
        for _ in 0..3 {
            let p = center.map(|c| (c + random.range(-size, size)) as f32);
            positions.push([p[0], p[1], random.range(0.1, 0.9) as f32]);
        }
    }
    let triangles = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (positions, triangles)
}

fn plan<'a>(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]], samples: u32) -> DrawPlan<'a> {
    scenes::screen_plan([WIDTH, HEIGHT], samples, SCALE, positions, triangles)
}

#[test]
fn huge_triangles_by_the_thousand_stop_when_told() {
    const COUNT: usize = 3000;
    let positions: Vec<[f32; 3]> = (0..3).map(|i| [[-2.0, -2.0, 0.5], [6.0, -2.0, 0.5], [-2.0, 6.0, 0.5]][i]).collect();
    let triangles = vec![[0, 1, 2]; COUNT];
    let plan = plan(&positions, &triangles, 4);
    let mut renderer = CpuRenderer::new(2);
    let polls = assert_stops_at_any_poll(8, MORE_POLLS_MAX, |deadline| renderer.draw(&plan, deadline).ok());
    // Each triangle covers the whole picture.
    let samples = u64::from(WIDTH * HEIGHT * 4) * COUNT as u64;
    assert!(polls >= samples / SAMPLES_PER_POLL, "{polls} polls");
}

/// Covered samples that may lie between two polls of the deadline.
const SAMPLES_PER_POLL: u64 = 1 << 23;
/// Polls after a stop: each band that is left polls once and does nothing.
const MORE_POLLS_MAX: u64 = 64;
