//! `render MESH... -o DIR/`: a picture of each mesh.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::support::server::{CUBE_OBJ, meshsnap};

fn start(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = meshsnap();
    command.current_dir(folder).args(["render", "--backend", "cpu", "--size", "16"]).args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[track_caller]
fn render(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = start(folder, arguments).output().unwrap();
    assert!(stdout.is_empty());
    (status.code(), String::from_utf8(stderr).unwrap())
}

/// All files below a folder, with their content.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in fs::read_dir(&at).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// A folder `in` with 300 boxes, of which every hundredth is broken.
fn many() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("in")).unwrap();
    for i in 0..300 {
        let text = String::from_utf8(CUBE_OBJ.to_vec()).unwrap().replacen("v -1 -1 -1", &format!("v -1.{i} -1 -1"), 1);
        let text = if i % 100 == 50 { "v 0 0 0\nf 1 2 3\n".to_owned() } else { text };
        fs::write(folder.path().join(format!("in/box{i:03}.obj")), text).unwrap();
    }
    folder
}

#[test]
fn three_hundred_meshes_of_which_three_are_broken() {
    let folder = many();
    let (code, said) = render(folder.path(), &["in", "-o", "out/"]);
    assert_eq!(code, Some(1), "{said}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 4, "{said}");
    for (line, name) in lines.iter().zip(["in/box050.obj: ", "in/box150.obj: ", "in/box250.obj: "]) {
        assert!(line.starts_with("meshsnap: ") && line.contains(name), "{said}");
    }
    assert_eq!(lines[3], "297 drawn, 3 failed");
    let pictures = files(&folder.path().join("out"));
    assert_eq!(pictures.len(), 297);

    // The messages and the bytes are the same whatever the threads, and those of single calls.
    let (code, again) = render(folder.path(), &["in", "-o", "again/", "--threads", "3"]);
    assert_eq!((code, again), (Some(1), said));
    assert!(files(&folder.path().join("again")) == pictures);
    assert_eq!(render(folder.path(), &["in/box007.obj", "-o", "one.png"]).0, Some(0));
    assert!(fs::read(folder.path().join("one.png")).unwrap() == pictures[Path::new("box007.png")]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_batch_has_whole_pictures_and_no_other_files() {
    let folder = many();
    let out = folder.path().join("out");
    let began = std::time::Instant::now();
    assert_eq!(render(folder.path(), &["in", "-o", "out/"]).0, Some(1));
    let (whole_run, expected) = (began.elapsed(), files(&out));
    let (mut interrupted, mut partly, mut random) = (0, 0, 0x9e37_79b9_u32);
    for round in 0..50 {
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        let mut child = start(folder.path(), &["in", "-o", "out/"]).stderr(Stdio::null()).spawn().unwrap();
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        std::thread::sleep(whole_run.mul_f64(f64::from(random >> 8) / f64::from(1 << 24)));
        let signal = if round % 2 == 0 { "-INT" } else { "-TERM" };
        let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
        interrupted += u32::from(child.wait().unwrap().code() != Some(1));
        let found = files(&out);
        partly += u32::from(!found.is_empty() && found.len() < expected.len());
        for (name, bytes) in &found {
            assert!(expected.get(name) == Some(bytes), "round {round}: {}", name.display());
        }
    }
    assert!(interrupted >= 10 && partly >= 5, "{interrupted} interrupted, {partly} of them in the midst");
}

#[test]
fn files_that_belong_to_meshes_are_found_where_they_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    };
    write("m/red.obj", &[b"mtllib red.mtl\nusemtl red\n", CUBE_OBJ].concat());
    write("m/red.mtl", b"newmtl red\nKd 1 0 0\n");
    write("m/sub/blue.obj", &[b"mtllib ../../lib/blue.mtl\nusemtl blue\n", CUBE_OBJ].concat());
    write("lib/blue.mtl", b"newmtl blue\nKd 0 0 1\n");
    let red = || fs::read(folder.path().join("out/red.png")).unwrap();
    let done = (Some(0), "1 drawn, 0 failed\n".to_owned());

    let (code, said) = render(folder.path(), &["m/red.obj", "-o", "out/"]);
    let advice = "meshsnap: m/red.obj refers to \"m/red.mtl\", which lies beside it: name it too, or add --siblings\n";
    assert_eq!((code, said), (Some(0), format!("{advice}1 drawn, 0 failed\n")));
    let grey = red();
    for arguments in [&["m/red.obj", "m/red.mtl", "-o", "out"][..], &["m/red.obj", "--siblings", "-o", "out/"]] {
        assert_eq!(render(folder.path(), arguments), done, "{arguments:?}");
        assert!(red() != grey, "{arguments:?}");
    }
    // A folder names the files in it, and no others.
    let (code, said) = render(folder.path(), &["m", "-o", "out/"]);
    assert!(code == Some(0) && said.ends_with("2 drawn, 0 failed\n") && said.lines().count() == 2, "{said}");
    assert!(said.contains("m/sub/blue.obj: warning: the command does not name the material library"), "{said}");
    let (code, said) = render(folder.path(), &["m", "lib/blue.mtl", "-o", "out/"]);
    assert_eq!((code, said.as_str()), (Some(0), "2 drawn, 0 failed\n"));
    assert!(folder.path().join("out/sub/blue.png").is_file());
}

#[test]
fn no_picture_replaces_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("wood.obj", &[b"mtllib wood.mtl\nusemtl wood\nvt 0 0\n", CUBE_OBJ].concat());
    write("wood.mtl", b"newmtl wood\nmap_Kd wood.png\n");
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    write("wood.png", png.get_ref());
    write("cube.obj", CUBE_OBJ);
    for arguments in [
        &["wood.obj", "cube.obj", "--siblings", "-o", "./"][..],
        &["wood.obj", "cube.obj", "wood.mtl", "wood.png", "-o", "."],
        &[".", "-o", "."],
    ] {
        let (code, said) = render(folder.path(), arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {said}");
        assert!(said.contains("never written over") && said.ends_with("1 drawn, 1 failed\n"), "{arguments:?}: {said}");
        assert!(fs::read(folder.path().join("wood.png")).unwrap() == *png.get_ref(), "{arguments:?}");
        fs::remove_file(folder.path().join("cube.png")).unwrap();
    }
}
