//! Tests of the oracle's closed forms and signs: against each other, against many points per pixel,
//! and against the crate `robust`. No renderer takes part.

use std::f64::consts::{PI, TAU};

use robust::{Coord, orient2d};

use crate::oracle::camera::Camera;
use crate::oracle::coverage::{Coverage, classify, orient, share};
use crate::oracle::lines::coverage::ink;
use crate::oracle::screen::{Scene, Screen, Sides};
use crate::oracle::vector::{length, sub};
use crate::oracle::{
    lines::{capsule, strip},
    surface::rays,
};
use crate::support::data;
use crate::support::shapes::Random;
use crate::support::truth::points_per_side;

/// The points' own noise, /255: what agreement with them can be asked for.
const NOISE: f64 = 4.0;

#[test]
fn integer_signs_are_robust_signs() {
    let mut random = Random(1);
    let (mut cases, mut zeros) = (0, 0);
    for i in 0..200_000 {
        let reach = [40.0, 3000.0, 1e6][i % 3];
        let mut point = || [0, 1].map(|_| random.range(-reach, reach) as i64);
        let (a, b) = (point(), point());
        // A third of the points lie on the line or a step beside it.
        let nudge = point();
        let c = if i % 3 == 0 { point() } else { [2 * b[0] - a[0] + nudge[0] % 2, 2 * b[1] - a[1]] };
        let coord = |p: [i64; 2]| Coord { x: p[0] as f64, y: p[1] as f64 };
        let robust = orient2d(coord(a), coord(b), coord(c));
        assert_eq!(orient(a, b, c).signum(), if robust == 0.0 { 0 } else { robust.signum() as i128 });
        zeros += usize::from(robust == 0.0);
        cases += 1;
    }
    assert_eq!(cases, 200_000);
    assert!(zeros > 10_000, "only {zeros} points on the line");
}

#[test]
fn coverage_is_none_partial_or_full_as_its_area_and_its_rays_say() {
    let mut random = Random(2);
    let (mut counts, mut triangles) = ([0; 3], 0);
    for i in 0..120 {
        let reach = [0.7, 4.0, 11.0][i % 3];
        let center = [random.range(4.0, 12.0), random.range(4.0, 12.0)];
        let mut corner = |snap: f64| center.map(|c| ((c + random.range(-reach, reach)) * snap).round() * 256.0 / snap);
        // Some with corners on pixel corners and sides along pixel sides.
        let snap = if i % 4 == 0 { 1.0 } else { 256.0 };
        let t = [corner(snap), corner(snap), corner(snap)].map(|p| p.map(|v| v as i64));
        let scene = Scene {
            camera: Camera::of_pixels([16, 16]),
            positions: t.iter().map(|p| [p[0] as f64 / 256.0, p[1] as f64 / 256.0, 0.5]).collect(),
            triangles: vec![[0, 1, 2]],
            sides: Sides::Both,
            edges: Vec::new(),
        };
        let screen = Screen::new(&scene);
        for y in 0..16 {
            for x in 0..16 {
                let area = share(t, [x, y]);
                let class = classify(t, [x, y]);
                let expected = match class {
                    Coverage::None => area.abs() < 1e-12,
                    Coverage::Full => (area - 1.0).abs() < 1e-12,
                    Coverage::Partial => area > 1e-7 && area < 1.0 - 1e-7,
                };
                assert!(expected, "{t:?} in ({x}, {y}): {class:?}, but its area is {area}");
                counts[class as usize] += 1;
                let seen: f64 =
                    rays::shares(&screen, [x as u32, y as u32], points_per_side()).iter().map(|(_, s)| s).sum();
                assert!((seen - area).abs() * 255.0 <= NOISE, "{t:?} in ({x}, {y}): {area}, but rays say {seen}");
            }
        }
        triangles += 1;
    }
    assert_eq!(triangles, 120);
    assert!(counts.iter().all(|&n| n > 800), "{counts:?}");
}

#[test]
fn strips_are_long_rectangles() {
    let mut random = Random(3);
    let (mut cases, mut worst) = (0, 0.0_f64);
    for i in 0..20_000 {
        let angle = if i % 5 == 0 { f64::from(i % 8) * PI / 4.0 } else { random.range(0.0, TAU) };
        let n = [angle.cos(), angle.sin()];
        let (distance, width) = (random.range(-3.0, 3.0), [0.25, 1.0, 1.5, 4.0][i as usize % 4]);
        let end = |s: f64| [n[0] * distance - n[1] * s, n[1] * distance + n[0] * s];
        let rectangle = capsule::rectangle([end(-50.0), end(50.0)], 0.5 * width);
        worst = worst.max((strip::coverage(distance, n, width) - rectangle).abs());
        cases += 1;
    }
    println!("strips against clipped rectangles: {worst:e}");
    assert_eq!(cases, 20_000);
    assert!(worst < 1e-12, "{worst}");
}

#[test]
fn capsules_are_what_their_points_say() {
    let mut random = Random(4);
    let (mut cases, mut worst, mut squares, mut partial) = (0, 0.0_f64, 0.0, 0);
    for i in 0..200 {
        let width = [0.25, 1.0, 2.5, 7.0][i % 4];
        let mut end = || [random.range(2.0, 22.0), random.range(2.0, 22.0)];
        let a = end();
        let b = match i % 8 {
            0 => a,
            1 => [a[0], end()[1]],
            2 => [end()[0], a[1]],
            3 => [a[0] + 0.1, a[1] + 0.2],
            _ => end(),
        };
        let sampled = ink([24, 24], &[[a, b]], width, points_per_side());
        let mut total = 0.0;
        for (p, sampled) in sampled.iter().enumerate() {
            let center = [(p % 24) as f64 + 0.5, (p / 24) as f64 + 0.5];
            let exact = capsule::coverage(center, [a, b], width);
            let error = 255.0 * (sampled - exact).abs();
            worst = worst.max(error);
            if exact > 1e-9 && exact < 1.0 - 1e-9 {
                squares += error * error;
                partial += 1;
            }
            total += exact;
        }
        // Nothing of a narrow one lies outside the picture.
        let area = width * length(sub(b, a)) + 0.25 * PI * width * width;
        assert!(width > 4.0 || (total - area).abs() < 1e-9, "{a:?} {b:?} {width}: {total}, not {area}");
        cases += 1;
    }
    let rmse = (squares / f64::from(partial)).sqrt();
    println!("capsules against {0} x {0} points: rmse {rmse:.3}, max {worst:.2} /255", points_per_side());
    assert_eq!(cases, 200);
    assert!(worst < NOISE && rmse < NOISE / 8.0, "max {worst}, rmse {rmse}");
}

#[test]
fn the_oracle_stands_alone() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracle");
    let mut files = 0;
    for path in data::files(&folder) {
        let text = std::fs::read_to_string(&path).unwrap();
        for foreign in ["meshsnap", "crate::", "glam::", "libm::"] {
            assert!(!text.contains(foreign), "{} uses {foreign}", path.display());
        }
        files += 1;
    }
    assert!(files >= 15, "only {files} files");
}
