//! The accuracy of whole pictures of faces, and of their mixed pixels, with adaptive samples: against the
//! oracle's points, in encoded colours.

pub mod hairs;
pub mod mirrors;

use meshsnap_render::backend::Renderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::measure::meshes;
use crate::oracle::screen::Screen;
use crate::oracle::surface::rays::shares;
use crate::oracle::surface::srgb;
use crate::oracle::vector::V3;
use crate::support::seen::whole_picture;
use crate::support::truth::{Errors, Gate, cases, goal, points_per_side, renderers, scene};
use crate::support::{scenes, shapes};

/// Goal: pixels that show several faces, or a face and the background.
const MIXED_GOAL: Gate = Gate { rmse: 1.5, max: 16.0, ink: f64::INFINITY };
/// Goal: whole pictures.
const WHOLE_GOAL: Gate = Gate { rmse: 0.5, max: f64::INFINITY, ink: f64::INFINITY };

/// Whole pictures with lines, which err by themselves.
const LINED_GATE: Gate = Gate { rmse: 1.0, max: f64::INFINITY, ink: f64::INFINITY };

/// Points along a pixel's side that tell how many faces it shows.
const TOLD_BY: u32 = 16;

type Case = (&'static str, fn() -> String, &'static str, &'static str);

/// Meshes from 12 to some thousand triangles, of all colours and lights.
const CASES: &[Case] = &[
    ("cube", shapes::cube, "flat", "headlight"),
    ("gear", || shapes::gear(9), "flat", "three-point"),
    ("torus", || shapes::torus(24), "flat", "headlight"),
    ("smooth torus", || shapes::torus(24), "smooth", "three-point"),
    ("smooth gear", || shapes::gear(9), "smooth", "headlight"),
    ("sheet", || shapes::sheet(12), "flat", "three-point"),
    ("ball", || meshes::icosphere(4), "flat", "headlight"),
    ("smooth ball", || meshes::icosphere(3), "smooth", "three-point"),
    ("rings", meshes::rings, "flat", "headlight"),
    ("smooth rings", meshes::rings, "smooth", "headlight"),
    ("boxes", shapes::boxes_on_a_floor, "flat", "three-point"),
    ("stacked boxes", shapes::stacked_boxes, "flat", "headlight"),
    ("metal ball", || meshes::icosphere(4), "flat", "headlight"),
    ("metal gear", || shapes::gear(9), "flat", "studio"),
];

/// Opaque lines over faces: along all of their borders, or along some.
const LINED: &[Case] = &[
    ("wired torus", || shapes::torus(24), "flat", "headlight"),
    ("wired gear", || shapes::gear(9), "flat", "three-point"),
    ("wired smooth torus", || shapes::torus(24), "smooth", "three-point"),
    ("framed sheet", || shapes::sheet(12), "flat", "three-point"),
    ("framed torus", || shapes::torus(24), "flat", "headlight"),
];

/// What a picture should be: linear colours, and which pixels show several faces.
struct Truth {
    colors: Vec<V3>,
    is_mixed: Vec<bool>,
}

impl Truth {
    fn of(plan: &DrawPlan<'_>, is_smooth: bool) -> Self {
        let screen = Screen::new(&scene(plan));
        let colors = whole_picture(plan, is_smooth, points_per_side());
        let size = [plan.width_px, plan.height_px];
        let is_mixed = |i: usize| {
            let shares = shares(&screen, [i as u32 % size[0], i as u32 / size[0]], TOLD_BY);
            shares.len() > 1 || shares.iter().any(|(_, share)| *share < 1.0 - 1e-9)
        };
        Self { is_mixed: (0..colors.len()).map(is_mixed).collect(), colors }
    }

    /// The errors of a picture: of its mixed pixels, and of all.
    fn errors(&self, renderer: &mut dyn Renderer, plan: &DrawPlan<'_>) -> [Errors; 2] {
        let image = renderer.draw(plan, &Deadline::default()).unwrap();
        let errors = |is_told: &dyn Fn(usize) -> bool| {
            let pixels = || (0..self.colors.len()).filter(|&i| is_told(i));
            let drawn = pixels().flat_map(|i| image.rgba[4 * i..4 * i + 3].iter().map(|&v| f64::from(v) / 255.0));
            let truth = pixels().flat_map(|i| self.colors[i].map(srgb::from_linear));
            Errors::of(&drawn.collect::<Vec<_>>(), &truth.collect::<Vec<_>>())
        };
        [errors(&|i| self.is_mixed[i]), errors(&|_| true)]
    }
}

fn plan_of<'a>(mesh: &'a meshsnap_render::mesh::Mesh, (name, _, style, light): &Case) -> DrawPlan<'a> {
    let size = cases("64x56", "320x280");
    let keys = [("size", size), ("style", style), ("light.preset", light), ("samples", "adaptive")];
    let metal = if name.starts_with("metal") {
        [("surface.metallic", "1"), ("surface.roughness", "0.2")]
    } else {
        [("surface.metallic", "0"), ("surface.roughness", "0.6")]
    };
    let mut keys = [&keys[..], &metal].concat();
    if name.starts_with("wired") {
        keys.extend([("wire.thickness", "1.5"), ("wire.hidden", "hide"), ("wire.color", "012")]);
    }
    if name.starts_with("framed") {
        keys.extend([("outline.method", "contour"), ("outline.thickness", "1.5"), ("outline.unit", "px")]);
    }
    let mut plan = scenes::plan(mesh, &scenes::spec(&keys));
    // The oracle knows no hollows.
    plan.occlusion = None;
    plan
}

#[test]
fn whole_pictures_are_near_the_truth() {
    let (mut missed, mut all) = (Vec::new(), [Errors::default(); 2]);
    let mut renderers = renderers();
    for case in CASES {
        let mesh = scenes::mesh(&(case.1)());
        let plan = plan_of(&mesh, case);
        assert!(plan.is_adaptive, "{}", case.0);
        let truth = Truth::of(&plan, case.2 == "smooth");
        for renderer in &mut renderers {
            let [mixed, whole] = truth.errors(renderer.as_mut(), &plan);
            let what = format!("- adaptive, {}, {}", case.0, renderer.kind().name());
            missed.extend(mixed.check(&format!("{what}, mixed"), MIXED_GOAL).err());
            missed.extend(whole.check(&format!("{what}, whole"), WHOLE_GOAL).err());
            all[0].add(&mixed);
            all[1].add(&whole);
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
    let [mixed, whole] = all;
    goal(
        11,
        &format!(
            "{} scenes: mixed pixels RMSE {:.2}, max {:.1}; whole pictures RMSE {:.2}",
            CASES.len(),
            mixed.rmse(),
            mixed.max(),
            whole.rmse()
        ),
    );
}

/// Lines that lie along all borders of faces hide what adaptive samples see better than 16.
#[test]
fn lines_lie_over_mixed_pixels() {
    let (mut missed, mut framed) = (Vec::new(), [Errors::default(); 2]);
    let mut renderers = renderers();
    for case in LINED {
        let mesh = scenes::mesh(&(case.1)());
        let mut plan = plan_of(&mesh, case);
        assert!(plan.is_adaptive && plan.lines.len() == 1, "{}", case.0);
        let truth = Truth::of(&plan, case.2 == "smooth");
        let mut whole = Errors::default();
        for renderer in &mut renderers {
            let errors = truth.errors(renderer.as_mut(), &plan);
            let what = format!("- {}, adaptive, {}", case.0, renderer.kind().name());
            missed.extend(errors[0].check(&format!("{what}, mixed"), MIXED_GOAL).err());
            missed.extend(errors[1].check(&format!("{what}, whole"), LINED_GATE).err());
            [_, whole] = errors;
        }
        (plan.samples, plan.is_adaptive) = (16, false);
        let [_, fixed] = truth.errors(renderers[0].as_mut(), &plan);
        println!("  16 samples: {:.3}", fixed.rmse());
        assert!(whole.rmse() < 1.03 * fixed.rmse(), "{}", case.0);
        if case.0.starts_with("framed") {
            framed[0].add(&whole);
            framed[1].add(&fixed);
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
    assert!(framed[0].rmse() < 0.95 * framed[1].rmse(), "{framed:?}");
}

/// Pictures that are wrong in known ways do not get through: those of 4 samples, and of 16.
#[test]
fn fixed_samples_are_found() {
    let mut renderers = renderers();
    let mut found = [0; 2];
    for case in &CASES[..3] {
        let mesh = scenes::mesh(&(case.1)());
        let mut plan = plan_of(&mesh, case);
        let truth = Truth::of(&plan, false);
        plan.is_adaptive = false;
        for (found, samples) in found.iter_mut().zip([4, 16]) {
            plan.samples = samples;
            let [mixed, whole] = truth.errors(renderers[0].as_mut(), &plan);
            let is_let_through = mixed.is_within(MIXED_GOAL) && whole.is_within(WHOLE_GOAL);
            println!(
                "{} at {samples}: mixed {:.2} max {:.1}, whole {:.2}",
                case.0,
                mixed.rmse(),
                mixed.max(),
                whole.rmse()
            );
            *found += usize::from(!is_let_through);
        }
    }
    assert_eq!(found, [3, 3]);
}
