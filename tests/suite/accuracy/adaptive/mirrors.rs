//! The accuracy of metals that mirror sharply. Their light changes within a face, so with adaptive
//! samples a face may be shaded in each quarter of a pixel.

use meshsnap_render::plan::DrawPlan;
use meshsnap_render::spec::Samples;

use super::Truth;
use crate::measure::meshes;
use crate::support::scenes;
use crate::support::shapes;
use crate::support::truth::{Gate, cases, goal, renderers};

/// Gates by roughness: whole pictures, and their error as a share of that of 4 samples.
const GATES: [(&str, f64, f64); 3] = [("0.1", 2.3, 0.45), ("0.2", 0.8, 0.3), ("0.35", 0.4, 0.2)];

type Named = (&'static str, fn() -> String);

/// Meshes of large faces and of small ones.
const MESHES: [Named; 3] =
    [("coarse torus", || shapes::torus(24)), ("fine torus", || shapes::torus(96)), ("ball", || meshes::icosphere(4))];

fn plan<'a>(mesh: &'a meshsnap_render::mesh::Mesh, roughness: &str, samples: Samples) -> DrawPlan<'a> {
    let keys = [
        ("size", cases("64x56", "320x280")),
        ("style", "smooth"),
        ("light.preset", "studio"),
        ("surface.metallic", "1"),
        ("surface.roughness", roughness),
    ];
    let mut spec = scenes::spec(&keys);
    spec.image.samples = samples;
    let mut plan = scenes::plan(mesh, &spec);
    // The oracle knows no hollows.
    plan.occlusion = None;
    plan
}

#[test]
fn mirrors_are_near_the_truth() {
    let (mut missed, mut told, mut drawn) = (Vec::new(), Vec::new(), 0);
    let mut renderers = renderers();
    for (roughness, rmse, share) in GATES {
        let mut worst = 0.0_f64;
        for (name, obj) in MESHES {
            let mesh = scenes::mesh(&obj());
            let [adaptive, fixed] =
                [Samples::Adaptive, Samples::Fixed(4)].map(|samples| plan(&mesh, roughness, samples));
            assert!(adaptive.has_quarters() && !fixed.has_quarters());
            let truth = Truth::of(&adaptive, true);
            for renderer in &mut renderers {
                let [[_, found], [_, of_four]] = [&adaptive, &fixed].map(|plan| truth.errors(renderer.as_mut(), plan));
                let what = format!("- adaptive, {name} of roughness {roughness}, {}", renderer.kind().name());
                let gate = Gate { rmse, max: f64::INFINITY, ink: f64::INFINITY };
                missed.extend(found.check(&what, gate).err());
                println!("{what}: {:.2}, with 4 samples {:.2}", found.rmse(), of_four.rmse());
                if found.rmse() > share * of_four.rmse() {
                    missed.push(format!("{what}: {:.2} of the error of 4 samples", found.rmse() / of_four.rmse()));
                }
                worst = worst.max(found.rmse());
                drawn += 1;
            }
        }
        told.push(format!("{roughness}: {worst:.2}"));
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
    assert_eq!(drawn, GATES.len() * MESHES.len() * renderers.len());
    goal(11, &format!("metals by roughness, whole pictures RMSE at most {}", told.join(", ")));
}
