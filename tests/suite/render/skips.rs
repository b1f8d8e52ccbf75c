//! Skips change no byte: every scene, with each skip turned off in turn, and all at once.

use image::ImageFormat;
use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{DrawPlan, SkipKind};
use meshsnap_render::spec::Spec;

use crate::render::textures::levels as textures;
use crate::support::files::mesh::Noise;
use crate::support::gpus::gpus;
use crate::support::scenes::{self, SCENES};
use crate::support::truth::{goal, is_long};

/// Views of [`textured`]: its texture from afar, close up, not at all; and its vertex colours
/// instead.
const TEXTURED: &[(&str, &[(&str, &str)])] = &[
    ("texture-small", &[("style", "smooth"), ("size", "16")]),
    (
        "texture-close",
        &[("style", "smooth"), ("size", "160"), ("camera.eye", "0.1,0.1,0.3"), ("camera.target", "0,0,0")],
    ),
    ("texture-unused", &[("style", "smooth"), ("size", "48"), ("surface.color", "c40")]),
    ("texture-wire", &[("style", "wireframe"), ("size", "48")]),
    ("texture-wire-show", &[("style", "wireframe"), ("size", "48"), ("wire.hidden", "show")]),
];

/// The skips that were taken, how often, and those that were tried the other way.
struct Tally {
    cpu: CpuRenderer,
    gpu: Option<GpuRenderer>,
    cases: usize,
    scenes: usize,
    skipped: Vec<usize>,
}

#[test]
fn turning_a_skip_off_changes_no_byte() {
    let gpu = gpus().map(|gpus| GpuRenderer::new(gpus[0].clone()));
    let mut tally = Tally { cpu: CpuRenderer::new(1), gpu, cases: 0, scenes: 0, skipped: vec![0; SkipKind::ALL.len()] };
    for scene in SCENES {
        tally.compare(scene.name, &scenes::mesh(&(scene.obj)()), &scene.spec());
    }
    let mesh = textured();
    for (name, keys) in TEXTURED {
        tally.compare(name, &mesh, &scenes::spec(keys));
    }
    let count = SCENES.len() + TEXTURED.len();
    for (kind, skipped) in SkipKind::ALL.iter().zip(&tally.skipped) {
        println!("{kind}: skipped in {skipped} of {count} scenes");
        assert!(*skipped > 0, "{kind} was never skipped");
    }
    goal(9, &format!("identical: {} skips turned off alone, and all of {count} scenes together", tally.cases));
    assert!(tally.cases > 6 * count, "{}", tally.cases);
    // Here they are really there, or really not.
    let surface = |scene: usize, keep: &[SkipKind]| {
        let surface = keeping(&mesh, &scenes::spec(TEXTURED[scene].1), keep).surface.unwrap();
        (surface.textures.texel_count(), surface.uvs.is_some(), surface.colors.is_some())
    };
    let all = 87_381;
    let (small, uvs, _) = surface(0, &[]);
    assert!(small < all && uvs, "{small}");
    assert_eq!(surface(0, &[SkipKind::FineTextureLevels]).0, all);
    assert_eq!(surface(1, &[]), (all, true, true));
    assert_eq!(surface(2, &[]), (0, false, false));
    assert_eq!(surface(2, &[SkipKind::Uvs, SkipKind::VertexColors]), (0, true, true));
    assert_eq!(surface(2, &[SkipKind::Textures, SkipKind::FineTextureLevels]).0, all);
}

impl Tally {
    /// Each skip of a scene in turn, and all at once.
    fn compare(&mut self, name: &str, mesh: &Mesh, spec: &Spec) {
        let deadline = Deadline::default();
        let usual = keeping(mesh, spec, &[]);
        let want = self.cpu.draw(&usual, &deadline).unwrap();
        for (kind, count) in SkipKind::ALL.iter().zip(&mut self.skipped) {
            if usual.skips.iter().all(|skip| skip.kind != *kind) {
                continue;
            }
            let kept = keeping(mesh, spec, &[*kind]);
            assert!(kept.skips.iter().all(|skip| skip.kind != *kind), "{name}: {kind} cannot be turned off");
            assert!(self.cpu.draw(&kept, &deadline).unwrap() == want, "{name}: with {kind}");
            *count += 1;
            self.cases += 1;
        }
        let all = keeping(mesh, spec, SkipKind::ALL);
        assert!(self.cpu.draw(&all, &deadline).unwrap() == want, "{name}: with everything");
        // The GPU draws every third scene; all scenes in a long run.
        self.scenes += 1;
        let is_taken = is_long() || self.scenes % 3 == 1;
        if let Some(gpu) = self.gpu.as_mut().filter(|_| is_taken) {
            let want = gpu.draw(&usual, &deadline).unwrap();
            assert!(gpu.draw(&all, &deadline).unwrap() == want, "{name}: with everything, GPU");
            if usual.skips.iter().any(|skip| skip.kind == SkipKind::FineTextureLevels) {
                let fine = keeping(mesh, spec, &[SkipKind::FineTextureLevels]);
                assert!(gpu.draw(&fine, &deadline).unwrap() == want, "{name}: with fine levels, GPU");
            }
        }
    }
}

/// Two triangles with noise of 256 x 256 texels on them, and a colour a vertex.
fn textured() -> Mesh {
    let [a, b, c, d] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.2]];
    let [ta, tb, tc, td] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let noise = image::RgbImage::from_raw(256, 256, Noise(17).bytes(256 * 256 * 3)).unwrap();
    let picture = textures::encode(&noise.into(), ImageFormat::Png);
    let mut mesh = textures::model(&[[a, b, c], [a, c, d]], &[[ta, tb, tc], [ta, tc, td]], &picture, textures::base());
    mesh.colors = (0..mesh.uvs.len()).map(|i| [1.0, 0.5 + 0.1 * i as f32 % 0.5, 0.25, 1.0]).collect();
    mesh
}

fn keeping<'a>(mesh: &'a Mesh, spec: &Spec, keep: &[SkipKind]) -> DrawPlan<'a> {
    scenes::try_plan(mesh, spec, &Limits::default(), &Deadline::default(), keep).unwrap()
}
