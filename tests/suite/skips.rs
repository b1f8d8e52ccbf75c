//! What a plan leaves out changes no byte: every scene, with each skip turned off in turn, and all at once.

use meshsnap::backend::Renderer as _;
use meshsnap::backend::cpu::CpuRenderer;
use meshsnap::backend::gpu::GpuRenderer;
use meshsnap::limits::{Budget, Deadline, Limits};
use meshsnap::mesh::Mesh;
use meshsnap::plan::{self, DrawPlan, SkipKind};
use meshsnap::scene::Spec;

use crate::scenes::{self, SCENES};
use crate::twins::gpus;

#[test]
fn turning_a_skip_off_changes_no_byte() {
    let mut renderer = CpuRenderer::new(1);
    let deadline = Deadline::default();
    let mut gpu = gpus().map(|gpus| GpuRenderer::new(gpus[0].clone()));
    let (mut cases, mut skipped) = (0, vec![0; SkipKind::ALL.len()]);
    for scene in SCENES {
        let mesh = scenes::mesh(&(scene.obj)());
        let spec = scene.spec();
        let usual = keeping(&mesh, &spec, &[]);
        let want = renderer.draw(&usual, &deadline).unwrap();
        for (kind, count) in SkipKind::ALL.iter().zip(&mut skipped) {
            if usual.skips.iter().all(|skip| skip.kind != *kind) {
                continue;
            }
            let kept = keeping(&mesh, &spec, &[*kind]);
            assert!(kept.skips.iter().all(|skip| skip.kind != *kind), "{}: {kind} cannot be turned off", scene.name);
            assert!(renderer.draw(&kept, &deadline).unwrap() == want, "{}: with {kind}", scene.name);
            *count += 1;
            cases += 1;
        }
        let all = keeping(&mesh, &spec, SkipKind::ALL);
        assert!(renderer.draw(&all, &deadline).unwrap() == want, "{}: with everything", scene.name);
        if let Some(gpu) = &mut gpu {
            let want = gpu.draw(&usual, &deadline).unwrap();
            assert!(gpu.draw(&all, &deadline).unwrap() == want, "{}: with everything, GPU", scene.name);
        }
    }
    for (kind, count) in SkipKind::ALL.iter().zip(&skipped) {
        println!("{kind}: skipped in {count} of {} scenes", SCENES.len());
    }
    assert!(cases > 6 * SCENES.len(), "{cases}");
}

fn keeping<'a>(mesh: &'a Mesh, spec: &Spec, keep: &[SkipKind]) -> DrawPlan<'a> {
    plan::build_keeping(mesh, spec, &mut Budget::new(&Limits::default()), &Deadline::default(), keep).unwrap()
}
