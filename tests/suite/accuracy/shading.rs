//! The accuracy of colours in pixels that show one face alone, of the surroundings that metals
//! mirror, and of face normals.

use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, flags};

use crate::oracle::obj::Shape;
use crate::oracle::screen::Screen;
use crate::oracle::surface::light::{face_normal, lit};
use crate::oracle::surface::srgb;
use crate::oracle::surface::surroundings::{mirror_image, mirrored};
use crate::oracle::vector::{V3, cross, dot, length, unit};
use crate::support::scenes;
use crate::support::seen::{corner_normals, lights, material, normal_at, only_triangle};
use crate::support::shapes::{self, Random};
use crate::support::truth::{cases, renderers, scene};

/// A face's normal may be this far from the exact one, radians.
pub const NORMAL_GOAL_RAD: f64 = 1e-6;
/// A byte may be this far from the exact value, which no picture of bytes can be nearer to than
/// half a step.
pub const COLOR_GOAL: f64 = 1.0;
/// Measured now, one normal a face: f32 alone.
pub const FLAT_NOW: f64 = 0.51;
/// Measured now, normals between corners that are snapped to 1/256 px.
pub const SMOOTH_NOW: f64 = 0.65;

/// A colour by triangle and by the place in the picture, with the number of pixels that could be
/// compared.
pub struct ColorErrors {
    pub pixels: usize,
    pub max: f64,
}

/// Compares the pixels that lie wholly in one triangle, which is the only one that is seen there;
/// `normals` are by triangle corner.
pub fn color_errors(plan: &DrawPlan<'_>, image: &Image, normals: &[[V3; 3]]) -> ColorErrors {
    let (material, lights) = (material(plan.surface.as_ref().unwrap()), lights(plan));
    let mut errors = ColorErrors { pixels: 0, max: 0.0 };
    for_each_whole(plan, normals, |[x, y], normal| {
        let want = lit(&material, &lights, normal).map(|v| 255.0 * srgb::from_linear(v));
        let got = image.pixel(x, y);
        for k in 0..3 {
            errors.max = errors.max.max((want[k] - f64::from(got[k])).abs());
        }
        errors.pixels += 1;
    });
    errors
}

/// Calls `each` with the pixels that lie wholly in one triangle, which is the only one that is seen there, and the
/// exact unit normal at their centre, on the viewer's side.
fn for_each_whole(plan: &DrawPlan<'_>, normals: &[[V3; 3]], mut each: impl FnMut([u32; 2], V3)) {
    let scene = scene(plan);
    let screen = Screen::new(&scene);
    for y in 0..plan.height_px {
        for x in 0..plan.width_px {
            let Some(triangle) = only_triangle(&screen, [x, y]) else { continue };
            let center = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            each([x, y], normal_at(&scene, normals, triangle, center));
        }
    }
}

#[test]
fn whole_pixels_have_their_exact_colour() {
    type Case = (&'static str, fn() -> String);
    let shapes: [Case; 4] = [
        ("cube", shapes::cube),
        ("torus", || shapes::torus(24)),
        ("gear", || shapes::gear(9)),
        ("sheet", || shapes::sheet(12)),
    ];
    let mut missed = Vec::new();
    let (mut drawn, mut pixels) = (0, 0);
    let mut renderers = renderers();
    for (name, obj) in shapes {
        let mesh = scenes::mesh(&obj());
        for (style, light, roughness, metallic) in [
            ("flat", "headlight", "0.6", "0"),
            ("flat", "three-point", "0.15", "0"),
            ("smooth", "headlight", "0.3", "0"),
            ("flat", "headlight", "0.2", "1"),
            ("flat", "three-point", "0.7", "0.5"),
            ("smooth", "studio", "0.6", "1"),
        ] {
            let spec = scenes::spec(&[
                ("size", "200x160"),
                ("style", style),
                ("light.preset", light),
                ("surface.roughness", roughness),
                ("surface.metallic", metallic),
                ("surface.color", "c08040"),
            ]);
            let plan = scenes::plan(&mesh, &spec);
            let normals = corner_normals(&scene(&plan), style == "smooth");
            for renderer in &mut renderers {
                let errors = color_errors(&plan, &renderer.draw(&plan, &Deadline::default()).unwrap(), &normals);
                let what = format!("- {name}, {style}, {light}, {metallic} metal, {}", renderer.kind().name());
                let gate = if style == "smooth" { SMOOTH_NOW } else { FLAT_NOW };
                println!(
                    "{what:<44} max {:.3} of {} pixels (gate {gate}, goal {COLOR_GOAL})",
                    errors.max, errors.pixels
                );
                if errors.max > gate {
                    missed.push(format!("{what}: {}", errors.max));
                }
                pixels += errors.pixels;
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, 24 * renderers.len());
    assert!(pixels > 10_000 * renderers.len(), "{pixels}");
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Brightness that metals show, by roughness, may be off from the integral by so much: RMS, of brightness with a mean
/// of about 0.6 and windows of 3.5.
const SURROUNDINGS_GOALS: [(&str, f64); 6] =
    [("0.05", 0.16), ("0.15", 0.15), ("0.3", 0.22), ("0.5", 0.16), ("0.75", 0.15), ("1", 0.12)];
/// Share of the integral by which the mean may be off.
const SURROUNDINGS_MEAN_GOAL: f64 = 0.16;

#[test]
fn metals_mirror_surroundings_as_their_integral_does() {
    const BASE: f64 = 0.2;
    let mesh = scenes::mesh(&shapes::two_balls());
    let base = format!("{:02x}", (255.0 * srgb::from_linear(BASE)).round() as u8).repeat(3);
    let mut missed = Vec::new();
    for (roughness, goal) in SURROUNDINGS_GOALS {
        let spec = scenes::spec(&[
            ("size", "160x120"),
            ("style", "smooth"),
            ("light.preset", "none"),
            ("light.ambient", "1"),
            ("light.ambient_occlusion", "0"),
            ("surface.metallic", "1"),
            ("surface.roughness", roughness),
            ("surface.color", &base),
        ]);
        let plan = scenes::plan(&mesh, &spec);
        let axes = [plan.projection.screen_right, plan.projection.screen_up, plan.projection.to_viewer];
        let axes = axes.map(|axis| axis.map(f64::from));
        let roughness: f64 = roughness.parse().unwrap();
        for renderer in &mut renderers() {
            let image = renderer.draw(&plan, &Deadline::default()).unwrap();
            let (mut squares, mut sum, mut want_sum, mut pixels) = (0.0, 0.0, 0.0, 0.0);
            for_each_whole(&plan, &corner_normals(&scene(&plan), true), |[x, y], normal| {
                let image_of_viewer = mirror_image(normal, axes[2]);
                let want = mirrored(axes.map(|axis| dot(axis, image_of_viewer)), roughness);
                let rise = (1.0 - dot(normal, axes[2]).clamp(0.0, 1.0)).powi(5) * (1.0 - roughness);
                let shown = srgb::to_linear(f64::from(image.pixel(x, y)[0]) / 255.0);
                let brightness = shown / (BASE * (1.0 - rise) + rise);
                // Light above 0.8 is rolled off.
                if shown < 0.79 {
                    squares += (brightness - want).powi(2);
                    sum += brightness;
                    want_sum += want;
                    pixels += 1.0;
                }
            });
            let rms = f64::sqrt(squares / pixels);
            println!(
                "- roughness {roughness:<5} {:<4} RMS {rms:.3} (goal {goal}), mean {:.2} of {:.2}",
                renderer.kind().name(),
                sum / pixels,
                want_sum / pixels
            );
            assert!(pixels > 4000.0, "{pixels}");
            if rms > goal || (sum - want_sum).abs() > SURROUNDINGS_MEAN_GOAL * want_sum {
                missed.push(format!("roughness {roughness}: {rms}"));
            }
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Slivers up to `aspect` times as long as high, all alike to look at, far from the origin.
pub fn slivers(aspect: f64, offset: f64, random: &mut Random) -> Shape {
    let mut shape = Shape::default();
    for _ in 0..40 {
        let axis = unit([0; 3].map(|_| random.range(-1.0, 1.0)));
        let side = unit(cross(axis, [0.3, -0.5, 0.8]));
        let start = [0; 3].map(|_| offset + random.range(-1.0, 1.0));
        let at = |along: f64, across: f64| std::array::from_fn(|k| start[k] + along * axis[k] + across * side[k]);
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(random.range(0.2, 0.8), 1.0 / aspect)];
        let corners = corners.map(|p| shape.vertex(p));
        shape.polygons.push(corners.to_vec());
    }
    shape
}

/// The largest angle between a plan's face normals and the exact ones of the file, radians.
pub fn normal_error(shape: &Shape, face_normals: &[[f32; 3]]) -> f64 {
    assert_eq!(shape.polygons.len(), face_normals.len());
    let angle = |(polygon, normal): (&Vec<usize>, &[f32; 3])| {
        let exact = face_normal([0, 1, 2].map(|k| shape.vertices[polygon[k]])).unwrap();
        let normal = normal.map(f64::from);
        length(cross(exact, normal)).atan2(dot(exact, normal))
    };
    shape.polygons.iter().zip(face_normals).map(angle).fold(0.0, f64::max)
}

#[test]
fn normals_of_slivers_are_exact() {
    let mut missed = Vec::new();
    let (mut measured, mut random) = (0, Random(21));
    for aspect in [1e1, 1e3, 1e5, 1e7] {
        for offset in [0.0, 1e3, 1e5] {
            let mut worst = 0.0_f64;
            for _ in 0..cases(5, 100) {
                let shape = slivers(aspect, offset, &mut random);
                let mesh = scenes::mesh(&shape.text());
                let plan_spec = scenes::spec(&[("style", "flat")]);
                let plan = scenes::plan(&mesh, &plan_spec);
                let surface = plan.surface.as_ref().unwrap();
                assert!(surface.all_flags() & flags::FACE_NORMALS != 0);
                worst = worst.max(normal_error(&shape, &surface.face_normals));
            }
            let what = format!("- slivers of aspect {aspect:e}, {offset:e} away");
            println!("{what:<44} normal off by {worst:.2e} rad (gate {NORMAL_GOAL_RAD:e})");
            if worst > NORMAL_GOAL_RAD {
                missed.push(format!("{what}: {worst:e} rad"));
            }
            measured += 1;
        }
    }
    assert_eq!(measured, 12);
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
