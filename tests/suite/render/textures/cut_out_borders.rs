//! Cut-out textures and what goes around them: outlines follow what shows of a face's sides, and faces
//! of which nothing shows do not frame the picture.

use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{self, Prepared};
use meshsnap_render::scene::Scene;
use serde_json::{Value, json};

use crate::render::textures::levels::{encode, model};
use crate::support::scenes;

/// The two triangles of a square from `x` on, or of its texture.
fn square(x: f32) -> [[[f32; 3]; 3]; 2] {
    let corner = |dx: f32, y: f32| [x + dx, y, 0.0];
    let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    [[a, b, c], [a, c, d]]
}

/// The part of a texture from `u` on, with v down, on such a square.
fn part(u: f32, width: f32) -> [[[f32; 2]; 3]; 2] {
    square(0.0).map(|triangle| triangle.map(|[x, y, _]| [u + width * x, 1.0 - y]))
}

fn image(shows: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let image = RgbaImage::from_fn(64, 64, |x, y| Rgba([90, 140, 60, if shows(x, y) { 255 } else { 0 }]));
    encode(&DynamicImage::ImageRgba8(image), ImageFormat::Png)
}

fn material(mode: &str) -> Value {
    json!({ "alphaMode": mode, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } })
}

/// Draws as the program does: framed by what shows.
fn draw(mesh: &Mesh, keys: &[(&str, &str)]) -> Image {
    let always = [("view", "front"), ("size", "64"), ("background", "transparent"), ("outline.unit", "px")];
    let spec = scenes::spec(&[&always, keys].concat());
    let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
    let prepared = Prepared::default();
    let framing = plan::framing(mesh, &spec, &prepared, &mut budget, &deadline).unwrap();
    let boxes = prepared.position_boxes(mesh, &mut budget).unwrap();
    let scene = Scene::framed_by(framing.as_deref(), &boxes, mesh, &spec, &mut budget).unwrap();
    let plan = plan::build(&scene, &mut budget, &deadline).unwrap();
    CpuRenderer::new(1).draw(&plan, &deadline).unwrap()
}

/// Pixels that show black, in columns from `from` on.
fn black(image: &Image, from: u32) -> usize {
    let all = (0..image.height_px).flat_map(|y| (from..image.width_px).map(move |x| (x, y)));
    all.filter(|&(x, y)| matches!(image.pixel(x, y), [0..=20, 0..=20, 0..=20, 100..=255])).count()
}

#[test]
fn outlines_follow_what_shows_of_the_sides() {
    let disc = image(|x, y| (x as i32 - 32).pow(2) + (y as i32 - 32).pow(2) < 400);
    let left = image(|x, _| x < 20);
    for style in ["outline", "technical"] {
        let look = [("style", style), ("wire", "null"), ("outline.thickness", "4")];
        let picture =
            |image: &[u8], mode: &str| draw(&model(&square(0.0), &part(0.0, 1.0), image, material(mode)), &look);
        assert_eq!(black(&picture(&disc, "MASK"), 0), 0, "{style}: no side shows anything");
        assert!(black(&picture(&disc, "OPAQUE"), 0) > 400, "{style}: without a mask there are four sides");
        // Of the upper and the lower side something shows, of the right one nothing.
        let half = picture(&left, "MASK");
        assert!(black(&half, 0) > 100 && black(&half, 62) < 10, "{style}");
        // A colour in the request replaces the texture, and its mask.
        let own = [&look[..], &[("surface.color", "#c40")]].concat();
        let own = draw(&model(&square(0.0), &part(0.0, 1.0), &disc, material("MASK")), &own);
        assert!(black(&own, 0) > 400, "{style}: a whole square has a whole outline");
    }
}

#[test]
fn faces_of_which_nothing_shows_do_not_frame_the_picture() {
    // The left half of the image shows, the right one does not.
    let image = image(|x, _| x < 30);
    let corners = [square(0.0), square(3.0)].concat();
    let uvs = [part(0.05, 0.3), part(0.6, 0.3)].concat();
    let keys = [("style", "unlit"), ("camera.margin", "0"), ("camera.projection", "orthographic")];
    let covered = |mode: &str, keys: &[(&str, &str)]| {
        let image = draw(&model(&corners, &uvs, &image, material(mode)), keys);
        image.rgba.chunks(4).filter(|pixel| pixel[3] > 127).count()
    };
    assert!(covered("MASK", &keys) > 64 * 64 - 16, "the square that shows fills the picture");
    assert!(covered("OPAQUE", &keys) < 64 * 40, "two squares with a gap");
    let own = [&keys[..], &[("surface.color", "#c40")]].concat();
    assert!(covered("MASK", &own) < 64 * 40, "without the texture both show");
    // Of nothing at all, nothing is left out.
    let hidden = [part(0.6, 0.3), part(0.6, 0.3)].concat();
    let mesh = model(&corners, &hidden, &image, material("MASK"));
    let spec = scenes::spec(&keys);
    let mut budget = Budget::new(&Limits::default());
    let none = plan::framing(&mesh, &spec, &Prepared::default(), &mut budget, &Deadline::default()).unwrap();
    assert_eq!(none, None);
}

#[test]
fn bad_images_and_small_budgets_are_no_panic() {
    let good = image(|x, _| x < 30);
    let cut = &good[..good.len() / 2];
    for bytes in [&good[..], cut, b"no image", b""] {
        let mut uvs = part(0.0, 1.0);
        for odd in [0.5, f32::MAX, -1e20, 1e9] {
            uvs[0][0][0] = odd;
            draw(&model(&square(0.0), &uvs, bytes, material("MASK")), &[("style", "outline")]);
        }
    }
    let mesh = model(&square(0.0), &part(0.0, 1.0), &good, material("MASK"));
    let spec = scenes::spec(&[("style", "outline")]);
    let mut refused = 0;
    for kib in 0..64 {
        let mut budget = Budget::new(&Limits::default().with(|limits| limits.memory_bytes = kib << 10));
        let framing = plan::framing(&mesh, &spec, &Prepared::default(), &mut budget, &Deadline::default());
        refused += usize::from(framing.is_err_and(|error| error.to_string().contains("cut-out")));
    }
    assert!(refused > 10, "{refused}");
    // A job that was stopped says so.
    let deadline = Deadline::default();
    deadline.stop();
    let mut budget = Budget::new(&Limits::default());
    assert!(plan::framing(&mesh, &spec, &Prepared::default(), &mut budget, &deadline).is_err());
}
