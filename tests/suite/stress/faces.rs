//! Thin faces, faces without area, tiny faces beside huge ones, denormal coordinates, and
//! coordinates that are not finite.

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::MeshFault;

use crate::oracle::obj::Shape;
use crate::oracle::vector::{V3, cross, dot, length, unit};
use crate::support::families::moved::{LOOKS, MESHES, draw, is_blank, shape};
use crate::support::files::mesh::read;
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::cases;

const NORMAL_MAX_RAD: f64 = 1e-6;

/// A triangle of whole numbers: long, and so much less high.
fn thin(aspect: f64, is_needle: bool, random: &mut Random) -> [[i64; 3]; 3] {
    let mut direction = || unit([0; 3].map(|_| random.range(-1.0, 1.0)));
    let (along, other) = (direction(), direction());
    let across = unit(cross(along, other));
    const LENGTH: f64 = 1e12;
    let at = if is_needle { 1.0 } else { random.range(0.2, 0.8) };
    let origin = [0; 3].map(|_| random.range(-1e12, 1e12).round() as i64);
    let point = |t: f64, h: f64| -> [i64; 3] {
        std::array::from_fn(|k| origin[k] + (LENGTH * (t * along[k] + h * across[k])).round() as i64)
    };
    [origin, point(1.0, 0.0), point(at, 1.0 / aspect)]
}

/// Exact but for the last step.
fn exact_normal([a, b, c]: [[i64; 3]; 3]) -> V3 {
    let minus =
        |p: [i64; 3], q: [i64; 3]| -> [i128; 3] { std::array::from_fn(|k| i128::from(p[k]) - i128::from(q[k])) };
    let (u, v) = (minus(b, a), minus(c, a));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    unit(n.map(|c| c as f64))
}

#[test]
fn slivers_and_needles_have_their_exact_normals() {
    let (mut worst, mut right, mut collapsed) = (0.0_f64, 0, 0);
    let mut random = Random(41);
    let count = cases(500, 20_000);
    for exponent in 3..=7 {
        for i in 0..count {
            let corners = thin(f64::powi(10.0, exponent), i % 2 == 0, &mut random);
            // Powers of two round nothing, but carry edges far out of what f32 could square.
            let scale = f64::powi(2.0, (random.next() % 401) as i32 - 200);
            let vertices = corners.map(|p| p.map(|c| c as f64 * scale)).to_vec();
            match read(Shape { vertices, polygons: vec![vec![0, 1, 2]] }.text().as_bytes()) {
                Ok(mesh) => {
                    let (got, want) = (mesh.face_normals[0].map(f64::from), exact_normal(corners));
                    assert!(dot(got, want) > 0.0, "{corners:?}");
                    worst = worst.max(length(cross(got, want)));
                    right += 1;
                }
                Err(error) => {
                    assert!(error.detail.contains("1 is thinner than 24 bits"), "{}", error.detail);
                    collapsed += 1;
                }
            }
        }
    }
    println!(
        "- {right} thin faces: normals within {worst:.2e} rad (gate {NORMAL_MAX_RAD:.0e}), {collapsed} have collapsed"
    );
    assert_eq!(right + collapsed, 5 * count);
    // Of needles as long as their box alone, and none but the thinnest.
    assert!(collapsed * 20 <= count, "{collapsed} of {count}");
    assert!(worst <= NORMAL_MAX_RAD, "{worst} rad");
}

#[test]
fn faces_without_area_are_counted_and_never_seen() {
    let mut compared = 0;
    for (name, obj) in MESHES {
        let clean = shape(&obj());
        let mut dirty = clean.clone();
        // Twice the same corner, the same position under another number, and three points in a row,
        // inside and in front.
        let again = dirty.vertex(clean.vertices[0]);
        let row = [0.125, 0.25, 0.5].map(|t| dirty.vertex([t; 3]));
        let upright = [-0.25, 0.0, 0.5].map(|t| dirty.vertex([0.75, t, 0.5]));
        let bad = [vec![0, 1, 1], vec![0, again, 2], row.to_vec(), upright.to_vec(), vec![3, 3, 3]];
        for (i, face) in bad.iter().enumerate() {
            dirty.polygons.insert(i * 2, face.clone());
        }
        let (clean, dirty) = (read(clean.text().as_bytes()).unwrap(), read(dirty.text().as_bytes()).unwrap());
        assert_eq!((clean.report.dropped_degenerate_faces, dirty.report.dropped_degenerate_faces), (0, 5), "{name}");
        assert_eq!(clean.triangles.len(), dirty.triangles.len(), "{name}");
        for (look, keys) in LOOKS {
            let [want, got] = [&clean, &dirty].map(|mesh| draw(mesh, keys, "96x80", &mut CpuRenderer::new(1)));
            assert!(want.rgba == got.rgba, "{name}, {look}: faces without area show");
            compared += 1;
        }
    }
    assert_eq!(compared, MESHES.len() * LOOKS.len());
}

#[test]
fn the_tiny_beside_the_huge_is_counted_and_the_huge_is_drawn() {
    let mut compared = 0;
    for (name, obj) in MESHES {
        let huge = shape(&obj()).map(|v| v.map(|c| c * 1e20));
        let mut both = huge.clone();
        for size in [1e-20, 1e-100, 1e-250] {
            let corners = [[0.0; 3], [size, 0.0, 0.0], [0.0, size, size]].map(|p| both.vertex(p));
            both.polygons.push(corners.to_vec());
        }
        let (huge, both) = (read(huge.text().as_bytes()).unwrap(), read(both.text().as_bytes()).unwrap());
        assert_eq!(both.report.dropped_degenerate_faces, 0, "{name}");
        assert_eq!((huge.report.dropped_collapsed_faces, both.report.dropped_collapsed_faces), (0, 3), "{name}");
        for (look, keys) in LOOKS {
            let [want, got] = [&huge, &both].map(|mesh| draw(mesh, keys, "96x80", &mut CpuRenderer::new(1)));
            assert!(!is_blank(&want) && want.rgba == got.rgba, "{name}, {look}");
            compared += 1;
        }
    }
    assert_eq!(compared, MESHES.len() * LOOKS.len());
}

/// A mesh of whole multiples of the smallest number there is, and one whose small coordinates are
/// as small as that.
#[test]
fn denormal_coordinates_are_numbers_like_others() {
    let mut compared = 0;
    for (name, obj) in MESHES {
        let whole = shape(&obj()).map(|v| v.map(|c| (c * 1e5).round()));
        let tiny = whole.clone().map(|v| v.map(|c| c * 5e-324));
        let flecked = whole.clone().map(|v| v.map(|c| if c == 0.0 { 5e-324 } else { c }));
        let [want, tiny, flecked] = [whole, tiny, flecked].map(|shape| scenes::mesh(&shape.text()));
        for (look, keys) in LOOKS {
            let [want, tiny, flecked] =
                [&want, &tiny, &flecked].map(|mesh| draw(mesh, keys, "96x80", &mut CpuRenderer::new(1)));
            assert!(want.rgba == tiny.rgba, "{name}, {look}: denormals are drawn otherwise");
            assert!(want.rgba == flecked.rgba, "{name}, {look}: denormals are not as good as 0");
            compared += 1;
        }
    }
    assert_eq!(compared, MESHES.len() * LOOKS.len());
}

#[test]
fn vertices_that_are_no_numbers_are_dropped_and_counted_or_nothing_is_left() {
    let mut compared = 0;
    for (name, obj) in MESHES {
        let whole = shape(&obj()).triangulated();
        for bad in ["nan", "-nan", "inf", "-infinity", "1e999", "-1e308"] {
            // 1e308 alone is a number, but twice as far is not.
            let text = whole.text();
            let (first, rest) = text.split_once('\n').unwrap();
            let words: Vec<&str> = first.split(' ').collect();
            let broken = format!("v {} {bad} {}\n{rest}", words[1], words[3]);
            let users = whole.polygons.iter().filter(|p| p.contains(&0)).count();
            let mesh = read(broken.as_bytes()).unwrap();
            assert_eq!(mesh.report.dropped_nonfinite_faces, users as u64, "{name}, {bad}");
            assert_eq!(mesh.triangles.len(), whole.polygons.len() - users, "{name}, {bad}");
            for (look, keys) in LOOKS {
                let picture = draw(&mesh, keys, "48x40", &mut CpuRenderer::new(1));
                assert!(!is_blank(&picture), "{name}, {bad}, {look}");
                compared += 1;
            }
            let all: String = (0..whole.vertices.len()).map(|_| format!("v 0 {bad} 1\n")).collect();
            let faces = &text[text.find('f').unwrap()..];
            assert_eq!(read((all + faces).as_bytes()).unwrap_err().fault, MeshFault::Empty, "{name}, {bad}");
        }
    }
    assert_eq!(compared, MESHES.len() * 6 * LOOKS.len());
}
