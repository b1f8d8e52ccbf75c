//! `meshsnap diff` of two meshes or two pictures: words, exit codes, mistakes, and the pictures
//! that it writes.

use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::support::server::{CUBE_OBJ, meshsnap};

/// A cube, the same in another order, one without a side, one that moved; and one with a material library, twice.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let cube = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    write("cube.obj", &cube);
    write("copy.obj", &cube);
    let (faces, others): (Vec<&str>, Vec<&str>) = cube.lines().partition(|line| line.starts_with("f "));
    let backwards: Vec<&str> = others.iter().copied().chain(faces.into_iter().rev()).collect();
    write("order.obj", &backwards.join("\n"));
    write("hole.obj", &cube.replace("f 4 1 5 8\n", ""));
    write("moved.obj", &cube.replace("v 1 ", "v 1.5 ").replace("v -1 ", "v -0.5 "));
    for (name, color) in [("old", "1 0 0"), ("new", "0 1 0")] {
        fs::create_dir(folder.path().join(name)).unwrap();
        write(&format!("{name}/cube.obj"), &format!("mtllib cube.mtl\nusemtl paint\n{cube}"));
        write(&format!("{name}/cube.mtl"), &format!("newmtl paint\nKd {color}\n"));
    }
    write("broken.stl", "solid");
    folder
}

fn diff(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = meshsnap();
    command.current_dir(folder).arg("diff").args(arguments).stdin(Stdio::null());
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// Arguments, the exit code, a part of standard output and one of standard error.
const CASES: &[(&str, i32, &str, &str)] = &[
    ("cube.obj copy.obj", 0, "same\n  the files are equal, byte for byte\n", ""),
    ("cube.obj order.obj", 0, "same\n  the geometry is unchanged, with vertices or faces in another order\n", ""),
    ("cube.obj hole.obj", 1, "different\n  a hole with 4 edges near (-1, 0, 0)\n  it is no longer watertight\n", ""),
    ("hole.obj cube.obj", 1, "the hole with 4 edges near (-1, 0, 0) is closed\n  it is watertight now\n", ""),
    ("cube.obj moved.obj", 1, "different\n  the whole mesh moved by (0.5, 0, 0)\ndistance   at most 0.5", ""),
    ("cube.obj moved.obj --max-distance 0.5", 0, "same\n", ""),
    ("cube.obj moved.obj --max-distance 0.49", 1, "different\n", ""),
    ("old/cube.obj new/cube.obj --siblings", 1, "the material \"paint\" changed: colour\n", ""),
    ("cube.obj absent.obj", 1, "", "absent.obj: there is no such file"),
    ("broken.stl cube.obj", 1, "", "broken.stl: "),
    ("cube.obj", 2, "", "<B>"),
    ("- -", 2, "", "can be given once"),
    ("cube.obj moved.obj --max-distance -1", 2, "", "give a number from 0 on"),
    ("cube.obj moved.obj --max-distance nan", 2, "", "give a number from 0 on"),
];

#[test]
fn exit_codes_and_words() {
    let folder = folder();
    for (arguments, code, stdout, stderr) in CASES {
        let words: Vec<&str> = arguments.split_whitespace().collect();
        let (found, out, said) = diff(folder.path(), &words);
        assert_eq!(found, Some(*code), "{arguments}: {out}{said}");
        assert!(out.contains(stdout) && said.contains(stderr), "{arguments}: {out}{said}");
        assert!(*code != 2 || out.is_empty(), "{arguments}: {out}");
    }
}

#[test]
fn the_json_has_the_names_of_the_interface() {
    let folder = folder();
    let (code, out, _) = diff(folder.path(), &["cube.obj", "moved.obj", "--json"]);
    assert_eq!(code, Some(1));
    let json: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&json["same"], &json["geometry"]["same"]), (&false.into(), &false.into()));
    assert_eq!((&json["geometry"]["hausdorff"], &json["geometry"]["unit"]), (&0.5.into(), &"file".into()));
    assert!(json["geometry"]["mean"].as_f64().unwrap() > 0.0 && json["geometry"]["stated_error"].is_number());
    assert_eq!((&json["counts"]["a"]["triangles"], &json["counts"]["b"]["triangles"]), (&12.into(), &12.into()));
    assert_eq!((&json["materials"]["same"], &json["topology"]["same"]), (&true.into(), &true.into()));
    assert_eq!(json["summary"], serde_json::json!(["the whole mesh moved by (0.5, 0, 0)"]));
    // The bytes are the same each time.
    assert_eq!(diff(folder.path(), &["cube.obj", "moved.obj", "--json"]).1, out);
}

/// A PNG of grey pixels, of which the first of the second row have another red.
fn png(folder: &Path, name: &str, side_px: u32, others: u32, red: u8) {
    let mut image = image::RgbaImage::from_pixel(side_px, side_px, image::Rgba([100, 100, 100, 255]));
    (0..others).for_each(|x| image.put_pixel(x, 1, image::Rgba([red, 100, 100, 255])));
    image.save(folder.join(name)).unwrap();
}

/// As [`CASES`], for pictures.
const PICTURES: &[(&str, i32, &str, &str)] = &[
    ("a.png a.png", 0, "same\n  no pixel differs\n", ""),
    (
        "a.png b.png",
        1,
        "different\n  3 pixels differ of 64 (4.69 %), by up to 4 of 255, within (0, 1) to (2, 1); FLIP ",
        "",
    ),
    ("a.png b.png --max-pixels 3", 0, "same\n", ""),
    ("a.png b.png --max-pixels 2", 1, "different\n", ""),
    ("a.png b.png --max-error 4", 0, "no pixel differs by more than 4 of 255: the largest difference is 4\n", ""),
    ("a.png b.png --max-error 3.9", 1, "3 pixels differ", ""),
    ("a.png b.png --max-flip 0.5", 0, "same\n", ""),
    ("a.png b.png --max-flip 0.0001", 1, "different\n", ""),
    ("a.png b.png --max-flip 0.5 --max-pixels 2", 1, "different\n", ""),
    ("a.png b.png --max-flip 2", 2, "", "give a number from 0 to 1"),
    ("a.png b.png --blink out.jpg", 2, "", "JPEG has no animations"),
    ("a.png b.png --side-by-side a.png", 2, "", "inputs are never written over"),
    ("a.png b.png --side-by-side -", 2, "", "--side-by-side -: standard output has the difference"),
    ("cube.obj copy.obj --max-flip 0.5", 2, "", "are for pictures"),
    ("cube.obj copy.obj --heat flip", 2, "", "--heat is for pictures"),
    ("a.png c.png -o out.png", 1, "the size is 4 x 4 px, before 8 x 8 px", "out.png: is not written"),
    ("a.png broken.png", 1, "", "broken.png: the picture cannot be read"),
    ("a.png cube.obj", 2, "", "a.png is a picture and cube.obj is none"),
    ("cube.obj a.png", 2, "", "a.png is a picture and cube.obj is none"),
    ("a.png b.png --max-distance 1", 2, "", "--max-distance is for meshes"),
    ("cube.obj copy.obj --max-pixels 1", 2, "", "are for pictures"),
    ("a.png b.png -o b.png", 2, "", "inputs are never written over"),
    ("a.png b.png -o -", 2, "", "name a file"),
    ("a.png b.png -o heat.gif", 2, "", "no image format is called `gif`"),
];

#[test]
fn pictures_are_compared_pixel_by_pixel() {
    let folder = folder();
    png(folder.path(), "a.png", 8, 0, 0);
    png(folder.path(), "b.png", 8, 3, 104);
    png(folder.path(), "c.png", 4, 0, 0);
    fs::write(folder.path().join("broken.png"), b"\x89PNG\r\n\x1a\n and so on").unwrap();
    for (arguments, code, stdout, stderr) in PICTURES {
        let words: Vec<&str> = arguments.split_whitespace().collect();
        let (found, out, said) = diff(folder.path(), &words);
        assert_eq!(found, Some(*code), "{arguments}: {out}{said}");
        assert!(out.contains(stdout) && said.contains(stderr), "{arguments}: {out}{said}");
    }
    assert_eq!(diff(folder.path(), &["a.png", "b.png", "-o", "heat.png"]).0, Some(1));
    let heat = image::open(folder.path().join("heat.png")).unwrap().into_rgba8();
    let colored = heat.enumerate_pixels().filter(|(_, _, pixel)| pixel[0] != pixel[2]);
    assert_eq!(colored.map(|(x, y, _)| (x, y)).collect::<Vec<_>>(), [(0, 1), (1, 1), (2, 1)]);
}

/// The cube, with a copy of it six units to the right.
fn two_cubes() -> String {
    let cube = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    let mut text = format!("{cube}\n");
    for line in cube.lines() {
        let mut words = line.split_whitespace();
        let head = words.next();
        let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
        match (head, numbers.as_slice()) {
            (Some("v"), [x, y, z]) => text += &format!("v {} {y} {z}\n", x + 6.0),
            (Some("f"), corners) => {
                text += &format!("f{}\n", corners.iter().map(|v| format!(" {}", v + 8.0)).collect::<String>());
            }
            _ => {}
        }
    }
    text
}

#[test]
fn the_picture_of_two_meshes_has_both_in_one_frame() {
    let folder = folder();
    fs::write(folder.path().join("two.obj"), two_cubes()).unwrap();
    let (code, out, said) = diff(folder.path(), &["cube.obj", "two.obj", "-o", "heat.png"]);
    assert!(code == Some(1) && out.contains("one part with 12 triangles was added near (6, 0, 0)"), "{out}{said}");
    let image = image::open(folder.path().join("heat.png")).unwrap().into_rgba8();
    assert_eq!(image.dimensions(), (1024, 512));
    // The first and the last column of a side with such a pixel, above the legend and the names.
    let columns = |from: u32, is_meant: &dyn Fn(&image::Rgba<u8>) -> bool| -> (u32, u32) {
        let is_in = |x: u32, y: u32| (from..from + 512).contains(&x) && y < 440;
        let met = image.enumerate_pixels().filter(|(x, y, pixel)| is_in(*x, *y) && is_meant(pixel));
        met.map(|(x, ..)| x - from).fold((u32::MAX, 0), |(low, high), x| (low.min(x), high.max(x)))
    };
    let is_red = |pixel: &image::Rgba<u8>| i32::from(pixel[0]) > i32::from(pixel[2]) + 60;
    let is_drawn = |pixel: &image::Rgba<u8>| pixel[2] < 240;
    let (before, after, red) = (columns(0, &is_drawn), columns(512, &is_drawn), columns(512, &is_red));
    // The cube begins at the same column on both sides, and on the left nothing is where the new part is.
    assert!(before.0.abs_diff(after.0) <= 1 && before.1 + 50 < after.1, "{before:?} {after:?}");
    assert!(red.0 > before.1 && red.1.abs_diff(after.1) <= 2, "{red:?} {after:?}");
    assert_eq!(columns(0, &is_red), (u32::MAX, 0));
    // The bytes are the same each time.
    let bytes = fs::read(folder.path().join("heat.png")).unwrap();
    diff(folder.path(), &["cube.obj", "two.obj", "-o", "heat.png"]);
    assert!(fs::read(folder.path().join("heat.png")).unwrap() == bytes);
    assert_eq!(diff(folder.path(), &["cube.obj", "cube.obj", "-o", "heat.webp"]).0, Some(0));
    assert_eq!(diff(folder.path(), &["cube.obj", "two.obj", "-o", "two.obj"]).0, Some(2));
}

#[test]
fn both_sides_are_shown_beside_each_other_and_by_turns() {
    let folder = folder();
    png(folder.path(), "a.png", 8, 0, 0);
    png(folder.path(), "b.png", 8, 3, 200);
    let words = ["--side-by-side", "three.png", "--blink", "blink.png", "-o", "heat.png", "--heat", "flip"];
    assert_eq!(diff(folder.path(), &[&["a.png", "b.png"], &words[..]].concat()).0, Some(1));
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().to_rgba8();
    let three = open("three.png");
    assert_eq!(three.dimensions(), (24, 8));
    assert_eq!([three.get_pixel(0, 1)[0], three.get_pixel(8, 1)[0]], [100, 200]);
    assert_eq!(*three.get_pixel(16, 1), *open("heat.png").get_pixel(0, 1));
    let frames = |name: &str| {
        let decoder =
            image::codecs::png::PngDecoder::new(std::io::Cursor::new(fs::read(folder.path().join(name)).unwrap()));
        use image::AnimationDecoder as _;
        decoder.unwrap().apng().unwrap().into_frames().collect_frames().unwrap()
    };
    let shown = frames("blink.png");
    assert_eq!(shown.len(), 2);
    assert_eq!([0, 1].map(|frame: usize| shown[frame].buffer().get_pixel(0, 1)[0]), [100, 200]);

    // Meshes: through one camera, so that the cube that moved lies elsewhere.
    let words = ["cube.obj", "moved.obj", "--side-by-side", "three.png", "--blink", "blink.png"];
    assert_eq!(diff(folder.path(), &words).0, Some(1));
    let three = open("three.png");
    assert_eq!(three.dimensions(), (3 * 512, 512));
    let shown = frames("blink.png");
    // Where the picture is not white, below the label.
    let middle = |at: u32| {
        let inked =
            (0..512).filter(|x| (60..512).any(|y| three.get_pixel(at * 512 + x, y)[2] < 230)).collect::<Vec<_>>();
        (inked[0] + inked[inked.len() - 1]) / 2
    };
    assert!(middle(1) > middle(0) + 20, "{} {}", middle(0), middle(1));
    let side = |frame: usize| image::imageops::crop_imm(&three, frame as u32 * 512, 0, 512, 512).to_image();
    assert!((0..2).all(|frame| *shown[frame].buffer() == side(frame)));
}

#[test]
fn what_is_gone_is_seen_on_the_older_side() {
    let folder = folder();
    let hole = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    // A side that the camera sees.
    fs::write(folder.path().join("open.obj"), hole.replace("f 5 6 7 8\n", "")).unwrap();
    fs::write(folder.path().join("two.obj"), two_cubes()).unwrap();
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().to_rgba8();
    let red = |image: &image::RgbaImage, side: u32| {
        let is_red = |[r, g, b, _]: [i32; 4]| r > g + 60 && r > b + 60;
        let is_in = |x: u32, y: u32| (512 * side..512 * side + 512).contains(&x) && y < 440;
        image.enumerate_pixels().filter(|(x, y, pixel)| is_in(*x, *y) && is_red(pixel.0.map(i32::from))).count()
    };
    let words = ["cube.obj", "open.obj", "-o", "heat.png", "--side-by-side", "three.png"];
    let (code, out, said) = diff(folder.path(), &words);
    assert!(code == Some(1) && out.contains("a hole with 4 edges near ("), "{out}{said}");
    let (heat, three) = (open("heat.png"), open("three.png"));
    assert!((40..2000).contains(&red(&heat, 0)), "{}", red(&heat, 0));
    assert!((40..2000).contains(&red(&three, 2)), "{}", red(&three, 2));
    assert_eq!([red(&heat, 1), red(&three, 0), red(&three, 1)], [0; 3]);
    // A part that was removed, and one that was added: the third picture has it.
    for words in [["two.obj", "cube.obj"], ["cube.obj", "two.obj"]] {
        assert_eq!(diff(folder.path(), &[&words[..], &["--side-by-side", "three.png"]].concat()).0, Some(1));
        let three = open("three.png");
        assert!(red(&three, 2) > 1000 && red(&three, 0) + red(&three, 1) == 0, "{words:?}: {}", red(&three, 2));
    }
}
