//! The warning for cameras that look past the mesh: it comes only where the picture is blank.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan;

use crate::support::server::{Server, meshsnap};
use crate::support::shapes::Random;
use crate::support::{scenes, shapes};

#[test]
fn a_view_past_the_mesh_is_known() {
    let mesh = scenes::mesh(&shapes::torus(12));
    let mut cases = 0;
    // Eye, target, style, and whether the mesh is out of view.
    for (eye, target, style, is_out) in [
        ("0,0,6", "0,0,0", "flat", false),
        ("0,0,6", "0,0,12", "flat", true),
        ("0,0,6", "40,0,0", "flat", true),
        ("0,0,6", "0,-40,0", "wire", true),
        ("0,0,6", "0,40,0", "wireframe", true),
        // Inside the tube, and in the hole: the mesh is all around.
        ("1,0,0", "1,0,1", "flat", false),
        ("0,0,0", "1,0,0", "smooth", false),
        ("0,3,0", "0,4,0", "flat", true),
        ("0,0,900", "0,0,0", "outline", false),
    ] {
        let keys = [("camera.eye", eye), ("camera.target", target), ("style", style), ("size", "64")];
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        assert_eq!(plan::is_out_of_view(&plan), is_out, "{keys:?}");
        cases += 1;
    }
    for view in ["iso", "front", "top"] {
        let spec = scenes::spec(&[("view", view)]);
        assert!(!plan::is_out_of_view(&scenes::plan(&mesh, &spec)), "{view}");
        cases += 1;
    }
    assert_eq!(cases, 12);
}

#[test]
fn what_is_out_of_view_is_blank() {
    let mesh = scenes::mesh(&shapes::torus(12));
    let mut random = Random(3);
    let (mut out, mut within) = (0, 0);
    for _ in 0..300 {
        let [eye, target] = [3.0, 6.0].map(|reach| {
            let point: Vec<String> = (0..3).map(|_| format!("{:.3}", random.range(-reach, reach))).collect();
            point.join(",")
        });
        let keys = [("camera.eye", eye.as_str()), ("camera.target", &target), ("style", "wire"), ("size", "48")];
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        let picture = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
        let is_blank = picture.rgba.chunks(4).all(|pixel| pixel == &picture.rgba[..4]);
        if plan::is_out_of_view(&plan) {
            assert!(is_blank, "{keys:?}: something is seen");
            out += 1;
        } else if !is_blank {
            within += 1;
        }
    }
    assert!(out > 30 && within > 30, "{out} out of view, {within} within");
}

#[test]
fn the_command_line_warns_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, picture) = (folder.path().join("torus.obj"), folder.path().join("torus.png"));
    std::fs::write(&mesh, shapes::torus(8)).unwrap();
    let mut cases = 0;
    for (target, warns) in [("0,0,0", false), ("0,0,12", true)] {
        let target = format!("camera.target={target}");
        let mut command = meshsnap();
        command.arg("render").arg(&mesh).arg("-o").arg(&picture);
        let run = command.args(["--set", "camera.eye=0,0,6", "--set", &target]).output().unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.success(), "{said}");
        assert_eq!(said.contains("warning: the camera looks past the whole mesh"), warns, "{said}");
        cases += 1;
    }
    assert_eq!(cases, 2);
}

#[test]
fn a_job_warns_of_it_by_its_code() {
    let server = Server::start(&[]);
    let mut cases = 0;
    for (target, codes) in [("0,0,0", &[][..]), ("0,0,12", &["mesh_out_of_view"])] {
        let query = format!("/v1/jobs?size=32&camera.eye=0,0,6&camera.target={target}");
        let location = server.post(&query, shapes::torus(8).as_bytes()).header("location").unwrap().to_owned();
        let job = server.request("GET", &location, &["Prefer: wait=30"], b"").json();
        let warnings = job["result"]["warnings"].as_array().map_or(&[][..], |list| list);
        let said: Vec<&str> = warnings.iter().map(|warning| warning["code"].as_str().unwrap()).collect();
        assert!(job["state"] == "done" && said == codes, "{job}");
        cases += 1;
    }
    assert_eq!(cases, 2);
}
