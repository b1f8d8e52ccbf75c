//! Adaptive samples: a mixed pixel, near which faces of different colours meet, is what its
//! coverage points see. Every other pixel is what 4 samples see, or 16 in pictures with layers.
//! Shortcuts, threads, instruction sets and bands change no byte, and both back-ends agree.

mod layers;
mod quarters;
mod steps;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, pass_mask};

use crate::support::gpus::{gpus, gpus_of_case, own_gpus};
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes::{self, SCENES};
use crate::support::shapes::{self, Random};

fn draw(renderer: &mut dyn Renderer, plan: &DrawPlan<'_>) -> Image {
    renderer.draw(plan, &Deadline::default()).unwrap()
}

/// The CPU's with shortcuts and without, and that of each GPU.
fn every_renderer() -> Vec<Box<dyn Renderer>> {
    let mut all: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(1)), Box::new(CpuRenderer::plain(1))];
    all.extend(gpus().into_iter().flatten().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>));
    all
}

/// Each key once, with its last value.
pub fn last_of_each<'a>(keys: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    let is_last = |i: usize| keys[i + 1..].iter().all(|other| other.0 != keys[i].0);
    (0..keys.len()).filter(|&i| is_last(i)).map(|i| keys[i]).collect()
}

/// Adaptive plans of all scenes that can have one.
fn each_plan(mut each: impl FnMut(&str, &mut DrawPlan<'_>)) {
    let (mut plans, mut layered) = (0, 0);
    for scene in SCENES {
        let mesh = scenes::mesh(&(scene.obj)());
        let mut spec = scene.spec();
        spec.image.samples = meshsnap_render::spec::Samples::Adaptive;
        let mut plan = scenes::plan(&mesh, &spec);
        let is_fixed = plan.warnings.iter().any(|warning| warning.code == "samples_fixed");
        let is_many = is_fixed || plan.peeling.is_some();
        assert_eq!((plan.is_adaptive, plan.samples), (!is_fixed, if is_many { 16 } else { 4 }), "{}", scene.name);
        let shows_opaque = plan.peeling.as_ref().is_none_or(|pass| !pass.wires_only && has_opaque(&plan));
        assert_eq!(is_fixed, !plan.is_shaded() || !shows_opaque, "{}", scene.name);
        layered += usize::from(!is_fixed && is_many);
        if plan.is_adaptive {
            each(scene.name, &mut plan);
            plans += 1;
        }
    }
    assert!(plans > 20 && layered > 0, "{plans}, {layered} of them with layers");
}

/// True if some triangle hides what lies behind it.
fn has_opaque(plan: &DrawPlan<'_>) -> bool {
    plan.pass_masks.iter().any(|mask| mask & pass_mask::SURFACE != 0)
}

/// Shortcuts, threads (and with them the heights of bands) and instruction sets.
#[test]
fn every_way_of_drawing_gives_the_same_bytes() {
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    others.extend([1, 3, 7].map(CpuRenderer::new));
    each_plan(|name, plan| {
        let want = draw(&mut plain, plan);
        let mixed = plain.draw_times().mixed_pixels;
        assert!(mixed > 100 || plan.peeling.is_some(), "{name}: {mixed}");
        for renderer in &mut others {
            assert!(draw(renderer, plan) == want, "{name}");
            assert_eq!(renderer.draw_times().mixed_pixels, mixed, "{name}");
        }
    });
}

/// Pixels with up to a hundred faces in each, and with few.
#[test]
fn pixels_of_many_faces_have_the_same_bytes_too() {
    let mesh = scenes::mesh(&shapes::torus(160));
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    let (mut smallest, mut largest) = (u64::MAX, 0);
    for (style, size) in [("flat", "24"), ("flat", "90"), ("smooth", "40"), ("smooth", "200")] {
        let plan = scenes::plan(&mesh, &scenes::spec(&[("size", size), ("style", style), ("samples", "adaptive")]));
        let want = draw(&mut plain, &plan);
        let mixed = plain.draw_times().mixed_pixels;
        (smallest, largest) = (smallest.min(mixed), largest.max(mixed));
        for renderer in &mut others {
            assert!(draw(renderer, &plan) == want, "{style}, {size} px");
        }
    }
    assert!(smallest > 30 && largest > 600, "{smallest} to {largest} mixed pixels");
}

/// A cloud of hairs: some leave the picture, or pass the eye.
fn hairs(random: &mut Random) -> String {
    let mut shape = crate::oracle::obj::Shape::default();
    for _ in 0..400 {
        let start: [f64; 3] = [0; 3].map(|_| random.range(-1.0, 1.0));
        let step: [f64; 3] = [0; 3].map(|_| random.range(-0.6, 0.6));
        let side: [f64; 3] = [0; 3].map(|_| random.range(-0.004, 0.004));
        let corner = |along: f64, across: f64| std::array::from_fn(|k| start[k] + along * step[k] + across * side[k]);
        let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)].map(|p| shape.vertex(p));
        shape.polygons.push(corners.to_vec());
    }
    shape.text()
}

/// Thin faces at all angles: culled, outlined, lined, out of the picture, in bands, and across wide pictures.
#[test]
fn hairs_have_the_same_pixels_everywhere() {
    let mesh = scenes::mesh(&hairs(&mut Random(77)));
    let inside: &[(&str, &str)] =
        &[("camera.eye", "0.1,0.2,0.9"), ("camera.target", "0,0,0"), ("camera.fov_deg", "80")];
    let looks: [&[(&str, &str)]; 7] = [
        &[("size", "300x200")],
        &[("size", "300x200"), ("scene.ground", "shadow")],
        &[("size", "300x200"), ("surface.cull", "back"), ("surface.color", "c33")],
        &[("size", "300x200"), ("style", "outline"), ("outline.method", "hull")],
        &[("size", "200x300"), ("style", "technical")],
        &[("size", "4096x16"), ("camera.margin", "0")],
        &[("size", "64x1500"), ("style", "unlit")],
    ];
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    others.push(CpuRenderer::new(3));
    let mut gpus: Vec<GpuRenderer> = gpus().into_iter().flatten().map(|gpu| GpuRenderer::new(gpu.clone())).collect();
    for (look, view) in looks.iter().flat_map(|look| [(look, &[][..]), (look, inside)]) {
        let keys = [&[("style", "flat")], *look, view, &[("samples", "adaptive")]].concat();
        // The last of equal keys counts.
        let plan = scenes::plan(&mesh, &scenes::spec(&last_of_each(&keys)));
        assert!(plan.is_adaptive, "{keys:?}");
        let want = draw(&mut plain, &plan);
        let mixed = plain.draw_times().mixed_pixels;
        assert!(mixed > 100, "{keys:?}: {mixed}");
        for renderer in &mut others {
            assert!(draw(renderer, &plan) == want, "{keys:?}");
        }
        for renderer in &mut gpus {
            let found = draw(renderer, &plan);
            assert_eq!(renderer.draw_times().mixed_pixels, mixed, "{keys:?}");
            Likeness::of(&found, &want).assert(Tolerance::TWINS, &format!("{keys:?}"));
        }
    }
}

/// Faces with colours between their corners are alike where their normals are, as those of one colour.
#[test]
fn faces_that_share_a_colour_at_their_corners_go_on() {
    let plain = shapes::torus(48);
    let colored: String = plain
        .lines()
        .map(|line| format!("{line}{}\n", if line.starts_with("v ") { " 0.8 0.5 0.2" } else { "" }))
        .collect();
    let spec = scenes::spec(&[("style", "flat"), ("samples", "adaptive"), ("size", "240")]);
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(2))];
    renderers
        .extend(gpus().into_iter().flatten().map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>));
    for renderer in &mut renderers {
        let mixed = [&plain, &colored].map(|obj| {
            let mesh = scenes::mesh(obj);
            draw(renderer.as_mut(), &scenes::plan(&mesh, &spec));
            renderer.draw_times().mixed_pixels
        });
        // Faces that share no corner may look alike.
        assert!(mixed[0] > 500 && 20 * mixed[1] <= 21 * mixed[0], "{mixed:?}");
    }
}

/// What a picture leaves in buffers is not seen in the next one.
#[test]
fn fixed_samples_after_adaptive_ones_are_as_if_alone() {
    let mesh = scenes::mesh(&shapes::torus(24));
    let keys = [("style", "wire"), ("samples", "adaptive"), ("size", "200"), ("wire.thickness", "0.6")];
    let mut plan = scenes::plan(&mesh, &scenes::spec(&keys));
    let mut renderer = CpuRenderer::new(2);
    let adaptive = draw(&mut renderer, &plan);
    plan.is_adaptive = false;
    let want = draw(&mut CpuRenderer::new(2), &plan);
    assert!(draw(&mut renderer, &plan) == want);
    assert!(adaptive != want);
}

/// Several rounds of points, and several bands of a picture.
#[test]
fn large_pictures_are_drawn_in_rounds_and_bands() {
    let Some(gpus) = gpus() else { return };
    let mesh = scenes::mesh(&shapes::torus(50));
    let keys = [("style", "flat"), ("samples", "adaptive"), ("size", "2000x1200"), ("camera.margin", "0")];
    // All borders between faces are mixed.
    let keys = [&keys[..], &[("surface.debug", "face-orientation")]].concat();
    let plan = scenes::plan(&mesh, &scenes::spec(&keys));
    let (mut cpu, mut gpu) = (CpuRenderer::new(2), GpuRenderer::new(gpus[0].clone()));
    let (want, found) = (draw(&mut cpu, &plan), draw(&mut gpu, &plan));
    let mixed = cpu.draw_times().mixed_pixels;
    assert!(mixed > 4 * 32_768, "{mixed} mixed pixels may be one round for each band");
    assert_eq!(gpu.draw_times().mixed_pixels, mixed);
    Likeness::of(&found, &want).assert(Tolerance::TWINS, "2000 x 1200 px");
}

/// More triangles in a few pixels than lists have room for, and in a single one; and so many in each that they are told
/// apart in another way. A GPU's lists have room for 262,144 triangles of small pictures, and 4,096 of a pixel; 64 are told
/// apart as sets. Pictures that need more room are drawn once more.
#[test]
fn crowded_pixels_have_the_same_bytes() {
    let (mut plain, mut quick) = (CpuRenderer::plain(1), CpuRenderer::new(2));
    let mut gpus: Vec<GpuRenderer> = own_gpus().into_iter().flatten().map(GpuRenderer::new).collect();
    for (count, size, is_again) in [
        (520, "2", true),
        (520, "9", true),
        (120, "2", true),
        (60, "9", false),
        (24, "9", false),
        // Many pixels, so that their points are drawn in several rounds.
        (520, "420", true),
    ] {
        let mesh = scenes::mesh(&shapes::torus(count));
        let keys = [("size", size), ("style", "flat"), ("samples", "adaptive"), ("camera.margin", "0")];
        let all_borders = [("surface.debug", "face-orientation")];
        let keys = [&keys[..], if size == "420" { &all_borders } else { &[] }].concat();
        let plan = scenes::plan(&mesh, &scenes::spec(&keys));
        let (want, name) = (draw(&mut plain, &plan), format!("torus of {count}, {size} px"));
        let mixed = plain.draw_times().mixed_pixels;
        assert!(draw(&mut quick, &plan) == want, "{name}");
        assert!(mixed >= 4, "{name}");
        assert!(size != "420" || mixed > 2 * 32_768, "{mixed} mixed pixels are one round");
        for gpu in &mut gpus {
            let before = gpu.gpu().pictures_drawn_again();
            let found = draw(gpu, &plan);
            assert_eq!(gpu.gpu().pictures_drawn_again() - before, usize::from(is_again), "{name}");
            assert_eq!(gpu.draw_times().mixed_pixels, mixed, "{name}");
            Likeness::of(&found, &want).assert(Tolerance::TWINS, &name);
        }
    }
}

/// Both back-ends find the same mixed pixels, and draw them alike. With 64-bit atomics and without.
#[test]
fn both_back_ends_draw_the_same_mixed_pixels() {
    if gpus().is_none() {
        return;
    }
    let mut cpu = CpuRenderer::new(2);
    let mut compared = 0;
    each_plan(|name, plan| {
        let want = draw(&mut cpu, plan);
        for gpu in gpus_of_case(compared) {
            let mut renderer = GpuRenderer::new(gpu.clone());
            let found = draw(&mut renderer, plan);
            assert_eq!(renderer.draw_times().mixed_pixels, cpu.draw_times().mixed_pixels, "{name}");
            Likeness::of(&found, &want).assert(Tolerance::TWINS, name);
        }
        compared += 1;
    });
    assert!(compared > 20, "{compared}");
}

/// Pixels that are not mixed have the bytes of fixed samples, and many pixels are not mixed. Metals that mirror sharply are
/// shaded in each quarter of all pixels: they are compared in quarters.rs.
#[test]
fn smooth_interiors_are_left_alone() {
    let mut renderer = CpuRenderer::new(2);
    let (mut compared, mut quartered) = (0, 0);
    each_plan(|name, plan| {
        if plan.has_quarters() {
            quartered += 1;
            return;
        }
        compared += 1;
        let adaptive = draw(&mut renderer, plan);
        let mixed = renderer.draw_times().mixed_pixels as usize;
        plan.is_adaptive = false;
        let differing = Likeness::of(&adaptive, &draw(&mut renderer, plan)).differing();
        assert_eq!(renderer.draw_times().mixed_pixels, 0);
        // Lines or layers may lie over all borders of faces.
        let is_seen = differing > 50 || !plan.lines.is_empty() || plan.peeling.is_some();
        assert!(is_seen && differing <= mixed, "{name}: {differing} differ, {mixed} are mixed");
        let all = (plan.width_px * plan.height_px) as usize;
        assert!(mixed < all / 2 || name.contains("sheet"), "{name}: {mixed} of {all}");
    });
    assert!(compared > 20 && quartered < 3, "{compared} {quartered}");
}

/// A pixel at the border is that of the same place in a larger picture.
#[test]
fn borders_leave_no_trace() {
    const MORE_PX: u32 = 64;
    let mut renderer = CpuRenderer::new(2);
    let mut beyond = 0;
    for (obj, style) in [(shapes::torus(24), "flat"), (shapes::gear(9), "flat"), (shapes::torus(14), "smooth")] {
        let mesh = scenes::mesh(&obj);
        let keys =
            [("size", "150x110"), ("style", style), ("samples", "adaptive"), ("camera.projection", "orthographic")];
        let spec = scenes::spec(&[&keys[..], &[("camera.height", "0.9"), ("camera.azimuth_deg", "20")]].concat());
        let mut plan = scenes::plan(&mesh, &spec);
        assert!(plan.is_adaptive && plan.margin_px > 0);
        let small = draw(&mut renderer, &plan);
        (plan.width_px, plan.height_px) = (plan.width_px + 2 * MORE_PX, plan.height_px + 2 * MORE_PX);
        let large = draw(&mut renderer, &plan);
        let mut middle = small.clone();
        for (i, pixel) in middle.rgba.chunks_mut(4).enumerate() {
            let [x, y] = [i as u32 % small.width_px + MORE_PX, i as u32 / small.width_px + MORE_PX];
            pixel.copy_from_slice(&large.pixel(x, y));
        }
        // A moved origin of pixel coordinates rounds differently.
        Likeness::of(&middle, &small).assert(Tolerance { max: 1, share: 0.002 }, style);
        beyond += 1;
    }
    assert_eq!(beyond, 3);
}

/// Snapped corners, 1/256 px from the picture's upper left corner.
type Corners = [[i64; 2]; 3];

/// True if a point (1/512 px) belongs to a triangle by the top-left rule.
fn owns(corners: &Corners, p: [i64; 2]) -> bool {
    let [a, b, c] = corners.map(|c| c.map(|v| 2 * v));
    let cross = |a: [i64; 2], b: [i64; 2], p: [i64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let area = cross(a, b, c);
    let [a, b, c] = if area > 0 { [a, b, c] } else { [a, c, b] };
    area != 0
        && [(a, b), (b, c), (c, a)].into_iter().all(|(a, b)| {
            let is_top_left = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
            let side = cross(a, b, p);
            side > 0 || (side == 0 && is_top_left)
        })
}

/// White triangles on black: alpha counts points, or all of 4 samples where a pixel is not mixed.
#[test]
fn mixed_pixels_count_their_points() {
    const SIZE_PX: [u32; 2] = [48, 40];
    let mut random = Random(7);
    let mut renderers = every_renderer();
    let renderers_count = renderers.len();
    let (mut partial, mut whole) = (0, 0);
    for size_px in [0.4, 3.0, 20.0, 400.0] {
        let (mut positions, mut triangles, mut snapped) = (Vec::new(), Vec::new(), Vec::<Corners>::new());
        for t in 0..12 {
            let at = [random.range(4.0, 44.0), random.range(4.0, 36.0)];
            let corners =
                [0; 3].map(|_| [0, 1].map(|k| ((at[k] + size_px * random.range(-1.0, 1.0)) * 256.0).round() as i64));
            for [x, y] in corners {
                let from_center = [x - 128 * 48, y - 128 * 40].map(|v| v as f32 / 256.0);
                positions.push([from_center[0], from_center[1], 0.5]);
            }
            triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
            snapped.push(corners);
        }
        let mut plan = scenes::screen_plan(SIZE_PX, 4, 1.0, &positions, &triangles);
        (plan.is_adaptive, plan.margin_px, plan.background) = (true, 8, [0.0; 4]);
        for renderer in &mut renderers {
            let image = draw(renderer.as_mut(), &plan);
            for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
                let place = |i: i64| [2 * (256 * i64::from(x) + i) + 1, 2 * (256 * i64::from(y) + i * 181 % 256) + 1];
                let count = (0..256).filter(|&i| snapped.iter().any(|corners| owns(corners, place(i)))).count();
                let alpha = usize::from(image.pixel(x, y)[3]);
                if alpha == 0 || alpha == 255 {
                    // A few of the points may be missed where no sample near the pixel sees anything else.
                    whole += usize::from(count == 256 * alpha / 255);
                } else {
                    assert_eq!(alpha, (count as f64 / 256.0 * 255.0 + 0.5) as usize, "pixel {x}, {y} of {size_px} px");
                    partial += 1;
                }
            }
        }
    }
    assert!(partial > 450 * renderers_count, "{partial}");
    let pixels = renderers_count * 4 * (SIZE_PX[0] * SIZE_PX[1]) as usize;
    assert!(whole + partial > pixels * 99 / 100, "{whole} and {partial} of {pixels}");
}

/// Faces that meet leave no gap, and no point has two of them.
#[test]
fn shared_edges_have_each_point_once() {
    let mut random = Random(9);
    let (mut positions, mut triangles) = (vec![[0.3, -0.2, 0.5]], Vec::new());
    for i in 0..40 {
        let a = f64::from(i) / 40.0 * std::f64::consts::TAU;
        let r = random.range(30.0, 60.0);
        positions.push([(r * a.cos()) as f32, (r * a.sin()) as f32, 0.5]);
        triangles.push([0, 1 + i, 1 + (i + 1) % 40]);
    }
    let mut plan = scenes::screen_plan([32, 32], 4, 1.0, &positions, &triangles);
    (plan.is_adaptive, plan.margin_px, plan.background) = (true, 8, [0.0; 4]);
    // Of two colours, so that its spokes are mixed.
    let surface = plan.surface.as_mut().unwrap();
    surface.materials.push(meshsnap_render::plan::ShadedMaterial::unlit([0.1, 0.1, 0.1, 1.0]));
    surface.triangle_materials = (0..40).map(|i| i % 2).collect::<Vec<u32>>().into();
    let mut renderer = CpuRenderer::new(1);
    let image = draw(&mut renderer, &plan);
    assert!(renderer.draw_times().mixed_pixels > 500);
    assert!(image.rgba.chunks(4).all(|pixel| pixel[3] == 255));
}

#[test]
fn pictures_that_cannot_have_them_say_so() {
    let mesh = scenes::mesh(&shapes::cube());
    let spec = scenes::spec(&[("samples", "adaptive"), ("style", "wireframe")]);
    let plan = scenes::plan(&mesh, &spec);
    assert_eq!((plan.samples, plan.is_adaptive), (16, false));
    let [warning] = &plan.warnings[..] else { panic!("{:?}", plan.warnings) };
    let said = "image.samples is adaptive, and no face is filled: each pixel has 16 samples instead";
    assert_eq!((warning.code, warning.detail.as_str()), ("samples_fixed", said));
}
