//! `surface.facing_opacity` and the style `xray`: alpha follows the formula of the angle between
//! normal and ray, in every shading and projection, and the back-ends agree.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes;

fn draw(obj: &str, keys: &[(&str, &str)]) -> Image {
    let mesh = scenes::mesh(obj);
    let spec = scenes::spec(keys);
    drawn(&scenes::plan(&mesh, &spec))
}

fn drawn(plan: &DrawPlan<'_>) -> Image {
    let image = CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap();
    let other = CpuRenderer::with_isa(2, Isa::baseline()).draw(plan, &Deadline::default()).unwrap();
    assert!(image.rgba == other.rgba);
    image
}

/// Alpha as a byte, by the cosine of the angle.
fn alpha(least: f64, cosine: f64) -> u8 {
    let grazing = 1.0 - cosine;
    libm::round(255.0 * (least + (1.0 - least) * grazing * grazing)) as u8
}

#[test]
fn alpha_is_that_of_the_angle() {
    let mut cases = 0;
    for degrees in [0.0_f64, 30.0, 60.0, 80.0] {
        // A square that turns around the x axis, seen from both sides.
        let (sine, cosine) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
        let corner = |x: f64, y: f64| format!("v {x} {} {}\n", y * cosine, y * sine);
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)].concat();
        for face in ["f 1 2 3 4\n", "f 4 3 2 1\n"] {
            for shading in ["flat", "smooth", "unlit"] {
                for least in [0.0, 0.25] {
                    let opacity = least.to_string();
                    let keys = [
                        ("size", "64"),
                        ("view", "front"),
                        ("camera.projection", "orthographic"),
                        ("background", "transparent"),
                        ("surface.shading", shading),
                        ("surface.facing_opacity", opacity.as_str()),
                    ];
                    let [.., found] = draw(&format!("{corners}{face}"), &keys).pixel(32, 32);
                    let wanted = alpha(least, cosine);
                    assert!(found.abs_diff(wanted) <= 1, "{degrees} {shading} {least}: {found}, not {wanted}");
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, 48);
}

#[test]
fn the_angle_is_that_of_each_pixels_ray() {
    let square = "v -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n";
    let keys = [
        ("size", "100"),
        ("camera.eye", "0,0,1"),
        ("camera.target", "0,0,0"),
        ("camera.fov_deg", "90"),
        ("background", "transparent"),
        ("style", "xray"),
    ];
    let image = draw(square, &keys);
    for (x, y) in [(50, 50), (0, 50), (99, 99), (20, 70), (5, 3)] {
        let [right, down] = [x, y].map(|v| (f64::from(v) + 0.5 - 50.0) / 50.0);
        let cosine = 1.0 / (1.0 + right * right + down * down).sqrt();
        let [r, g, b, found] = image.pixel(x, y);
        let wanted = alpha(0.07, cosine);
        assert!(found.abs_diff(wanted) <= 1, "{x}, {y}: {found}, not {wanted}");
        // One colour, without light; less of it is known where it is faint.
        let near = |v: u8, of: u8| v.abs_diff(of) <= 255 / found.max(1) + 1;
        assert!(near(r, 0x1d) && near(g, 0x5c) && near(b, 0x96), "{x}, {y}: {r} {g} {b}");
    }
}

#[test]
fn what_lies_behind_shines_through() {
    let [front, both] = ["f 1 2 3 4\n", "f 1 2 3 4\nf 5 6 7 8\n"].map(|faces| {
        let corners = |z: i32| format!("v -1 -1 {z}\nv 1 -1 {z}\nv 1 1 {z}\nv -1 1 {z}\n");
        let keys = [("size", "64"), ("view", "front"), ("background", "transparent"), ("style", "xray")];
        f64::from(draw(&format!("{}{}{faces}", corners(1), corners(-1)), &keys).pixel(32, 32)[3]) / 255.0
    });
    assert!((both - (1.0 - (1.0 - front) * (1.0 - front))).abs() < 3.0 / 255.0, "{front} {both}");
}

#[test]
fn xray_is_the_same_on_both_back_ends() {
    let Some(gpus) = gpus() else { return };
    let mut renderer = GpuRenderer::new(gpus[0].clone());
    let looks: [&[(&str, &str)]; 5] = [
        &[("style", "xray")],
        &[("style", "xray"), ("surface.shading", "smooth"), ("light.preset", "three-point"), ("samples", "1")],
        &[("style", "flat"), ("surface.facing_opacity", "0.3"), ("camera.projection", "orthographic")],
        &[("style", "flat"), ("surface.normals", "derivative"), ("surface.facing_opacity", "0")],
        &[("style", "technical"), ("surface.facing_opacity", "0.1"), ("background", "#fff..#dde")],
    ];
    for keys in looks {
        for obj in [shapes::torus(36), shapes::gear(9)] {
            let mesh = scenes::mesh(&obj);
            let spec = scenes::spec(&[&[("size", "120x90")], keys].concat());
            let plan = scenes::plan(&mesh, &spec);
            let gpu = renderer.draw(&plan, &Deadline::default()).unwrap();
            Likeness::of(&drawn(&plan), &gpu).assert(Tolerance::TWINS, &format!("{keys:?}"));
        }
    }
}
