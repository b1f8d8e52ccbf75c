//! Diagnostics as colours (`surface.debug`), each against the numbers of an independent
//! computation: the colours of a plan are read back as places on the published colour maps, viridis
//! and cool-warm.

use std::f64::consts::TAU;

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::server::{Server, meshsnap};
use crate::support::{scenes, shapes};

/// Viridis at ten places, and the smooth cool-warm map at nine, as published.
const VIRIDIS: &[u32] =
    &[0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725];
const COOL_WARM: &[u32] = &[0x3b4cc0, 0x688aef, 0x99baff, 0xc9d7f0, 0xdddddd, 0xedd1c2, 0xf7a889, 0xe26952, 0xb40426];

/// The place from 0 to 1 of a linear colour on a map: of the nearest of many blends.
fn place(map: &[u32], [r, g, b, _]: [f32; 4]) -> f64 {
    let stored = |linear: f32| {
        let linear = f64::from(linear);
        255.0 * if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    };
    let color = [stored(r), stored(g), stored(b)];
    let steps = 2000;
    let at = |i: usize| {
        let place = i as f64 / steps as f64 * (map.len() - 1) as f64;
        let (low, rest) = (place as usize, place.fract());
        let [low, high] = [map[low], map[(low + 1).min(map.len() - 1)]];
        let channel = |shift: u32| f64::from(low >> shift & 255) * (1.0 - rest) + f64::from(high >> shift & 255) * rest;
        [channel(16), channel(8), channel(0)].iter().zip(color).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
    };
    let nearest = (0..=steps).min_by(|&i, &j| at(i).total_cmp(&at(j))).unwrap();
    assert!(at(nearest) < 9.0, "{color:?} is not on the map");
    nearest as f64 / steps as f64
}

/// The colours of each triangle's corners in a debug view.
fn colors(mesh: &Mesh, debug: &str) -> Vec<[[f32; 4]; 3]> {
    let plan = scenes::plan(mesh, &scenes::spec(&[("surface.debug", debug), ("size", "64")]));
    let colors = plan.surface.as_ref().unwrap().colors.clone().unwrap();
    colors.triangles.iter().map(|triangle| triangle.map(|v| colors.values[v as usize])).collect()
}

/// A triangle's corners.
fn corners(mesh: &Mesh, face: usize) -> [[f64; 3]; 3] {
    mesh.triangles[face].map(|v| mesh.positions[v as usize].map(f64::from))
}

/// The lengths of a triangle's sides.
fn sides([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let length = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
    [length(a, b), length(b, c), length(c, a)]
}

#[test]
fn aspect_is_the_area_over_the_mean_square_side() {
    let mesh = scenes::mesh(&shapes::sheet(9));
    let mut faces = 0;
    for (face, [color, ..]) in colors(&mesh, "aspect").into_iter().enumerate() {
        let [a, b, c] = sides(corners(&mesh, face));
        // Heron's formula.
        let s = (a + b + c) / 2.0;
        let area = (s * (s - a) * (s - b) * (s - c)).max(0.0).sqrt();
        let quality = 4.0 * 3.0_f64.sqrt() * area / (a * a + b * b + c * c);
        assert!((place(VIRIDIS, color) - (1.0 - quality)).abs() < 0.006, "{face}: {quality}");
        faces += 1;
    }
    assert!(faces >= 128, "{faces}");
    let equilateral = scenes::mesh("v 0 0 0\nv 1 0 0\nv 0.5 0.8660254037844386 0\nf 1 2 3\n");
    assert!(place(VIRIDIS, colors(&equilateral, "aspect")[0][0]) < 0.003);
}

#[test]
fn edge_lengths_are_in_order_on_a_scale_of_powers() {
    let mesh = scenes::mesh(&shapes::torus(40));
    let shown: Vec<f64> = colors(&mesh, "edge-length").iter().map(|[color, ..]| place(VIRIDIS, *color)).collect();
    let mean: Vec<f64> = (0..shown.len()).map(|face| sides(corners(&mesh, face)).iter().sum::<f64>() / 3.0).collect();
    let mut sorted = mean.clone();
    sorted.sort_by(f64::total_cmp);
    let tail = sorted.len() / 50;
    let [low, high] = [sorted[tail], sorted[sorted.len() - 1 - tail]].map(f64::log2);
    assert!(high - low > 0.5);
    for (face, place) in shown.iter().enumerate() {
        let expected = ((mean[face].log2() - low) / (high - low)).clamp(0.0, 1.0);
        assert!((place - expected).abs() < 0.01, "{face}: {place}, not {expected}");
    }
}

#[test]
fn curvature_is_that_of_a_torus() {
    let n = 96;
    let mesh = scenes::mesh(&shapes::torus(n));
    let (ring, tube) = (1.0, 0.4);
    // The mean curvature of a torus at the angle b around its tube, from its parametrisation.
    let curvature = |b: f64| (ring + 2.0 * tube * b.cos()) / (2.0 * tube * (ring + tube * b.cos()));
    let most = curvature(0.0);
    let scale = mesh.to_file.scale;
    let mut compared = 0;
    for (face, shown) in colors(&mesh, "curvature").into_iter().enumerate() {
        for (k, color) in shown.into_iter().enumerate() {
            let [x, y, z] = corners(&mesh, face)[k].map(|v| v * scale);
            let b = y.atan2((x * x + z * z).sqrt() - ring);
            let expected = 0.5 + 0.5 * (curvature(b) / most).clamp(-1.0, 1.0);
            let place = place(COOL_WARM, color);
            assert!((place - expected).abs() < 0.04, "{} degrees: {place}, not {expected}", b * 360.0 / TAU);
            compared += 1;
        }
    }
    assert_eq!(compared, 3 * n * n);
    // Inside out, what bent outwards bends inwards.
    let turned: String = shapes::torus(24)
        .lines()
        .map(|line| match line.strip_prefix("f ") {
            Some(face) => format!("f {}\n", face.split(' ').rev().collect::<Vec<_>>().join(" ")),
            None => format!("{line}\n"),
        })
        .collect();
    let [out, inside] = [shapes::torus(24), turned].map(|obj| {
        let all = colors(&scenes::mesh(&obj), "curvature");
        all.iter().flatten().map(|color| place(COOL_WARM, *color)).sum::<f64>() / (3 * all.len()) as f64
    });
    assert!((out + inside - 1.0).abs() < 0.01 && out > 0.6, "{out} {inside}");
}

/// Squares of side 1 with these sides in the texture.
fn squares(sizes: &[[f64; 2]]) -> String {
    let mut obj = String::new();
    for (i, [w, h]) in sizes.iter().enumerate() {
        let x = 2 * i;
        obj += &format!("v {x} 0 0\nv {} 0 0\nv {} 1 0\nv {x} 1 0\n", x + 1, x + 1);
        let u = 0.25 * i as f64;
        obj += &format!("vt {u} 0\nvt {} 0\nvt {} {h}\nvt {u} {h}\nf -4/-4 -3/-3 -2/-2 -1/-1\n", u + w, u + w);
    }
    obj
}

#[test]
fn uv_stretch_is_the_root_mean_square_of_the_singular_values() {
    let sizes = [[0.2, 0.2], [0.1, 0.1], [0.2, 0.05], [0.05, 0.2]];
    let mesh = scenes::mesh(&squares(&sizes));
    let shown = colors(&mesh, "uv-stretch");
    let texture: f64 = sizes.iter().map(|[w, h]| w * h).sum();
    let scale = (texture / sizes.len() as f64).sqrt();
    for (i, [w, h]) in sizes.iter().enumerate() {
        // The singular values of the map from the texture are 1 / w and 1 / h.
        let stretch = ((1.0 / (w * w) + 1.0 / (h * h)) / 2.0).sqrt() * scale;
        let expected = 0.5 + 0.25 * stretch.log2().clamp(-2.0, 2.0);
        for triangle in &shown[2 * i..2 * i + 2] {
            let place = place(COOL_WARM, triangle[0]);
            assert!((place - expected).abs() < 0.01, "{i}: {place}, not {expected}");
        }
    }
    assert_eq!(shown.len(), 8);
    // A face without an area in the texture is magenta.
    let flat = scenes::mesh(&squares(&[[0.2, 0.2], [0.2, 0.0]]));
    let [r, g, b, _] = colors(&flat, "uv-stretch")[2][0];
    assert!(r > 2.0 * g && b > 2.0 * g);
}

/// Places in a layout, from 0 to 1 with v upwards, and the colour that is there.
#[test]
fn a_layout_shows_faces_in_the_texture_and_marks_faults() {
    let mut obj = squares(&[[0.2, 0.2], [0.2, 0.2]]);
    // One turned over, above; two over each other, beside it.
    let square = |u: f64, v: f64, w: f64| {
        format!("vt {u} {v}\nvt {} {v}\nvt {} {}\nvt {u} {}\nf 1/-4 2/-3 3/-2 4/-1\n", u + w, u + w, v + 0.2, v + 0.2)
    };
    obj += &square(0.3, 0.6, -0.2);
    obj += &(square(0.6, 0.6, 0.2) + &square(0.7, 0.7, 0.2));
    let server = Server::start(&[]);
    let answer = server.post("/v1/render?surface.debug=uv-layout&size=200&view=top&sheet=null", obj.as_bytes());
    let picture = answer.picture(200, 200);
    let at = |u: f64, v: f64| {
        let px = |share: f64| (10.0 + 180.0 * share) as u32;
        picture.get_pixel(px(u), 199 - px(v)).0
    };
    let cases = [
        ([0.05, 0.12], [0xa9, 0xbf, 0xd6]),
        ([0.35, 0.12], [0xa9, 0xbf, 0xd6]),
        ([0.2, 0.72], [0xe9, 0xa2, 0x3b]),
        ([0.65, 0.72], [0xd1, 0x3b, 0x46]),
        ([0.85, 0.83], [0xd1, 0x3b, 0x46]),
        ([0.5, 0.4], [255; 3]),
    ];
    for ([u, v], expected) in cases {
        assert_eq!(at(u, v)[..3], expected, "{u} {v}");
    }
    let right = (184..200).map(|x| picture.get_pixel(x, 100).0);
    assert!(right.clone().any(|pixel| pixel[0] < 160), "the frame of the texture: {:?}", right.collect::<Vec<_>>());
    for debug in ["uv-layout", "uv-stretch"] {
        let answer = server.post(&format!("/v1/render?surface.debug={debug}&size=64"), shapes::torus(8).as_bytes());
        assert_eq!((answer.status, answer.header("x-warnings")), (200, Some("uvs_missing")), "{debug}");
    }
    let detail =
        server.post("/v1/render?materials.A.surface.debug=uv-layout", obj.as_bytes()).problem(400, "conflicting_keys");
    assert!(detail.contains("materials.A.surface.debug"), "{detail}");
}

/// The legends of the diagnostics, in the file's units: here a box of 2 x 6 x 10, whose triangles have three
/// different means of sides.
#[test]
fn legends_tell_the_numbers_of_the_first_and_the_last_colour() {
    let mut obj = shapes::Obj::default();
    obj.cuboid([0.0; 3], [2.0, 6.0, 10.0]);
    let mesh = scenes::mesh(&obj.finish());
    let legend = |debug: &str| {
        let legends = scenes::plan(&mesh, &scenes::spec(&[("surface.debug", debug), ("size", "64")])).legends;
        let [legend] = &legends[..] else { panic!("{debug}: {legends:?}") };
        (legend.title, legend.ends)
    };
    let mean = |a: f64, b: f64| (a + b + a.hypot(b)) / 3.0;
    let (title, ends) = legend("edge-length");
    assert_eq!(title, "edge length");
    for (end, wanted) in ends.into_iter().zip([mean(2.0, 6.0), mean(6.0, 10.0)]) {
        assert!((end / wanted - 1.0).abs() < 1e-6, "{end} is {wanted}");
    }
    assert_eq!(legend("aspect").1, [0.0, 1.0]);
    let (_, [low, high]) = legend("curvature");
    assert!(low == -high && high > 0.1 && high < 1.0, "{high}");
    for other in ["none", "uv", "normal"] {
        assert!(scenes::plan(&mesh, &scenes::spec(&[("surface.debug", other)])).legends.is_empty());
    }
}

/// The same on both back-ends, because it is drawn after them; and nowhere but in its corner.
#[test]
fn a_legend_lies_in_the_lower_right_corner() {
    let server = Server::start(&[]);
    let draw = |debug: &str, legend: bool| {
        let path = format!("/v1/render?size=300&format=png&surface.debug={debug}&image.legend={legend}");
        server.post(&path, shapes::torus(24).as_bytes()).picture(300, 300)
    };
    let (plain, with) = (draw("edge-length", false), draw("edge-length", true));
    let changed: Vec<_> = with.enumerate_pixels().filter(|(x, y, pixel)| plain.get_pixel(*x, *y) != *pixel).collect();
    assert!(changed.len() > 500, "{}", changed.len());
    assert!(changed.iter().all(|(x, y, _)| *x >= 300 - 110 && *y >= 300 - 40));
    // Colours by number have a legend, others none.
    assert_eq!(draw("normal", true), draw("normal", false));
}

#[test]
fn twins_of_diagnostics_are_the_same() {
    let Some(gpus) = gpus() else { return };
    let (mut gpu, mut cpu) = (GpuRenderer::new(gpus[0].clone()), CpuRenderer::new(2));
    let meshes = [scenes::mesh(&shapes::torus(30)), scenes::mesh(&squares(&[[0.2, 0.2], [0.1, 0.3]]))];
    let mut compared = 0;
    for (mesh, debug) in
        meshes.iter().flat_map(|mesh| ["aspect", "edge-length", "curvature", "uv-stretch"].map(|d| (mesh, d)))
    {
        let spec = scenes::spec(&[("surface.debug", debug), ("size", "120")]);
        let plan = scenes::plan(mesh, &spec);
        let pictures = (gpu.draw(&plan, &Deadline::default()), cpu.draw(&plan, &Deadline::default()));
        let like = Likeness::of(&pictures.0.unwrap(), &pictures.1.unwrap());
        assert!(like.is_within(Tolerance::TWINS), "{debug}: {like}");
        compared += 1;
    }
    assert_eq!(compared, 8);
}

#[test]
fn a_file_that_lies_on_its_back_is_said_to() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("part.obj");
    let mut said = Vec::new();
    for (comment, arguments) in [("by hand", &[][..]), ("units mm, z-up", &[]), ("units mm, z-up", &["--up", "z"])] {
        std::fs::write(&mesh, format!("# {comment}\n{}", shapes::torus(12))).unwrap();
        let mut command = meshsnap();
        command.arg("render").arg(&mesh).arg("-o").arg(folder.path().join("a.png"));
        let run = command.args(["--backend", "cpu", "--size", "32"]).args(arguments).output().unwrap();
        assert!(run.status.success());
        said.push(String::from_utf8_lossy(&run.stderr).contains("z is likelier"));
    }
    assert_eq!(said, [false, true, false]);
}
