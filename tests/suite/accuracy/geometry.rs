//! Tests of the samples that triangles own. Triangles without gaps between them own each sample
//! exactly once, also beyond the guard band and around the eye. Instruction sets and threads change
//! no byte of a picture, and the GPU has the same samples.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::accuracy::behind_eye::eye_plan;
use crate::oracle::coverage::{Coverage, classify, snap};
use crate::oracle::vector::V3;
use crate::support::families::lines::{CONTOURS, MESHES, plan_keys};
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{cases, goal, renderers};

/// Samples that belong to no triangle and to more than one, and how many were looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ownership {
    pub missing: usize,
    pub double: usize,
    pub samples: usize,
}

impl Ownership {
    /// Goal 6: none of either.
    pub fn check(&self, what: &str) -> Result<(), String> {
        println!("{what:<44} {self:?} (goal 0, 0)");
        if self.missing + self.double == 0 && self.samples > 0 { Ok(()) } else { Err(format!("{what}: {self:?}")) }
    }

    fn add(&mut self, other: Self) {
        self.missing += other.missing;
        self.double += other.double;
        self.samples += other.samples;
    }

    /// Of triangles that fill the picture at one depth. Of equal depths the lowest id wins, so a
    /// sample that two triangles own goes to another one when they are drawn in reverse.
    pub fn of(plan: &DrawPlan<'_>, renderer: &mut dyn Renderer) -> Self {
        let forth = renderer.draw_visibility(plan, &Deadline::default()).unwrap();
        let triangles: Vec<[u32; 3]> = plan.triangles.iter().rev().copied().collect();
        let reversed =
            scenes::screen_plan([plan.width_px, plan.height_px], plan.samples, 1.0, &plan.positions, &triangles);
        let reversed = DrawPlan { projection: plan.projection, ..reversed };
        let back = renderer.draw_visibility(&reversed, &Deadline::default()).unwrap();
        let last = triangles.len() as u32 - 1;
        let mut found = Self { samples: forth.len(), ..Self::default() };
        for (forth, back) in forth.iter().zip(&back) {
            found.missing += usize::from(*forth == 0);
            found.double += usize::from(*forth != 0 && !(*forth as u32) != last - !(*back as u32));
        }
        found
    }
}

/// A net of triangles that covers a picture and more, pixels from its centre, moved about; one
/// third of the vertices on multiples of 1/8 px, where samples lie. By less than a quarter of a
/// cell in all, so that nothing folds over.
pub fn jittered_net(n: u32, size_px: [u32; 2], random: &mut Random) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let cell = size_px.map(|s| 1.25 * f64::from(s) / f64::from(n));
    let mut positions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let mut at = |k: usize, place: u32| {
                let v = (f64::from(place) - 0.5 * f64::from(n)) * cell[k] + random.range(-0.18, 0.18) * cell[k];
                if (i + j) % 3 == 0 { (v * 8.0).round() / 8.0 } else { v }
            };
            positions.push([at(0, i) as f32, at(1, j) as f32, 0.5]);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let v = j * (n + 1) + i;
            let (a, b, c, d) = (v, v + 1, v + n + 2, v + n + 1);
            let cut = if random.next().is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[b, c, d], [d, a, b]] };
            triangles.extend(cut);
        }
    }
    (positions, triangles)
}

#[test]
fn shared_edges_own_every_sample_once() {
    let mut missed = Vec::new();
    let (mut edges, mut random, mut all) = (0, Random(11), Ownership::default());
    for mut renderer in renderers() {
        for (n, size, samples) in
            [(12, 256, 4), (100, 256, 1), (100, 256, 4), (100, 256, 8), (100, 256, 16), (590, 512, 4)]
        {
            let (positions, triangles) = jittered_net(n, [size; 2], &mut random);
            let plan = scenes::screen_plan([size; 2], samples, 1.0, &positions, &triangles);
            let what = format!("6 net of {} triangles, {}", triangles.len(), renderer.kind().name());
            let found = Ownership::of(&plan, renderer.as_mut());
            missed.extend(found.check(&what).err());
            all.add(found);
            edges += 3 * n as usize * n as usize - 2 * n as usize;
        }
    }
    goal(6, &format!("{} missing, {} double of {edges} shared edges", all.missing, all.double));
    assert!(edges >= 1_000_000, "{edges}");
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn fans_own_every_sample_once_beyond_the_guard_band_too() {
    let mut missed = Vec::new();
    let mut sum = Ownership::default();
    let mut random = Random(12);
    let (mut fans, count) = (0, cases(40, 400));
    for mut renderer in renderers() {
        for reach in [200.0, 5e3, 1e5, 1e6] {
            let mut all = Ownership::default();
            for i in 0..count {
                let spokes = [3, 4, 7, 48, 300][i % 5];
                let (positions, triangles) = fan(spokes, reach, &mut random);
                let samples = [4, 1, 8, 16][i / 5 % 4];
                let mut plan = scenes::screen_plan([96, 64], samples, 1.0, &positions, &triangles);
                plan.projection.clip = true;
                // One depth: the same bits wherever a triangle is clipped.
                plan.projection.z = [0.0, 0.0, 0.0, 0.5];
                all.add(Ownership::of(&plan, renderer.as_mut()));
                fans += 1;
            }
            sum.add(all);
            missed.extend(all.check(&format!("6 fans that reach {reach} px, {}", renderer.kind().name())).err());
        }
    }
    goal(6, &format!("{} and {} in {fans} fans that reach 200 to 1,000,000 px", sum.missing, sum.double));
    assert_eq!(fans, renderers().len() * 4 * count);
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Triangles all around a point in the picture.
fn fan(spokes: u32, reach: f64, random: &mut Random) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let hub = [random.range(-40.0, 40.0) as f32, random.range(-28.0, 28.0) as f32, 0.5];
    let mut positions = vec![hub];
    for k in 0..spokes {
        let jitter = if spokes < 5 { 0.0 } else { random.range(0.0, 0.8) };
        let a = (f64::from(k) + jitter) / f64::from(spokes) * std::f64::consts::TAU + 0.1;
        let r = reach * random.range(1.0, 1.5);
        positions.push([hub[0] + (r * a.cos()) as f32, hub[1] + (r * a.sin()) as f32, 0.5]);
    }
    (positions, (0..spokes).map(|k| [0, 1 + k, 1 + (k + 1) % spokes]).collect())
}

#[test]
fn a_shell_around_the_eye_owns_every_sample_once() {
    let mut random = Random(13);
    let mut all = Ownership::default();
    let (mut shells, count) = (0, cases(60, 1000));
    let mut renderer = CpuRenderer::new(1);
    for _ in 0..count {
        let (positions, triangles) = shell(&mut random);
        let size = [64, 48];
        // Behind the eye depths differ by rounding, so owners are counted triangle by triangle.
        let mut owners = vec![0; 64 * 48 * 4];
        for triangle in &triangles {
            let plan = eye_plan(size, &positions, std::slice::from_ref(triangle), 0.05);
            let words = renderer.draw_visibility(&plan, &Deadline::default()).unwrap();
            owners.iter_mut().zip(words).for_each(|(owners, word)| *owners += usize::from(word != 0));
        }
        let missing = owners.iter().filter(|&&n| n == 0).count();
        let double = owners.iter().filter(|&&n| n > 1).count();
        all.add(Ownership { missing, double, samples: owners.len() });
        shells += 1;
    }
    goal(6, &format!("{} and {} in {shells} shells around the eye", all.missing, all.double));
    assert_eq!(shells, count);
    all.check("6 shells around the eye, cpu").unwrap();
}

/// An octahedron around the eye with every face cut in four, dented.
fn shell(random: &mut Random) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut directions: Vec<V3> = Vec::new();
    for k in 0..3 {
        directions.extend([1.0, -1.0].map(|s| std::array::from_fn(|i| if i == k { s } else { 0.0 })));
    }
    let mut triangles = Vec::new();
    for octant in 0..8_u32 {
        let [x, y, z] = [0, 1, 2].map(|k| 2 * k + (octant >> k & 1));
        let mut middle = |a: u32, b: u32| {
            let sum: V3 = std::array::from_fn(|k| directions[a as usize][k] + directions[b as usize][k]);
            directions.iter().position(|d| *d == sum).unwrap_or_else(|| {
                directions.push(sum);
                directions.len() - 1
            }) as u32
        };
        let (xy, yz, zx) = (middle(x, y), middle(y, z), middle(z, x));
        triangles.extend([[x, xy, zx], [y, yz, xy], [z, zx, yz], [xy, yz, zx]]);
    }
    let positions = directions
        .into_iter()
        .map(|d| {
            let r = random.range(0.6, 3.0);
            d.map(|v| (r * (v + random.range(-0.1, 0.1))) as f32)
        })
        .collect();
    (positions, triangles)
}

#[test]
fn full_pixels_are_full_and_empty_ones_empty() {
    let mut random = Random(15);
    let (mut counts, mut triangles) = ([0; 3], 0);
    for mut renderer in renderers() {
        for i in 0..cases(200, 2000) {
            let reach = [1.0, 6.0, 40.0][i % 3];
            let positions: Vec<[f32; 3]> =
                (0..3).map(|_| [random.range(-reach, reach) as f32, random.range(-reach, reach) as f32, 0.5]).collect();
            let plan = scenes::screen_plan([32, 24], 4, 1.0, &positions, &[[0, 1, 2]]);
            let words = renderer.draw_visibility(&plan, &Deadline::default()).unwrap();
            let corners =
                [0, 1, 2].map(|k: usize| snap([f64::from(positions[k][0]) + 16.0, f64::from(positions[k][1]) + 12.0]));
            for (pixel, samples) in words.chunks(4).enumerate() {
                let class = classify(corners, [(pixel % 32) as i64, (pixel / 32) as i64]);
                let seen = samples.iter().filter(|&&word| word != 0).count();
                let is_right = match class {
                    Coverage::None => seen == 0,
                    Coverage::Full => seen == 4,
                    Coverage::Partial => true,
                };
                assert!(is_right, "{positions:?}, pixel {pixel}: {class:?}, but {seen} samples");
                counts[class as usize] += 1;
            }
            triangles += 1;
        }
    }
    assert_eq!(triangles, renderers().len() * cases(200, 2000));
    assert!(counts.iter().all(|&n| n > 1000), "{counts:?}");
}

#[test]
fn pictures_are_the_same_on_every_machine() {
    let mut compared = 0;
    for scene in MESHES.iter().chain(CONTOURS) {
        let mesh = scenes::mesh(&(scene.obj)());
        let plan_spec = scenes::spec(&plan_keys(scene, "1.5"));
        let plan = scenes::plan(&mesh, &plan_spec);
        let deadline = Deadline::default();
        let want = CpuRenderer::with_isa(1, Isa::baseline()).draw(&plan, &deadline).unwrap();
        for threads in [1, 2, 3, 8] {
            let got = CpuRenderer::new(threads).draw(&plan, &deadline).unwrap();
            assert!(want.rgba == got.rgba, "7 {}: {threads} threads", scene.name);
            compared += 1;
        }
        for mut renderer in renderers().into_iter().filter(|r| r.kind().name() == "gpu") {
            let got = renderer.draw(&plan, &deadline).unwrap();
            Likeness::of(&want, &got).assert(Tolerance::TWINS, &format!("8 {}", scene.name));
            let words = CpuRenderer::new(2).draw_visibility(&plan, &deadline).unwrap();
            assert!(words == renderer.draw_visibility(&plan, &deadline).unwrap(), "8 {}: other samples", scene.name);
        }
    }
    assert_eq!(compared, 4 * (MESHES.len() + CONTOURS.len()));
}
