//! Tests of the margin: where the camera alone shows that the whole mesh lies inside the picture, its
//! positions show the same.

use super::*;
use crate::import::{Bundle, import};
use crate::limits::{Budget, Limits};
use crate::request::{self, Rules};
use crate::spec::BackendChoice;

#[test]
fn the_camera_tells_nothing_that_positions_do_not() {
    let limits = Limits::default();
    let mut budget = Budget::new(&limits);
    let points = (0..300).map(|i| format!("v {} {} {}\n", i * 7 % 31, i * 11 % 23, i * 5 % 17)).collect::<String>();
    let faces = (0..100).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3)).collect::<String>();
    let bundle = Bundle::of_one((points + &faces).into_bytes());
    let mesh = import(&bundle, None, &limits, &mut budget, &Deadline::default()).unwrap().0;
    let mut counts = [0; 2];
    for (margin, height, projection) in [
        ("0.05", "null", "perspective"),
        ("0.0", "null", "perspective"),
        ("0.02", "null", "orthographic"),
        ("0.0", "20", "orthographic"),
        ("0.0", "80", "orthographic"),
    ] {
        for azimuth in 0..12 {
            let azimuth = (30 * azimuth).to_string();
            let keys = [
                ("camera.margin", margin),
                ("camera.projection", projection),
                ("camera.height", height),
                ("camera.azimuth_deg", &azimuth),
            ];
            let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned()));
            let rules = Rules { limits: limits.clone(), backend: BackendChoice::Cpu };
            let spec = request::read(None, &keys, &rules).unwrap();
            let scene = Scene::new(&mesh, &spec, &mut budget).unwrap();
            let is_sure = is_surely_inside(&scene.camera, scene.size_px());
            let unsure = Scene {
                camera: Camera { reach: glam::DVec2::INFINITY, ..scene.camera },
                groups: crate::scene::MaterialGroups::new(&mesh, &spec),
                mesh: &mesh,
                spec: &spec,
            };
            let is_inside = is_inside(&unsure, &Geometry::of_mesh(&mesh), &Deadline::default()).unwrap();
            assert!(!is_sure || is_inside, "{margin} {height} {projection} {azimuth}");
            counts[usize::from(is_sure)] += 1;
        }
    }
    assert!(counts[0] >= 12 && counts[1] >= 24, "{counts:?}");
}
