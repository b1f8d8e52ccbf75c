//! Lines in combinations of edge class, hidden mode, contour and light, alike on both back-ends
//! (half of the combinations; all of them in a long run). Also single looks, each against the
//! picture that it should equal.

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::{Image, srgb8_thresholds};
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::spec::color::Rgba;
use meshsnap_render::spec::{Hidden, Outline, OutlineMethod, OutlineUnit, Spec, WireEdges};

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{scenes, shapes, truth};

const BLACK: Rgba = Rgba([0.0, 0.0, 0.0, 1.0]);

fn contour(thickness: f32) -> Option<Outline> {
    let thickness = Some(thickness);
    Some(Outline { method: OutlineMethod::Contour, color: BLACK, thickness, unit: OutlineUnit::Px, min_length: None })
}

fn draw(mesh: &Mesh, spec: &Spec) -> Image {
    CpuRenderer::new(1).draw(&scenes::plan(mesh, spec), &Deadline::default()).unwrap()
}

const CAMERAS: &[&[(&str, &str)]] = &[
    &[],
    &[("camera.projection", "orthographic"), ("view", "front")],
    &[("camera.eye", "0.2,0.35,0.3"), ("camera.target", "-0.8,0,-0.9"), ("camera.fov_deg", "80")],
];

#[test]
fn every_class_hidden_mode_contour_and_light_agrees() {
    let Some(gpus) = gpus() else { return };
    let meshes = [scenes::mesh(&shapes::gear(9)), scenes::mesh(&shapes::sheet(9)), scenes::mesh(shapes::FIN)];
    let mut gpu = GpuRenderer::new(Arc::clone(&gpus[0]));
    let mut cases = 0;
    for edges in [WireEdges::Triangles, WireEdges::Polygons, WireEdges::Feature, WireEdges::Boundary] {
        for hidden in [Hidden::Hide, Hidden::Show, Hidden::Fade] {
            // Every other combination, with and without each bit; all of them in a long run.
            let parity = cases as u32 / 4 % 2;
            for bits in (0..8_usize).filter(|bits| truth::is_long() || bits.count_ones() % 2 == parity) {
                let camera = CAMERAS[cases % 3];
                let samples = ["1", "4", "8", "16"][(bits & 4) / 2 + cases / 5 % 2];
                let keys = [("style", "wire"), ("size", "150x110"), ("samples", samples), ("wire.thickness", "2.5")];
                let mut spec = scenes::spec(&[&keys[..], camera].concat());
                let wire = spec.layers.wire.as_mut().unwrap();
                (wire.edges, wire.hidden, wire.lit) = (edges, hidden, bits & 1 != 0);
                wire.color = Rgba([0.8, 0.1, 0.05, 1.0]);
                spec.layers.outline = contour(3.0).filter(|_| bits & 2 != 0);
                let mesh = &meshes[cases / 3 % 3];
                let picture = gpu.draw(&scenes::plan(mesh, &spec), &Deadline::default()).unwrap();
                let name = format!("{edges:?} {hidden:?} {bits} {camera:?}");
                Likeness::of(&draw(mesh, &spec), &picture).assert(Tolerance::TWINS, &name);
                cases += 1;
            }
        }
    }
    assert_eq!(cases, truth::cases(48, 96));
}

#[test]
fn a_contour_does_not_depend_on_winding() {
    let keys = [("style", "unlit"), ("size", "150x110"), ("surface.color", "fff")];
    let mut spec = scenes::spec(&keys);
    spec.layers.outline = contour(3.0);
    let obj = shapes::gear(9);
    let turned: String = obj
        .lines()
        .enumerate()
        .map(|(i, line)| match line.strip_prefix("f ") {
            Some(face) if i % 3 == 0 => {
                let corners: Vec<&str> = face.split(' ').collect();
                format!("f {} {} {} {}\n", corners[2], corners[1], corners[0], corners[3])
            }
            _ => format!("{line}\n"),
        })
        .collect();
    let pictures = [&obj, &turned].map(|obj| draw(&scenes::mesh(obj), &spec));
    assert!(pictures[0].rgba.chunks(4).filter(|p| p[0] == 0).count() > 100);
    let like = pictures[0].rgba.chunks(4).zip(pictures[1].rgba.chunks(4)).filter(|(a, b)| a != b).count();
    // Other diagonals of quads that are not quite flat.
    assert!(like * 100 < 150 * 110, "{like} pixels differ");
}

#[test]
fn a_light_that_changes_nothing_leaves_the_line_as_it_was() {
    let mut cases = 0;
    for style in ["unlit", "wire"] {
        let keys = [("style", style), ("size", "150x110"), ("wire.color", "c03020"), ("wire.thickness", "3")];
        let mut spec = scenes::spec(&keys);
        let mesh = scenes::mesh(&shapes::torus(20));
        let plain = draw(&mesh, &spec);
        spec.layers.wire.as_mut().unwrap().lit = true;
        let changed = draw(&mesh, &spec) != plain;
        assert_eq!(changed, style == "wire", "{style}");
        cases += 1;
    }
    assert_eq!(cases, 2);
}

#[test]
fn transparent_wireframes_composite_to_the_opaque_picture() {
    let mesh = scenes::mesh(&shapes::torus(20));
    let keys = [("style", "wireframe"), ("size", "150x110"), ("wire.color", "c03020"), ("background", "transparent")];
    let mut spec = scenes::spec(&keys);
    let over = draw(&mesh, &spec);
    // The middle of each byte's interval, in linear light.
    let thresholds = srgb8_thresholds();
    let linear = |byte: u8| {
        let v = f64::from(byte) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let encode = |v: f64| thresholds.partition_point(|&t| f64::from(t) <= v) as i32;
    let mut compared = 0;
    for page in [0.0_f32, 1.0] {
        spec.image.background = Rgba([page, page, page, 1.0]).into();
        let opaque = draw(&mesh, &spec);
        for (a, b) in over.rgba.chunks(4).zip(opaque.rgba.chunks(4)) {
            let alpha = f64::from(a[3]) / 255.0;
            for k in 0..3 {
                let composed = linear(a[k]) * alpha + f64::from(page) * (1.0 - alpha);
                // A step of alpha is up to a dozen steps of sRGB near black.
                let slack = (encode(composed + 0.7 / 255.0) - encode((composed - 0.7 / 255.0).max(0.0))).max(2);
                assert!((encode(composed) - i32::from(b[k])).abs() <= slack, "{a:?} over {page} is not {b:?}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 2 * 3 * 150 * 110);
}

/// In a box's default view, the edge behind its top lies along that face's diagonal, which no file
/// has and no style draws.
#[test]
fn what_lies_behind_a_diagonal_is_hidden() {
    const TOP_AND_WALLS: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
        f 4 8 7 3\nf 1 4 3 2\nf 5 6 7 8\nf 1 5 8 4\nf 2 3 7 6\n";
    let whole = format!("{TOP_AND_WALLS}f 1 2 6 5\n");
    let keys = [("style", "wireframe"), ("size", "160"), ("wire.edges", "polygons"), ("wire.hidden", "hide")];
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(1))];
    renderers.extend(gpus().map(|gpus| Box::new(GpuRenderer::new(Arc::clone(&gpus[0]))) as Box<dyn Renderer>));
    let mut cases = 0;
    for azimuth in ["45", "135", "225", "315", "50"] {
        let spec = scenes::spec(&[&keys[..], &[("camera.azimuth_deg", azimuth)]].concat());
        for renderer in &mut renderers {
            // Of a closed box no edge is asked that looks away; of an open one all are, and its
            // faces hide the same.
            let [closed, open] = [&whole, TOP_AND_WALLS].map(|obj| {
                let mesh = scenes::mesh(obj);
                renderer.draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap()
            });
            assert!(closed == open, "{azimuth} degrees, {}", renderer.kind().name());
            cases += 1;
        }
    }
    assert_eq!(cases, 5 * renderers.len());
}
