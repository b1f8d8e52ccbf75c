//! GPU against CPU: the same visibility buffer, word for word, and pictures that agree; and a brute-force third opinion.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use meshsnap::backend::cpu::CpuRenderer;
use meshsnap::backend::gpu::{AtomicsChoice, Gpu, GpuKind, GpuRenderer};
use meshsnap::backend::{DrawError, Renderer};
use meshsnap::image::Image;
use meshsnap::limits::Deadline;
use meshsnap::plan::{DrawPlan, Faces, HullOffset, HullPass, Normals, Projection, SurfacePass, sample_offsets};

use crate::golden;
use crate::scenes::{self, SCENES};

/// The GPU with 64-bit atomics (where it has them) and without; None where there is no Vulkan.
fn gpus() -> Option<&'static [Arc<Gpu>; 2]> {
    static GPUS: OnceLock<Option<[Arc<Gpu>; 2]>> = OnceLock::new();
    let opened = GPUS.get_or_init(|| {
        let open = |atomics| Gpu::open(GpuKind::Any, atomics).map(Arc::new);
        match (open(AtomicsChoice::Best), open(AtomicsChoice::Force32)) {
            (Ok(best), Ok(force32)) => {
                println!("GPU: {:?}", best.info());
                Some([best, force32])
            }
            (Err(DrawError::NoGpu(reason)), _) => {
                println!("no Vulkan here: {reason}");
                None
            }
            (a, b) => panic!("{:?} {:?}", a.err(), b.err()),
        }
    });
    let required = std::env::var("MESHSNAP_TEST_REQUIRE").is_ok_and(|v| v == "all");
    assert!(opened.is_some() || !required, "MESHSNAP_TEST_REQUIRE=all, and there is no Vulkan");
    opened.as_ref()
}

/// xorshift64*: the tests must draw the same soups everywhere.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// From -1 to 1.
    fn signed(&mut self) -> f32 {
        ((self.bits() >> 40) as f32 / (1 << 23) as f32) - 1.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    fn point(&mut self, reach: f32) -> [f32; 3] {
        std::array::from_fn(|_| reach * self.signed())
    }
}

/// What a soup is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// About a pixel each.
    Tiny,
    /// Much of the picture each.
    Large,
    /// Thin as a hair.
    Sliver,
    /// A bent grid: every edge is shared.
    Grid,
    /// The same triangles again and again, so that depths are equal.
    Ties,
    /// All of these.
    Mixed,
}

const KINDS: [Kind; 6] = [Kind::Tiny, Kind::Large, Kind::Sliver, Kind::Grid, Kind::Ties, Kind::Mixed];

struct Soup {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn new(kind: Kind, count: usize, reach: f32, random: &mut Random) -> Self {
        let mut soup = Self { positions: vec![], normals: vec![], triangles: vec![] };
        match kind {
            Kind::Grid => soup.grid(count, reach, random),
            _ => (0..count).for_each(|_| soup.triangle(kind, reach, random)),
        }
        soup.normals = soup.positions.iter().map(|_| unit(random.point(1.0))).collect();
        soup
    }

    fn triangle(&mut self, kind: Kind, reach: f32, random: &mut Random) {
        let kind = if kind == Kind::Mixed { KINDS[random.below(3)] } else { kind };
        let around = |p: [f32; 3], size: f32, r: &mut Random| {
            let d = r.point(size);
            [p[0] + d[0], p[1] + d[1], p[2] + d[2]]
        };
        let a = random.point(reach);
        let corners = match kind {
            Kind::Tiny => [a, around(a, 0.02, random), around(a, 0.02, random)],
            Kind::Sliver => {
                let b = random.point(reach);
                [a, b, around(b, 0.003, random)]
            }
            Kind::Ties if !self.triangles.is_empty() => {
                let mut again = self.triangles[random.below(self.triangles.len())];
                again.rotate_left(random.below(3));
                self.triangles.push(again);
                return;
            }
            _ => [a, random.point(reach), random.point(reach)],
        };
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    fn grid(&mut self, count: usize, reach: f32, random: &mut Random) {
        let n = (count as f32 / 2.0).sqrt().ceil() as u32;
        for y in 0..=n {
            for x in 0..=n {
                let at = |v: u32| reach * (2.0 * v as f32 / n as f32 - 1.0);
                self.positions.push([at(x) + 0.01 * random.signed(), at(y), 0.3 * random.signed()]);
            }
        }
        for y in 0..n {
            for x in 0..n {
                let v = y * (n + 1) + x;
                self.triangles.extend([[v, v + 1, v + n + 1], [v + 1, v + n + 2, v + n + 1]]);
            }
        }
    }

    fn plan(&self, view: &View) -> DrawPlan<'_> {
        DrawPlan {
            width_px: view.width,
            height_px: view.height,
            samples: view.samples,
            positions: &self.positions,
            triangles: &self.triangles,
            projection: view.projection,
            surface: view.surface.map(|faces| flat_surface(faces, Normals::None)),
            hull: view.hull.map(|offset| HullPass {
                color: [0.0, 0.0, 0.0, 1.0],
                normals: Cow::Borrowed(&self.normals),
                offset,
            }),
            lines: None,
            background: [1.0; 4],
            skips: Vec::new(),
        }
    }
}

fn flat_surface(faces: Faces, normals: Normals<'_>) -> SurfacePass<'_> {
    SurfacePass {
        faces,
        normals,
        material_colors: vec![[0.5, 0.25, 0.125, 1.0]],
        triangle_materials: &[],
        metallic: 0.0,
        roughness: 0.6,
        intensity: 1.0,
        ambient: 0.3,
        to_light: unit([0.3, 0.4, 1.0]),
        halfway: unit([0.15, 0.2, 1.0]),
        fwidth: None,
    }
}

/// How a soup is looked at.
#[derive(Clone, Copy, Debug)]
struct View {
    width: u32,
    height: u32,
    samples: u32,
    projection: Projection,
    surface: Option<Faces>,
    hull: Option<HullOffset>,
}

impl View {
    /// From `distance` in front of the origin along a random direction; `distance` 0 is orthographic.
    fn new(size: [u32; 2], samples: u32, distance: f32, random: &mut Random) -> Self {
        let to_viewer = unit(random.point(1.0));
        let right = unit(cross([0.1, 1.0, 0.2], to_viewer));
        let up = cross(to_viewer, right);
        let scale = 128.0 * size[0].min(size[1]) as f32;
        let row = |v: [f32; 3], s: f32, last: f32| [v[0] * s, v[1] * s, v[2] * s, last];
        let perspective = distance > 0.0;
        let scale = if perspective { scale * distance } else { scale };
        let projection = Projection {
            x: row(right, scale, 0.0),
            y: row(up, -scale, 0.0),
            z: if perspective { [0.0, 0.0, 0.0, 0.02] } else { row(to_viewer, 0.25, 0.5) },
            w: if perspective { row(to_viewer, -1.0, distance) } else { [0.0, 0.0, 0.0, 1.0] },
            near_w: 0.02,
            clip: perspective && distance < 2.0,
            to_viewer,
            screen_up: up,
            screen_right: right,
        };
        Self { width: size[0], height: size[1], samples, projection, surface: Some(Faces::Both), hull: None }
    }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt().max(1e-6);
    v.map(|c| c / length)
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Draws the plan on the CPU and on both GPU paths and compares; returns how many samples saw something.
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
        for samples in [1, 4] {
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
    assert_eq!(cases, 96);
    assert!(seen > 500_000, "{seen} samples saw something");
}

#[test]
fn visibility_with_faces_and_hulls_is_the_same() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(77);
    let (mut cases, mut seen) = (0, 0);
    let hulls = [None, Some(HullOffset::Object(0.05)), Some(HullOffset::Px(3.0))];
    for surface in [None, Some(Faces::Both), Some(Faces::Front), Some(Faces::Back)] {
        for hull in hulls {
            for distance in [0.0, 0.4, 3.0] {
                let soup = Soup::new(Kind::Mixed, 300, 0.7, &mut random);
                let view = View::new([200, 150], 4, distance, &mut random);
                let view = View { surface, hull, ..view };
                seen += compare(&soup.plan(&view), &format!("{surface:?} {hull:?} {distance}"));
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
            for reach in [0.5, 3.0, 50.0] {
                let soup = Soup::new(kind, 300, reach, &mut random);
                let mut view = View::new([320, 240], 1 + 3 * (cases as u32 % 2), distance, &mut random);
                view.projection.clip = true;
                seen += compare(&soup.plan(&view), &format!("{kind:?} {distance} {reach}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 54);
    assert!(seen > 500_000, "{seen} samples saw something");
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
fn visibility_is_what_brute_force_finds() {
    if gpus().is_none() {
        return;
    }
    let mut random = Random(31);
    let mut cases = 0;
    for kind in KINDS {
        for samples in [1, 4] {
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
    assert_eq!(cases, 12);
}

/// What a sample should see, by i128 coverage and f64 depth: whoever owns it, nearest first.
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
    // The grid that vertices snap to is 1/256 px, so f64 snaps as f32 does but for ties: those are nudged away.
    let snapped: Vec<_> = CpuSnap::all(plan);
    let mut truth: Vec<Truth> = Vec::new();
    let half = [i64::from(plan.width_px) * 128, i64::from(plan.height_px) * 128];
    for y in 0..i64::from(plan.height_px) {
        for x in 0..i64::from(plan.width_px) {
            for offset in sample_offsets(plan.samples) {
                let at = [x * 256 - half[0] + 16 * i64::from(offset[0]), y * 256 - half[1] + 16 * i64::from(offset[1])];
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

/// Snapping is part of the contract, bit for bit, so the brute force takes it from the CPU's rules, written again.
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

/// How far a scene's pictures may lie apart.
#[derive(Clone, Copy, Debug)]
struct Tolerance {
    /// Largest difference of a channel, of 255.
    channel: u8,
    /// Largest share of pixels that differ at all.
    pixels: f64,
}

/// ACCURACY.md, goal 8.
const SURFACE_TOLERANCE: Tolerance = Tolerance { channel: 1, pixels: 0.001 };

/// Coverage runs through square roots and exponentials, which devices round their own way.
const LINES_TOLERANCE: Tolerance = Tolerance { channel: 1, pixels: 0.01 };

#[test]
fn pictures_of_the_scenes_agree() {
    if gpus().is_none() {
        return;
    }
    let mut cases = 0;
    for scene in SCENES {
        let cpu = golden::draw(scene, &mut CpuRenderer::new(1));
        let tolerance = if scene.kind == scenes::Kind::Lines { LINES_TOLERANCE } else { SURFACE_TOLERANCE };
        for gpu in gpus().unwrap() {
            let mut renderer = GpuRenderer::new(gpu.clone());
            // Twice: the second picture comes from buffers that the first has used.
            for _ in 0..2 {
                let picture = golden::draw(scene, &mut renderer);
                assert_close(&cpu, &picture, tolerance, scene.name);
                cases += 1;
            }
        }
    }
    assert_eq!(cases, SCENES.len() * 4);
}

fn assert_close(cpu: &Image, gpu: &Image, tolerance: Tolerance, what: &str) {
    assert_eq!((cpu.width_px, cpu.height_px, cpu.rgba.len()), (gpu.width_px, gpu.height_px, gpu.rgba.len()), "{what}");
    let pairs = || cpu.rgba.chunks_exact(4).zip(gpu.rgba.chunks_exact(4));
    let worst = cpu.rgba.iter().zip(&gpu.rgba).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    let differing = pairs().filter(|(a, b)| a != b).count();
    let share = differing as f64 / pairs().count() as f64;
    println!("{what}: {differing} pixels differ, by {worst} at most");
    let first = pairs().position(|(a, b)| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > tolerance.channel));
    let at = first.map(|i| (i as u32 % cpu.width_px, i as u32 / cpu.width_px));
    assert!(
        worst <= tolerance.channel && share <= tolerance.pixels,
        "{what}: {differing} pixels ({share}), by {worst}; first at {at:?}"
    );
}
