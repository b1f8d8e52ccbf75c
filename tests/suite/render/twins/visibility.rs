//! GPU against CPU: the same visibility buffer, word for word, on random triangle soups. The GPU's
//! is also compared with brute force in integers and f64.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, Faces, sample_offsets};

use crate::support::families::soups::{KINDS, Kind, Random, Soup, View};
use crate::support::gpus::gpus;
use crate::support::truth;

/// Draws the plan on the CPU and on both GPU paths and compares; returns how many samples saw
/// something.
fn compare(plan: &DrawPlan<'_>, what: &str) -> usize {
    let deadline = Deadline::default();
    let cpu = CpuRenderer::new(2).draw_visibility(plan, &deadline).unwrap();
    for gpu in gpus().unwrap() {
        let words = GpuRenderer::new(gpu.clone()).draw_visibility(plan, &deadline).unwrap();
        assert_same(plan, &cpu, &words, &format!("{what} on {:?}", gpu.info().features));
    }
    cpu.iter().filter(|&&word| word != 0).count()
}

fn assert_same(plan: &DrawPlan<'_>, want: &[u64], got: &[u64], what: &str) {
    assert_eq!(want.len(), got.len(), "{what}");
    let differing: Vec<usize> = (0..want.len()).filter(|&i| want[i] != got[i]).collect();
    if let Some(&i) = differing.first() {
        let pixel = i / plan.samples as usize;
        let (x, y) = (pixel % plan.width_px as usize, pixel / plan.width_px as usize);
        panic!(
            "{what}: {} of {} samples differ, first at ({x}, {y}): wanted {:#018x} (id {}), got {:#018x} (id {})",
            differing.len(),
            want.len(),
            want[i],
            !(want[i] as u32),
            got[i],
            !(got[i] as u32),
        );
    }
}

#[test]
fn visibility_of_soups_is_the_same() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(0x1234_5678_9ABC_DEF1);
    let (mut cases, mut seen) = (0, 0);
    for size in [[1, 1], [17, 3], [64, 64], [300, 200]] {
        for samples in [1, 4, 8, 16] {
            for kind in KINDS {
                for distance in [0.0, 3.0] {
                    let soup = Soup::new(kind, 200, 0.7, &mut random);
                    let view = View::new(size, samples, distance, &mut random);
                    seen += compare(&soup.plan(&view), &format!("{kind:?} {size:?} {samples} {distance}"));
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, 192);
    assert!(seen > 500_000, "{seen} samples saw something");
}

#[test]
fn visibility_with_faces_and_hulls_is_the_same() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(77);
    let (mut cases, mut seen) = (0, 0);
    let hulls = [None, Some(0.0), Some(3.0)];
    for surface in [None, Some(Faces::Both), Some(Faces::Front), Some(Faces::Back)] {
        for hull_px in hulls {
            for distance in [0.0, 0.4, 3.0] {
                let samples = [1, 4, 8, 16][cases % 4];
                let soup = Soup::new(Kind::Mixed, 300, 0.7, &mut random);
                let view = View::new([200, 150], samples, distance, &mut random);
                let view = View { surface, hull_px, ..view };
                seen += compare(&soup.plan(&view), &format!("{surface:?} {hull_px:?} {samples} {distance}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 36);
    assert!(seen > 500_000, "{seen} samples saw something");
}

#[test]
fn visibility_behind_the_eye_and_off_screen_is_the_same() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(99);
    let (mut cases, mut seen) = (0, 0);
    for kind in KINDS {
        for distance in [0.05, 0.3, 1.0] {
            // One of three reaches in turn; all of them in a long run.
            for reach in [0.5, 3.0, 50.0].into_iter().cycle().skip(cases).take(truth::cases(1, 3)) {
                let soup = Soup::new(kind, 300, reach, &mut random);
                let mut view = View::new([320, 240], [1, 4, 8, 16][cases % 4], distance, &mut random);
                view.projection.clip = true;
                seen += compare(&soup.plan(&view), &format!("{kind:?} {distance} {reach}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, truth::cases(18, 54));
    assert!(seen > truth::cases(150_000, 500_000), "{seen} samples saw something");
}

#[test]
fn visibility_of_large_pictures_is_the_same() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(4242);
    let mut cases = 0;
    for (size, samples, count) in [([1000, 700], 4, 3000), ([1000, 700], 1, 3000), ([4096, 4096], 4, 60)] {
        let soup = Soup::new(Kind::Mixed, count, 0.7, &mut random);
        let view = View::new(size, samples, 3.0, &mut random);
        assert!(compare(&soup.plan(&view), &format!("{size:?} {samples}")) > 100_000);
        cases += 1;
    }
    assert_eq!(cases, 3);
}

#[test]
fn more_triangles_than_a_dispatch_takes() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(2024);
    let mut cases = 0;
    // The dispatch takes 2^20 triangles, and 2^17 where they may need clipping.
    for (count, distance, samples) in [(1_100_000, 3.0, 4), (150_000, 0.5, 16)] {
        let soup = Soup::new(Kind::Tiny, count, 0.7, &mut random);
        let view = View::new([100, 80], samples, distance, &mut random);
        assert!(compare(&soup.plan(&view), &format!("{count} triangles")) > 10_000);
        cases += 1;
    }
    assert_eq!(cases, 2);
}

#[test]
fn plans_with_nothing_to_draw_are_background() {
    let Some(gpus) = gpus() else { return };
    let mut random = Random(5);
    let empty = Soup { positions: vec![], normals: vec![], triangles: vec![] };
    let alone = Soup { positions: vec![[0.0; 3]], normals: vec![[0.0, 0.0, 1.0]], triangles: vec![[0, 0, 0]] };
    let mut cases = 0;
    for soup in [&empty, &alone] {
        for (surface, hull_px) in [(None, None), (Some(Faces::Both), None), (None, Some(1.0))] {
            let view = View { surface, hull_px, ..View::new([33, 7], 4, 3.0, &mut random) };
            let plan = soup.plan(&view);
            let mut renderer = GpuRenderer::new(gpus[0].clone());
            let image = renderer.draw(&plan, &Deadline::default()).unwrap();
            assert_eq!(*image.rgba, [255; 33 * 7 * 4]);
            assert_eq!(renderer.draw_visibility(&plan, &Deadline::default()).unwrap(), vec![0; 33 * 7 * 4]);
            cases += 1;
        }
    }
    assert_eq!(cases, 6);
}

#[test]
fn visibility_is_what_brute_force_finds() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(31);
    let mut cases = 0;
    for kind in KINDS {
        for samples in [1, 4, 8, 16] {
            let soup = Soup::new(kind, 40, 0.9, &mut random);
            let view = View::new([90, 60], samples, 3.0, &mut random);
            let plan = soup.plan(&view);
            let want = brute_force(&plan);
            for gpu in gpus().unwrap() {
                let got = GpuRenderer::new(gpu.clone()).draw_visibility(&plan, &Deadline::default()).unwrap();
                assert_eq!(want.len(), got.len());
                for (i, (want, got)) in want.iter().zip(&got).enumerate() {
                    assert!(want.agrees(*got), "{kind:?}, sample {i}: wanted {want:?}, got {got:#x}");
                }
            }
            cases += 1;
        }
    }
    assert_eq!(cases, 24);
}

/// The true content of a sample, by i128 coverage and f64 depth: its owner, nearest first.
#[derive(Debug)]
struct Truth(Vec<(f64, u32)>);

impl Truth {
    /// The right id; or another owner whose depth is the same but for rounding.
    fn agrees(&self, word: u64) -> bool {
        let Some(&(nearest, _)) = self.0.first() else { return word == 0 };
        let (depth, id) = (f64::from(f32::from_bits((word >> 32) as u32)), !(word as u32));
        let close = |z: f64| (z - nearest).abs() <= 1e-5 && (z - depth).abs() <= 1e-5;
        self.0.iter().any(|&(z, owner)| owner == id && close(z))
    }
}

fn brute_force(plan: &DrawPlan<'_>) -> Vec<Truth> {
    let p = &plan.projection;
    let dot = |row: &[f32; 4], v: [f32; 3]| {
        (0..3).map(|k| f64::from(row[k]) * f64::from(v[k])).sum::<f64>() + f64::from(row[3])
    };
    // The grid that vertices snap to is 1/256 px, so f64 snaps as f32 does but for ties: those are
    // nudged away.
    let snapped: Vec<_> = CpuSnap::all(plan);
    let mut truth: Vec<Truth> = Vec::new();
    let half = [i64::from(plan.width_px) * 128, i64::from(plan.height_px) * 128];
    for y in 0..i64::from(plan.height_px) {
        for x in 0..i64::from(plan.width_px) {
            for offset in sample_offsets(plan.samples) {
                let at = [x * 256 - half[0] + i64::from(offset[0]), y * 256 - half[1] + i64::from(offset[1])];
                let mut owners = Vec::new();
                for (id, t) in plan.triangles.iter().enumerate() {
                    let corners = t.map(|v| snapped[v as usize]);
                    let depths =
                        t.map(|v| dot(&p.z, plan.positions[v as usize]) / dot(&p.w, plan.positions[v as usize]));
                    if let Some(z) = owned(corners, depths, at) {
                        owners.push((z, id as u32));
                    }
                }
                owners.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                truth.push(Truth(owners));
            }
        }
    }
    truth
}

/// Snapping is part of the contract, bit for bit, so the brute force takes it from the CPU's rules,
/// written again.
struct CpuSnap;

impl CpuSnap {
    fn all(plan: &DrawPlan<'_>) -> Vec<[i64; 2]> {
        let row = |r: &[f32; 4], v: [f32; 3]| ((r[0] * v[0] + r[1] * v[1]) + r[2] * v[2]) + r[3];
        let p = &plan.projection;
        plan.positions
            .iter()
            .map(|&v| {
                let w = row(&p.w, v);
                let mut r = f32::from_bits(0x7EF3_11C7 - w.to_bits());
                for _ in 0..4 {
                    r *= 2.0 - w * r;
                }
                [row(&p.x, v) * r, row(&p.y, v) * r].map(|c| f64::from(c).round_ties_even() as i64)
            })
            .collect()
    }
}

/// Depth of a triangle at a sample that it owns.
fn owned(mut c: [[i64; 2]; 3], mut z: [f64; 3], at: [i64; 2]) -> Option<f64> {
    let e = |a: [i64; 2], b: [i64; 2], p: [i64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let mut area = e(c[0], c[1], c[2]);
    if area == 0 {
        return None;
    }
    if area < 0 {
        c.swap(1, 2);
        z.swap(1, 2);
        area = -area;
    }
    let mut depth = 0.0;
    for k in 0..3 {
        let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
        let value = e(a, b, at);
        let owns_border = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
        if value < 0 || (value == 0 && !owns_border) {
            return None;
        }
        depth += value as f64 / area as f64 * z[k];
    }
    (depth > 0.0).then_some(depth)
}
