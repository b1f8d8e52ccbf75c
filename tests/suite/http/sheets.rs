//! Sheets: each cell is the picture that its view gives alone. The frames of a turntable are the
//! cells of its grid, and the mesh has the same size in all of them.

use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder as _, RgbaImage};

use crate::http::meshes::url;
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};
use crate::support::shapes;

/// The part of a picture at a place.
fn part(picture: &RgbaImage, at: [u32; 2], size: [u32; 2]) -> RgbaImage {
    image::imageops::crop_imm(picture, at[0], at[1], size[0], size[1]).to_image()
}

/// Frames and their delays, milliseconds, of an animated picture.
fn frames(answer: &Answer) -> Vec<(RgbaImage, u32)> {
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    let bytes = Cursor::new(&answer.body);
    let frames = match answer.header("content-type") {
        Some("image/png") => PngDecoder::new(bytes).unwrap().apng().unwrap().into_frames().collect_frames(),
        Some("image/webp") => WebPDecoder::new(bytes).unwrap().into_frames().collect_frames(),
        other => panic!("{other:?}"),
    };
    let delay_ms = |frame: &image::Frame| {
        let (numerator, denominator) = frame.delay().numer_denom_ms();
        numerator / denominator
    };
    frames.unwrap().into_iter().map(|frame| (frame.buffer().clone(), delay_ms(&frame))).collect()
}

#[test]
fn each_cell_is_the_picture_of_its_view() {
    let server = Server::start(&[]);
    let mesh = shapes::gear(9).into_bytes();
    let mut cells = 0;
    for (style, background) in [("wire", "transparent"), ("outline", "%23234"), ("technical", "%23fff..%2300f8")] {
        let keys = format!("style={style}&background={background}");
        // Columns of 33 and 34 px, rows of 30 and 31 px.
        let sheet = server
            .post(&format!("/v1/render?{keys}&size=67x61&sheet.views=front,top,iso,auto&sheet.columns=2"), &mesh)
            .picture(67, 61);
        let places = [("front", [0, 0]), ("top", [33, 0]), ("iso", [0, 30]), ("auto", [33, 30])];
        for (view, [x, y]) in places {
            let size = [if x == 0 { 33 } else { 34 }, if y == 0 { 30 } else { 31 }];
            let alone = format!("/v1/render?{keys}&view={view}&size={}x{}", size[0], size[1]);
            let alone = server.post(&alone, &mesh).picture(size[0], size[1]);
            assert!(part(&sheet, [x, y], size) == alone, "{style} {view}");
            cells += 1;
        }
    }
    assert_eq!(cells, 12);
    // A cell without a view has the background alone.
    let three = server.post("/v1/render?size=64&sheet.views=front,top,iso&background=%23123456", &mesh).picture(64, 64);
    assert!(part(&three, [32, 32], [32, 32]).pixels().all(|pixel| pixel.0 == [0x12, 0x34, 0x56, 255]));
}

#[test]
fn a_turntable_is_an_animation_or_a_grid_of_the_same_pictures() {
    let server = Server::start(&[]);
    let mesh = shapes::gear(7).into_bytes();
    let mut compared = 0;
    for background in ["%23fff", "transparent"] {
        let keys = format!("/v1/render?style=smooth&background={background}&sheet.turntable=5");
        let png = frames(&server.post(&format!("{keys}&size=40x30"), &mesh));
        let small = frames(&server.post(&format!("{keys}&size=40x30&image.effort=6"), &mesh));
        let webp = frames(&server.post(&format!("{keys}&size=40x30&format=webp"), &mesh));
        let grid = server.post(&format!("{keys}&size=40x150&sheet.columns=1"), &mesh).picture(40, 150);
        assert_eq!((png.len(), small.len(), webp.len()), (5, 5, 5));
        for (i, ((png_frame, small_frame), webp_frame)) in png.iter().zip(&small).zip(&webp).enumerate() {
            let cell = part(&grid, [0, 30 * i as u32], [40, 30]);
            for (frame, delay_ms) in [png_frame, small_frame, webp_frame] {
                assert!(*frame == cell, "{background} {i}");
                assert_eq!(*delay_ms, 600, "a turn of three seconds");
                compared += 1;
            }
            assert!(i == 0 || png_frame.0 != png[0].0, "it turns");
        }
    }
    assert_eq!(compared, 30);
    // JPEG has no animations.
    let jpeg = server.post("/v1/render?format=jpeg&size=90&sheet.turntable=9", &mesh);
    assert_eq!(jpeg.header("content-type"), Some("image/jpeg"));
    jpeg.picture(90, 90);
}

#[test]
fn a_turntable_keeps_the_size_of_its_mesh_and_cuts_nothing() {
    let server = Server::start(&[]);
    // A long box beside the origin, and a ring that looks the same from all around.
    let end = |z: f64| format!("v 5 0 {z}\nv 5.4 0 {z}\nv 5 0.6 {z}\nv 5 0 {}\nf -4 -3 -2\nf -4 -2 -1\n", z + 0.5);
    let long = end(0.0) + &end(9.0);
    let (mut border, mut steady) = (0, 0);
    for projection in ["perspective", "orthographic"] {
        for elevation in ["-35", "0", "20", "90"] {
            let keys = format!(
                "sheet.turntable=12&size=60x44&camera.projection={projection}&camera.elevation_deg={elevation}"
            );
            for (frame, _) in frames(&server.post(&format!("/v1/render?{keys}"), long.as_bytes())) {
                let is_outer = |x: u32, y: u32| x == 0 || y == 0 || x == 59 || y == 43;
                assert!(frame.enumerate_pixels().all(|(x, y, pixel)| !is_outer(x, y) || pixel.0 == [255; 4]), "{keys}");
                border += 1;
            }
            let covered: Vec<usize> = frames(&server.post(&format!("/v1/render?{keys}"), shapes::torus(48).as_bytes()))
                .iter()
                .map(|(frame, _)| frame.pixels().filter(|pixel| pixel.0 != [255; 4]).count())
                .collect();
            let (least, most) = (covered.iter().min().unwrap(), covered.iter().max().unwrap());
            assert!(*least > 200 && most - least < most / 20, "{keys}: {covered:?}");
            steady += 1;
        }
    }
    assert_eq!((border, steady), (96, 8));
}

#[test]
fn labels_are_written_into_their_corners() {
    let server = Server::start(&[]);
    let sheet = |labels: &str| {
        let keys = "size=240x120&sheet.views=front,bottom&sheet.columns=2";
        server.post(&format!("/v1/render?{keys}&sheet.labels={labels}"), CUBE_OBJ).picture(240, 120)
    };
    let (with, without) = (sheet("true"), sheet("false"));
    let mut written = [0; 2];
    for (x, y, pixel) in with.enumerate_pixels().filter(|(x, y, pixel)| *pixel != without.get_pixel(*x, *y)) {
        assert!(x % 120 < 50 && y >= 100, "{x} {y}");
        assert_eq!(pixel.0[3], 255);
        written[x as usize / 120] += 1;
    }
    assert!(written[0] > 40 && written[1] > written[0], "{written:?}");
    assert_eq!(sheet("true"), with, "the same bytes");
}

#[test]
fn bad_sheets_are_refused_by_their_keys() {
    let server = Server::start(&[]);
    let many = ["front"; 65].join(",");
    let too_many = format!("sheet.views={many}");
    let cases = [
        ("sheet.views=front,behind", "out_of_range", "sheet.views"),
        ("sheet.views=", "out_of_range", "sheet.views"),
        (&too_many, "out_of_range", "1 to 64"),
        ("sheet.turntable=1", "out_of_range", "from 2 to 64"),
        ("sheet.turntable=65", "out_of_range", "from 2 to 64"),
        ("sheet.turntable=2.5", "out_of_range", "whole number"),
        ("sheet.turntable=1e99", "out_of_range", "from 2 to 64"),
        ("sheet.turntable=x", "wrong_type", "whole number"),
        ("sheet.columns=0", "out_of_range", "from 1 to 64"),
        ("sheet.columns=65", "out_of_range", "from 1 to 64"),
        ("sheet.labels=yes", "wrong_type", "true or false"),
        ("sheet.turntable=4&sheet.views=front", "conflicting_keys", "sheet.views"),
        ("sheet.views=front&camera.azimuth_deg=3", "conflicting_keys", "camera.azimuth_deg"),
        ("sheet.turntable=4&camera.eye=1,2,3&camera.target=0,0,0", "conflicting_keys", "camera.eye"),
        ("sheet={}&camera.from_file=true", "conflicting_keys", "camera.from_file"),
        ("sheet.turntable=64&size=513", "out_of_range", "64 frames"),
        ("sheet.turntable=64&sheet.columns=64&size=500", "out_of_range", "64 x 1 cells"),
        ("sheet=front", "wrong_type", "object"),
        ("sheet.pages=2", "unknown_key", "sheet"),
        ("materials.A.sheet.columns=2", "unknown_key", "layers"),
    ];
    for (query, code, part) in cases {
        let detail = server.post(&format!("/v1/render?{query}"), CUBE_OBJ).problem(400, code);
        assert!(detail.contains(part), "{query}: {detail}");
    }
    assert_eq!(cases.len(), 20);
    // A format that is chosen later may leave a grid whose cells have no pixel.
    let tiny = server.request("POST", "/v1/render?sheet.turntable=64&size=5", &["Accept: image/jpeg"], CUBE_OBJ);
    assert_eq!(tiny.status, 200);
    server.post("/v1/render?sheet=null&size=32", CUBE_OBJ).picture(32, 32);
}

#[test]
fn sheets_of_stored_meshes_are_kept_and_jobs_draw_them() {
    let server = Server::start(&[]);
    let mesh = shapes::torus(20).into_bytes();
    server.post("/v1/meshes", &mesh);
    let path = |rest: &str| format!("{}/render.{rest}", url(&mesh));
    let first = server.get(&path("png?size=64&sheet.views=front,left,top,iso&sheet.columns=2"));
    let again = server.get(&path("png?size=64&sheet=%7B%22columns%22:2%7D"));
    assert_eq!((again.header("x-cache"), &again.body), (Some("hit"), &first.body), "the same meaning");
    let others = [
        "png?size=64&sheet.columns=1",
        "png?size=64&sheet.labels=true",
        "png?size=64&sheet.turntable=4",
        "webp?size=64&sheet.turntable=4",
    ];
    let mut tags = vec![first.header("etag").map(str::to_owned)];
    for other in others {
        tags.push(server.get(&path(other)).header("etag").map(str::to_owned));
    }
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), 5, "{tags:?}");
    let location = server.post("/v1/jobs?size=32&sheet.turntable=3", &mesh).header("location").unwrap().to_owned();
    let job = server.request("GET", &location, &["Prefer: wait=30"], b"").json();
    assert_eq!(job["state"], "done", "{job}");
    assert_eq!(frames(&server.get(&format!("{location}/result"))).len(), 3);
}

#[test]
fn the_command_line_draws_sheets_and_turntables() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("gear.obj");
    std::fs::write(&mesh, shapes::gear(6)).unwrap();
    let mut drawn = 0;
    for (arguments, name) in [
        (&["--sheet", "front,left,top,iso"][..], "a.png"),
        (&["--turntable", "6"], "b.webp"),
        (&["--turntable", "6", "--set", "sheet.columns=3", "--explain"], "c.png"),
    ] {
        let output = folder.path().join(name);
        let mut command = meshsnap();
        command.arg("render").arg(&mesh).arg("-o").arg(&output).args(["--size", "96", "--backend", "cpu"]);
        let run = command.args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{said}");
        assert!(!arguments.contains(&"--explain") || said.matches("\nplan ").count() == 1, "{said}");
        let bytes = std::fs::read(&output).unwrap();
        assert!(name != "b.webp" || bytes.windows(4).filter(|chunk| chunk == b"ANMF").count() == 6);
        drawn += 1;
    }
    assert_eq!(drawn, 3);
    let mut command = meshsnap();
    command.arg("render").arg(&mesh).arg("-o").arg(folder.path().join("d.png"));
    let run = command.args(["--sheet", "front,nowhere"]).output().unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&run.stderr).contains("--sheet"));
}
