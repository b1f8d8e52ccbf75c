//! Limits of lines: the widest lines on the largest picture take bounded memory, and both back-ends
//! agree on very many hidden parts, very many strokes, and positions that are not finite.

use std::fmt::Write as _;
use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, Edge, LinePass, Shown};
use meshsnap_render::spec::color::Rgba;
use meshsnap_render::spec::{Hidden, Layers, Spec};

use crate::http::answers::{FORM, form};
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::server::Server;
use crate::support::truth;

/// Parts of a mesh, each a triangle before the next, on a name of its own.
fn parts(count: usize) -> String {
    let mut obj = String::new();
    for i in 0..count {
        let (x, z) = (i as f64 * 0.1, i as f64 * 0.05);
        writeln!(obj, "usemtl part{i}\nv {x} 0 {z}\nv {} 1 {z}\nv {x} 2 {z}\nf -3 -2 -1", x + 1.0).unwrap();
    }
    obj
}

/// A document in which every part has wide lines of a colour of its own, hidden ones too.
fn wide_lines(count: usize) -> String {
    let wire = |i: usize| {
        format!(r##""part{i}":{{"wire":{{"thickness":100,"hidden":"fade","lit":true,"color":"#0000{:02x}"}}}}"##, i + 1)
    };
    let wires: Vec<String> = (0..count).map(wire).collect();
    format!(r#"{{"style":"wire","image":{{"width":4096,"height":4096}},"materials":{{{}}}}}"#, wires.join(","))
}

#[test]
fn the_widest_lines_on_the_largest_picture_take_bounded_memory() {
    const PARTS: usize = 20;
    let few = ["--workers", "1", "--worker-threads", "8", "--limit-job-ms", "600000"];
    let server = Server::start(&few);
    let body = form(&[("request", wide_lines(PARTS).as_bytes()), ("file", parts(PARTS).as_bytes())]);
    server.post("/v1/render?size=16", parts(1).as_bytes()).picture(16, 16);
    let before = server.resident_bytes();
    server.request("POST", "/v1/render", &[FORM], &body).picture(4096, 4096);
    let grown = server.peak_bytes().saturating_sub(before);
    // The bands' 256 MiB, the picture and what its encoder makes of it.
    assert!(grown < 640 << 20, "{} MiB", grown >> 20);
    assert!(grown > 128 << 20, "{} MiB: is that the picture that was asked for?", grown >> 20);
    // The next picture is small, and what the large one took is given back.
    server.post("/v1/render?size=16", parts(1).as_bytes()).picture(16, 16);
    let kept = server.resident_bytes().saturating_sub(before);
    assert!(kept < 200 << 20, "{} MiB are kept", kept >> 20);
    // And it is in the budget.
    let server = Server::start(&["--workers", "1", "--worker-threads", "8", "--limit-memory-bytes", "100000000"]);
    let answer = server.request("POST", "/v1/render", &[FORM], &body);
    let detail = answer.problem(422, "limit_exceeded");
    assert!(detail.contains("bands of the picture"), "{detail}");
    assert_eq!(answer.json()["flag"].as_str(), Some("--limit-memory-bytes"));
}

/// Bars before a wall whose edges are lines; a unit is a pixel of a picture 400 high.
fn comb(bars: usize, pitch: f64, bar: f64) -> String {
    let mut obj = String::from("usemtl wall\nv -280 -60 0\nv 280 -45 0\nv 280 150 0\nv -280 150 0\nf -4 -3 -2 -1\n");
    for i in 0..bars {
        let x = (i as f64 - bars as f64 / 2.0) * pitch;
        writeln!(obj, "usemtl bars\nv {x} -150 9\nv {0} -150 9\nv {0} 150 9\nv {x} 150 9\nf -4 -3 -2 -1", x + bar)
            .unwrap();
    }
    obj
}

fn comb_spec(samples: &str, width: &str, hidden: Hidden) -> Spec {
    let keys = [
        ("style", "wire"),
        ("size", "600x400"),
        ("samples", samples),
        ("view", "front"),
        ("camera.projection", "orthographic"),
        ("camera.height", "400"),
        ("wire.edges", "polygons"),
        ("wire.thickness", width),
        ("wire.opacity", "0.6"),
    ];
    let mut spec = scenes::spec(&keys);
    let bars = Layers { wire: None, ..spec.layers };
    let wire = spec.layers.wire.as_mut().unwrap();
    (wire.hidden, wire.color) = (hidden, Rgba([0.8, 0.1, 0.05, 1.0]));
    spec.materials = vec![("bars".into(), bars)];
    spec
}

#[test]
fn a_comb_before_long_thick_lines_leaves_no_part_out() {
    let Some(gpus) = gpus() else { return };
    let mut cases = 0;
    for (i, (bars, pitch, bar)) in [(100, 4.0, 2.0), (100, 1.5, 0.7)].into_iter().enumerate() {
        let mesh = scenes::mesh(&comb(bars, pitch, bar));
        let looks = [
            ("4", "100", Hidden::Hide),
            ("1", "100", Hidden::Fade),
            ("4", "3", Hidden::Fade),
            ("4", "100", Hidden::Show),
        ];
        // Every other look for each comb, all of them in a long run.
        for (samples, width, hidden) in looks.into_iter().skip(truth::cases(i, 0)).step_by(truth::cases(2, 1)) {
            let spec = comb_spec(samples, width, hidden);
            let plan = scenes::plan(&mesh, &spec);
            let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
            let gpu = GpuRenderer::new(gpus[0].clone()).draw(&plan, &Deadline::default()).unwrap();
            assert!(reds(&cpu) > 1000, "there are lines: {}", reds(&cpu));
            Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{bars} {pitch} {samples} {width} {hidden:?}"));
            cases += 1;
        }
    }
    assert_eq!(cases, truth::cases(4, 8));
}

fn reds(image: &Image) -> usize {
    image.rgba.chunks(4).filter(|p| p[0] > p[2].saturating_add(40)).count()
}

/// A plan of red lines between these vertices, in pixels from the picture's centre.
fn lines_of<'a>(
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    edges: Vec<[u32; 2]>,
    clip: bool,
) -> DrawPlan<'a> {
    let mut plan = scenes::screen_plan([64, 48], 4, 1.0, positions, triangles);
    plan.projection.clip = clip;
    let edges: Vec<_> = edges.into_iter().map(|vertices| Edge { vertices, faces: [0, Edge::NO_FACE] }).collect();
    let pass = LinePass { color: [1.0, 0.0, 0.0, 1.0], ..LinePass::new(Arc::new(edges), 1.5) };
    let passes = [Shown::Visible, Shown::Faded, Shown::All].map(|shown| LinePass { shown, ..pass.clone() });
    plan.lines = passes.to_vec();
    plan
}

#[test]
fn what_is_no_number_is_drawn_by_neither_twin() {
    let Some(gpus) = gpus() else { return };
    let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -1e25, 1e7];
    let mut cases = 0;
    for clip in [true, false] {
        for value in strange {
            for axis in 0..2 {
                let mut far = [10.0, 5.0, 0.5];
                far[axis] = value;
                let positions = [[-20.0, -15.0, 0.5], [20.0, -10.0, 0.5], [0.0, 15.0, 0.5], far];
                let triangles = [[0, 1, 2], [0, 1, 3]];
                let plan = lines_of(&positions, &triangles, vec![[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]], clip);
                let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
                let gpu = GpuRenderer::new(gpus[0].clone()).draw(&plan, &Deadline::default()).unwrap();
                Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{clip} {value} {axis}"));
                assert!(reds(&cpu) > 100, "{clip} {value} {axis}: the others are drawn, {}", reds(&cpu));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 24);
}

#[test]
fn a_line_drawn_very_often_is_one_line() {
    let Some(gpus) = gpus() else { return };
    let positions = [[-3.3, -2.2, 0.5], [4.4, 3.1, 0.5], [-9.0, 9.0, 0.5]];
    let triangles = [[0, 1, 2]];
    // Four times: one stroke may leave a corner of a pixel that more are taken to have covered, and
    // in a corner that none of its points is in, up to four are taken to lie beside each other.
    let few = lines_of(&positions, &triangles, vec![[0, 1]; 4], false);
    let few = CpuRenderer::new(1).draw(&few, &Deadline::default()).unwrap();
    let many = lines_of(&positions, &triangles, vec![[0, 1]; 200_000], false);
    let cpu = CpuRenderer::new(1).draw(&many, &Deadline::default()).unwrap();
    let gpu = GpuRenderer::new(gpus[0].clone()).draw(&many, &Deadline::default()).unwrap();
    Likeness::of(&few, &cpu).assert(Tolerance { max: 0, share: 0.0 }, "sums beyond 32 bits");
    Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, "on both");
    assert!(cpu.rgba.chunks(4).any(|p| (40..230).contains(&p[1])), "no pixel is half covered");
}
