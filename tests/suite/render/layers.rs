//! Transparent layers: both back-ends find the same ones in every sample, and pictures are what a
//! reference gives that sorts and blends the triangles of each sample in f64.

use std::borrow::Cow;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::{Image, srgb8_thresholds};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, Faces, PeelingPass, ShadedMaterial, SurfacePass, flags, pass_mask};

use crate::support::families::soups::{KINDS, Kind, Random, Soup, View};
use crate::support::gpus::{gpus, gpus_of_case};
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::truth;

const PASS: PeelingPass = PeelingPass { count_max: 16, behind_surface: false, wires_only: false, fade: 1.0 };

/// Looks of a soup's parts: half of them let something through, one is wires alone.
fn materials() -> Vec<ShadedMaterial> {
    let wire = |look: ShadedMaterial| ShadedMaterial {
        wire_color: [0.4, 0.1, 0.05, 0.8],
        wire_thickness: 1.0,
        wire_smoothing: 1.0,
        flags: look.flags | flags::WIRE_FWIDTH,
        ..look
    };
    let fill = |color| {
        let look = ShadedMaterial::unlit(color);
        ShadedMaterial { flags: look.flags | flags::BLEND, ..look }
    };
    let mut bare = wire(fill([0.0; 4]));
    bare.flags &= !flags::FILL;
    vec![
        fill([0.9, 0.1, 0.1, 0.4]),
        fill([0.1, 0.8, 0.2, 0.25]),
        wire(fill([0.1, 0.2, 0.9, 0.6])),
        fill([0.7, 0.7, 0.1, 1.0]),
        bare,
    ]
}

/// A soup's plan with layers, roles and materials at random, and what it borrows.
struct Layered {
    soup: Soup,
    pass_masks: Vec<u8>,
    materials: Vec<u32>,
}

impl Layered {
    fn new(soup: Soup, random: &mut Random) -> Self {
        let kinds = [
            pass_mask::LAYER,
            pass_mask::LAYER,
            pass_mask::SURFACE,
            pass_mask::SURFACE | pass_mask::LAYER,
            pass_mask::LAYER | pass_mask::FRONT_ONLY,
            pass_mask::LAYER | pass_mask::BACK_ONLY,
            pass_mask::SURFACE | pass_mask::FRONT_ONLY,
            0,
        ];
        let pass_masks = soup.triangles.iter().map(|_| kinds[random.below(kinds.len())]).collect();
        let materials = soup.triangles.iter().map(|_| random.below(5) as u32).collect();
        Self { soup, pass_masks, materials }
    }

    fn plan(&self, view: &View, pass: PeelingPass) -> DrawPlan<'_> {
        let mut plan = self.soup.plan(view);
        plan.pass_masks = Cow::Borrowed(&self.pass_masks);
        plan.peeling = Some(pass);
        if let Some(surface) = &mut plan.surface {
            *surface = SurfacePass::new(surface.faces, materials());
            surface.triangle_materials = (&self.materials).into();
        }
        if let Some(hull) = &mut plan.hull {
            hull.colors = (0..5).map(|m| [0.0, 0.02 * m as f32, 0.1, 1.0]).collect();
            hull.surface_materials = (&self.materials).into();
            hull.triangle_materials = self.materials.iter().flat_map(|&m| [m; 2]).collect();
        }
        plan
    }
}

/// Numbers of samples: few, because software GPUs are slow, or all in the long run.
fn samples() -> &'static [u32] {
    truth::cases(&[1, 8], &[1, 4, 8, 16])
}

/// One of three distances in turn; all of them in a long run.
fn distances(case: usize) -> Vec<f32> {
    let all = [0.0, 3.0, 0.4];
    truth::cases(vec![all[case % 3]], all.to_vec())
}

/// Counts the samples of all layers, and compares them and the visibility buffer on every CPU
/// set-up and the GPU.
fn compare(plan: &DrawPlan<'_>, what: &str) -> usize {
    let deadline = Deadline::default();
    let mut cpu = CpuRenderer::new(1);
    let mut others = [CpuRenderer::new(2), CpuRenderer::new(7), CpuRenderer::with_isa(2, Isa::baseline())];
    let mut devices: Vec<GpuRenderer> = gpus().into_iter().flatten().map(|gpu| GpuRenderer::new(gpu.clone())).collect();
    let mut seen = 0;
    let base = cpu.draw_visibility(plan, &deadline).unwrap();
    for device in &mut devices {
        assert!(base == device.draw_visibility(plan, &deadline).unwrap(), "{what}: the visibility buffer differs");
    }
    for layer in 0.. {
        let want = cpu.draw_layer(plan, layer, &deadline).unwrap();
        for (i, other) in others.iter_mut().enumerate() {
            assert!(want == other.draw_layer(plan, layer, &deadline).unwrap(), "{what}: layer {layer}, CPU {i}");
        }
        // Every device at the first layers, and now and then at those far behind.
        let is_taken = layer < truth::cases(2, 3) || layer % truth::cases(8, 4) == truth::cases(5, 3);
        for (i, device) in devices.iter_mut().enumerate().filter(|_| is_taken) {
            let got = device.draw_layer(plan, layer, &deadline).unwrap();
            let differing = want.iter().zip(&got).filter(|(a, b)| a != b).count();
            assert_eq!(differing, 0, "{what}: layer {layer}, GPU {i}");
        }
        let found = want.iter().filter(|&&word| word != 0).count();
        seen += found;
        if found == 0 || layer == 15 {
            break;
        }
    }
    seen
}

#[test]
fn layers_of_soups_are_the_same() {
    let mut random = Random(0xABCD_EF01_2345);
    let (mut cases, mut seen) = (0, 0);
    let hulls = [None, Some(0.0), Some(3.0)];
    let all_samples = samples();
    for kind in KINDS {
        for &samples in all_samples {
            // From the side, from afar, and from within, where triangles reach behind the eye.
            for distance in distances(cases) {
                let count = if kind == Kind::Tiny { 400 } else { 30 };
                let soup = Layered::new(Soup::new(kind, count, 0.7, &mut random), &mut random);
                let view = View::new([90, 70], samples, distance, &mut random);
                let view = View { hull_px: hulls[cases % 3], ..view };
                let pass = PeelingPass { behind_surface: cases % 4 == 3, ..PASS };
                seen += compare(&soup.plan(&view, pass), &format!("{kind:?} {samples} {distance}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, KINDS.len() * all_samples.len() * truth::cases(1, 3));
    assert!(seen > truth::cases(6_000, 100_000), "{seen} samples saw something");
}

#[test]
fn layers_of_pictures_of_many_bands_are_the_same() {
    let mut random = Random(5150);
    let mut cases = 0;
    for (size, samples, surface) in [([900, 620], 4, Faces::Both), ([1500, 900], 1, Faces::Front)] {
        let soup = Layered::new(Soup::new(Kind::Mixed, 120, 0.7, &mut random), &mut random);
        let view = View { surface: Some(surface), ..View::new(size, samples, 3.0, &mut random) };
        assert!(compare(&soup.plan(&view, PASS), &format!("{size:?}")) > 100_000);
        cases += 1;
    }
    assert_eq!(cases, 2);
}

#[test]
fn pictures_with_layers_agree() {
    let mut random = Random(61);
    let mut cases = 0;
    for (i, kind) in KINDS.into_iter().enumerate() {
        for &samples in samples() {
            for distance in [3.0, 0.4] {
                let soup = Layered::new(Soup::new(kind, 40, 0.7, &mut random), &mut random);
                let hull_px = [None, Some(2.0), Some(0.0)][(cases / 2) % 3];
                let view = View { hull_px, ..View::new([120, 90], samples, distance, &mut random) };
                let through = i % 3 == 2;
                let pass = PeelingPass {
                    count_max: 1 + random.below(16) as u32,
                    behind_surface: through,
                    wires_only: through,
                    fade: 0.25,
                };
                let plan = soup.plan(&view, pass);
                let what = format!("{kind:?} {samples} {distance} {pass:?}");
                let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
                for mut other in [CpuRenderer::new(7), CpuRenderer::with_isa(2, Isa::baseline())] {
                    assert!(cpu.rgba == other.draw(&plan, &Deadline::default()).unwrap().rgba, "{what}");
                }
                // One of the devices in turn; all of them in a long run.
                for gpu in gpus_of_case(cases) {
                    let mut renderer = GpuRenderer::new(gpu.clone());
                    // Twice: the second picture comes from buffers that the first has used.
                    for _ in 0..2 {
                        let picture = renderer.draw(&plan, &Deadline::default()).unwrap();
                        Likeness::of(&cpu, &picture).assert(Tolerance::TWINS, &what);
                    }
                }
                cases += 1;
            }
        }
    }
    assert_eq!(cases, KINDS.len() * samples().len() * 2);
}

#[test]
fn layers_are_what_sorting_each_sample_gives() {
    let mut random = Random(808);
    let (mut cases, mut deepest) = (0, 0);
    for kind in [Kind::Large, Kind::Ties, Kind::Mixed] {
        for samples in [1, 4, 8, 16] {
            for distance in [0.0, 3.0, 0.5] {
                let mut soup = Layered::new(Soup::new(kind, 60, 0.7, &mut random), &mut random);
                // Mostly layers: what is opaque hides them.
                for role in soup.pass_masks.iter_mut().filter(|role| **role & pass_mask::SURFACE != 0) {
                    *role = if random.below(6) == 0 { *role } else { pass_mask::LAYER };
                }
                // Colours must not depend on where in its pixel a triangle is shaded.
                soup.materials.iter_mut().for_each(|m| *m %= 2);
                let view = View::new([50, 40], samples, distance, &mut random);
                let plan = soup.plan(&view, PeelingPass { count_max: 64, ..PASS });
                let (want, depth) = sorted(&plan);
                deepest = deepest.max(depth);
                let got = CpuRenderer::new(2).draw(&plan, &Deadline::default()).unwrap();
                let like = Likeness::of(&want, &got);
                like.assert(Tolerance { max: 1, share: 0.02 }, &format!("{kind:?} {samples} {distance}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 36);
    assert!(deepest >= 12, "no sample has more than {deepest} layers");
}

/// Every triangle drawn alone, then each sample's triangles sorted and blended in f64; and how many
/// layers the deepest has.
fn sorted(plan: &DrawPlan<'_>) -> (Image, usize) {
    let surface = plan.surface.as_ref().unwrap();
    let len = (plan.width_px * plan.height_px * plan.samples) as usize;
    let mut owners: Vec<Vec<(u32, u32, bool)>> = vec![Vec::new(); len];
    for (id, triangle) in plan.triangles.iter().enumerate() {
        let role = plan.pass_masks[id];
        let faces = match role {
            r if r & pass_mask::FRONT_ONLY != 0 => Faces::Front,
            r if r & pass_mask::BACK_ONLY != 0 => Faces::Back,
            _ => Faces::Both,
        };
        let alone = [*triangle];
        let mut single = DrawPlan::new([plan.width_px, plan.height_px], &plan.positions, &alone, plan.projection);
        single.samples = plan.samples;
        single.surface = Some(SurfacePass::new(faces, vec![ShadedMaterial::unlit([1.0; 4])]));
        let words = CpuRenderer::new(1).draw_visibility(&single, &Deadline::default()).unwrap();
        for (owners, word) in owners.iter_mut().zip(words).filter(|(_, word)| *word != 0) {
            let depth = (word >> 32) as u32;
            for (bit, is_opaque) in [(pass_mask::SURFACE, true), (pass_mask::LAYER, false)] {
                if role & bit != 0 {
                    owners.push((depth, id as u32, is_opaque));
                }
            }
        }
    }
    let color = |id: u32| surface.material(id as usize).base_color.map(f64::from);
    let mut deepest = 0;
    let blended = owners.into_iter().map(|mut owners| {
        owners.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)).then(b.2.cmp(&a.2)));
        let (mut sum, mut rest, mut count) = ([0.0; 3], 1.0, 0);
        for (_, id, is_opaque) in owners {
            let [r, g, b, a] = color(id);
            for (sum, v) in sum.iter_mut().zip([r, g, b]) {
                *sum += rest * a * v;
            }
            rest *= 1.0 - a;
            count += 1;
            if is_opaque {
                break;
            }
        }
        deepest = deepest.max(count);
        // The background is white.
        sum.map(|v| v + rest)
    });
    let blended: Vec<[f64; 3]> = blended.collect();
    let thresholds = srgb8_thresholds();
    let mut rgba = Vec::new();
    for pixel in blended.chunks(plan.samples as usize) {
        for k in 0..3 {
            let mean = pixel.iter().map(|c| c[k]).sum::<f64>() / f64::from(plan.samples);
            rgba.push(thresholds.iter().filter(|&&t| f64::from(t) <= mean).count() as u8);
        }
        rgba.push(255);
    }
    (Image { width_px: plan.width_px, height_px: plan.height_px, rgba: rgba.into() }, deepest)
}
