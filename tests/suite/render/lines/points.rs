//! Points: their width, their depth cue, and that both back-ends draw the same.

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::server::Server;

/// A cloud as PLY, each point with more values of these names.
fn cloud(names: &[&str], points: &[Vec<f64>]) -> Vec<u8> {
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    for name in ["x", "y", "z"].iter().chain(names) {
        ply += &format!("property float {name}\n");
    }
    ply += "end_header\n";
    for point in points {
        let values: Vec<String> = point.iter().map(f64::to_string).collect();
        ply += &(values.join(" ") + "\n");
    }
    ply.into_bytes()
}

/// A square of points, turned around the vertical axis.
fn plane(turn_deg: f64) -> Vec<Vec<f64>> {
    let (sin, cos) = (libm::sin(turn_deg.to_radians()), libm::cos(turn_deg.to_radians()));
    let at = |i: i32| f64::from(i) / 40.0 - 1.0;
    (0..=80).flat_map(|i| (0..=80).map(move |j| vec![at(i) * cos, at(j), at(i) * sin])).collect()
}

fn draw(mesh: &Mesh, keys: &[(&str, &str)]) -> Image {
    let spec = scenes::spec(&[&[("view", "front"), ("camera.projection", "orthographic")], keys].concat());
    CpuRenderer::new(2).draw(&scenes::plan(mesh, &spec), &Deadline::default()).unwrap()
}

/// The mean of the green bytes around the middle.
fn middle(image: &Image) -> f64 {
    let (x, y) = (image.width_px / 2, image.height_px / 2);
    let around = (-8..=8).flat_map(|dy| (-8..=8).map(move |dx| (dx, dy)));
    let sum: f64 = around
        .map(|(dx, dy)| f64::from(image.pixel(x.saturating_add_signed(dx), y.saturating_add_signed(dy))[1]))
        .sum();
    sum / 289.0
}

#[test]
fn points_have_the_width_that_is_asked_for() {
    let mesh = scenes::mesh_of(&cloud(&[], &[vec![0.0, 0.0, 0.0], vec![9.0, 9.0, 0.0]])).unwrap();
    let mut sizes = 0;
    for size_px in [0.5_f64, 3.0, 12.0, 64.0] {
        let size = size_px.to_string();
        let keys =
            [("points.size_px", size.as_str()), ("size", "200"), ("samples", "16"), ("background", "transparent")];
        let alpha: f64 = draw(&mesh, &keys).rgba.chunks(4).map(|pixel| f64::from(pixel[3]) / 255.0).sum();
        let expected = 2.0 * std::f64::consts::PI * 0.25 * size_px * size_px;
        assert!((alpha - expected).abs() < 0.06 * expected + 0.15, "{size_px}: {alpha}, not {expected}");
        sizes += 1;
    }
    assert_eq!(sizes, 4);
    let server = Server::start(&[]);
    for size in ["0.4", "65", "nan"] {
        let detail = server.post(&format!("/v1/render?points.size_px={size}"), &cloud(&[], &plane(0.0)));
        assert!(detail.problem(400, "out_of_range").contains("from 0.5 to 64"), "{size}");
    }
}

#[test]
fn a_cloud_is_darker_where_it_turns_away_and_as_bright_as_a_surface_where_it_faces() {
    let at = |turn: f64, keys: &[(&str, &str)]| {
        let mesh = scenes::mesh_of(&cloud(&[], &plane(turn))).unwrap();
        middle(&draw(&mesh, &[&[("size", "160"), ("style", "flat")], keys].concat()))
    };
    let [facing, some, steep] = [0.0, 40.0, 65.0].map(|turn| at(turn, &[]));
    assert!(facing > some + 8.0 && some > steep + 8.0, "{facing} {some} {steep}");
    // Without light there is no cue, and a colour of the request keeps it.
    assert_eq!(at(0.0, &[("style", "unlit")]), at(65.0, &[("style", "unlit")]));
    assert!(at(0.0, &[("surface.color", "c40")]) > at(65.0, &[("surface.color", "c40")]) + 5.0);
}

#[test]
fn normals_of_points_are_used_for_light() {
    let with = |normal: [f64; 3]| {
        let points: Vec<Vec<f64>> = plane(0.0).into_iter().map(|p| [p, normal.to_vec()].concat()).collect();
        let mesh = scenes::mesh_of(&cloud(&["nx", "ny", "nz"], &points)).unwrap();
        ["flat", "smooth"].map(|style| middle(&draw(&mesh, &[("size", "160"), ("style", style)])))
    };
    let (facing, aside) = (with([0.0, 0.0, 1.0]), with([0.8, -0.6, 0.05]));
    assert!(facing.iter().zip(&aside).all(|(facing, aside)| *facing > aside + 30.0), "{facing:?} {aside:?}");
}

#[test]
fn twins_of_points_are_the_same() {
    let Some(gpus) = gpus() else { return };
    let (mut gpu, mut cpu) = (GpuRenderer::new(gpus[0].clone()), CpuRenderer::new(2));
    let colored: Vec<Vec<f64>> =
        plane(50.0).into_iter().enumerate().map(|(i, p)| [p, vec![(i % 256) as f64, 90.0, 200.0]].concat()).collect();
    let ball = |i: i32| {
        let (z, a) = (1.0 - f64::from(i) / 2000.0, f64::from(i) * 2.399_963);
        let r = (1.0 - z * z).max(0.0).sqrt();
        vec![r * libm::cos(a), z, r * libm::sin(a)]
    };
    let ball: Vec<Vec<f64>> = (0..4000).map(ball).collect();
    let mut compared = 0;
    for bytes in [cloud(&[], &ball), cloud(&["red", "green", "blue"], &colored)] {
        let mesh = scenes::mesh_of(&bytes).unwrap();
        for (style, size) in [("smooth", "3"), ("flat", "7.5"), ("unlit", "2"), ("wireframe", "4")] {
            let spec = scenes::spec(&[("style", style), ("points.size_px", size), ("size", "150")]);
            let plan = scenes::plan(&mesh, &spec);
            let pictures = (gpu.draw(&plan, &Deadline::default()), cpu.draw(&plan, &Deadline::default()));
            let like = Likeness::of(&pictures.0.unwrap(), &pictures.1.unwrap());
            assert!(like.is_within(Tolerance::TWINS), "{style}: {like}");
            compared += 1;
        }
    }
    assert_eq!(compared, 8);
}
