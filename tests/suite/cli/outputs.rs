//! Files that the command line writes: never over an input, and whole or not at all.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::server::{CUBE_OBJ, meshsnap};

/// A folder with `cube.obj`, `cube.mtl` and `look.json` in it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cube.obj"), CUBE_OBJ).unwrap();
    fs::write(folder.path().join("cube.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    fs::write(folder.path().join("look.json"), "{}").unwrap();
    folder
}

fn render(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = meshsnap();
    command.current_dir(folder).args(["render", "--backend", "cpu", "--size", "16"]).args(arguments);
    let output = command.stdin(Stdio::null()).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Names of the files in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn an_input_is_never_written_over() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("sub")).unwrap();
    fs::hard_link(at("cube.obj"), at("hard.png")).unwrap();
    let mut outputs = vec![
        ("cube.obj", "is the input itself"),
        ("./cube.obj", "the input cube.obj"),
        ("sub/../cube.obj", "the input cube.obj"),
        ("hard.png", "the input cube.obj"),
        ("cube.mtl", "is the input itself"),
        ("look.json", "is the input itself"),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("cube.obj", at("soft.png")).unwrap();
        std::os::unix::fs::symlink("../soft.png", at("sub/softer.png")).unwrap();
        outputs.extend([("soft.png", "the input cube.obj"), ("sub/softer.png", "the input cube.obj")]);
    }
    let before = names(folder.path());
    for (output, part) in &outputs {
        let arguments = ["cube.obj", "cube.mtl", "--request", "look.json", "-o", output, "--format", "png"];
        let (code, stderr) = render(folder.path(), &arguments);
        assert_eq!(code, Some(2), "{output}: {stderr}");
        assert!(stderr.contains(part) && stderr.contains("never written over"), "{output}: {stderr}");
        assert_eq!(fs::read(at("cube.obj")).unwrap(), CUBE_OBJ, "{output}");
    }
    assert_eq!((fs::read(at("look.json")).unwrap(), names(folder.path())), (b"{}".to_vec(), before));
}

#[cfg(unix)]
#[test]
fn standard_input_is_an_input_too() {
    let folder = folder();
    let mesh = folder.path().join("cube.obj");
    let mut command = meshsnap();
    command.current_dir(folder.path()).args(["render", "-", "-o", "cube.obj", "--format", "png"]);
    let output = command.stdin(fs::File::open(&mesh).unwrap()).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read(&mesh).unwrap(), CUBE_OBJ);
}

/// As `--explain 2>&1 | head -1` does it.
#[test]
fn a_closed_pipe_for_words_costs_no_picture() {
    let folder = folder();
    for (arguments, code) in
        [(&["cube.obj", "-o", "a.png", "--explain"][..], 0), (&["cube.obj", "-o", "b.png", "--style", "wier"], 2)]
    {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = meshsnap();
        command.current_dir(folder.path()).args(["render", "--backend", "cpu", "--size", "16"]).args(arguments);
        let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(writer).status().unwrap();
        assert_eq!(status.code(), Some(code), "{arguments:?}: {status}");
    }
    assert_eq!(fs::read(folder.path().join("a.png")).unwrap()[1..4], *b"PNG");
}

#[test]
fn a_failure_leaves_the_old_picture_and_nothing_else() {
    let folder = folder();
    fs::write(folder.path().join("out.png"), "old").unwrap();
    fs::write(folder.path().join("bad.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    let before = names(folder.path());
    let (code, stderr) = render(folder.path(), &["bad.obj", "-o", "out.png"]);
    assert_eq!(code, Some(1), "{stderr}");
    assert_eq!(fs::read(folder.path().join("out.png")).unwrap(), b"old");
    let (code, stderr) = render(folder.path(), &["cube.obj", "-o", "no/out.png"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(stderr.contains("there is no folder no"), "{stderr}");
    assert_eq!(names(folder.path()), before);
}

/// A link keeps being one, permissions are kept, new files have those of the umask, and what is no file
/// is written to.
#[cfg(unix)]
#[test]
fn what_is_replaced_stays_what_it_was() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode() & 0o777;
    let is_png = |name: &str| fs::read(at(name)).unwrap().starts_with(b"\x89PNG");
    fs::create_dir(at("real")).unwrap();
    fs::write(at("real/old.png"), "old").unwrap();
    fs::set_permissions(at("real/old.png"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink("real/old.png", at("link.png")).unwrap();
    symlink("real/new.png", at("dangling.png")).unwrap();
    for name in ["link.png", "dangling.png"] {
        let (code, stderr) = render(folder.path(), &["cube.obj", "-o", name]);
        assert_eq!(code, Some(0), "{name}: {stderr}");
        assert!(fs::symlink_metadata(at(name)).unwrap().is_symlink() && is_png(name), "{name}");
    }
    fs::write(at("plain"), "").unwrap();
    assert_eq!((mode("real/old.png"), mode("real/new.png")), (0o640, mode("plain")));
    let (code, stderr) = render(folder.path(), &["cube.obj", "-o", "/dev/null", "--format", "png"]);
    assert_eq!(code, Some(0), "{stderr}");

    symlink("b.png", at("a.png")).unwrap();
    symlink("a.png", at("b.png")).unwrap();
    let (code, stderr) = render(folder.path(), &["cube.obj", "-o", "a.png"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(stderr.contains("in a circle"), "{stderr}");
    fs::set_permissions(at("real/old.png"), fs::Permissions::from_mode(0o440)).unwrap();
    let (code, stderr) = render(folder.path(), &["cube.obj", "-o", "real/old.png"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(stderr.contains("read-only"), "{stderr}");
    assert!(names(&at("real")) == ["new.png", "old.png"]);
}

/// Signals at moments over the whole run: there is the old picture or the new one, and no other file.
#[cfg(unix)]
#[test]
fn an_interrupted_render_leaves_nothing_half_written() {
    let folder = folder();
    let out = folder.path().join("out.png");
    let arguments = ["render", "cube.obj", "-o", "out.png", "--format", "png", "--size", "1024", "--backend", "cpu"];
    let start = || {
        let mut command = meshsnap();
        command.current_dir(folder.path()).args(arguments).stderr(Stdio::null());
        command.spawn().unwrap()
    };
    let began = std::time::Instant::now();
    assert!(start().wait().unwrap().success());
    let (whole_run, new) = (began.elapsed(), fs::read(&out).unwrap());
    let expected = names(folder.path());
    let (mut interrupted, mut random) = (0, 0x9e37_79b9_u32);
    for round in 0..50 {
        fs::write(&out, "old").unwrap();
        let mut child = start();
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        std::thread::sleep(whole_run.mul_f64(f64::from(random >> 8) / f64::from(1 << 24)));
        let signal = if round % 2 == 0 { "-INT" } else { "-TERM" };
        let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
        interrupted += u32::from(!child.wait().unwrap().success());
        let bytes = fs::read(&out).unwrap();
        assert!(bytes == b"old" || bytes == new, "round {round}: {} bytes", bytes.len());
        assert_eq!(names(folder.path()), expected, "round {round}");
    }
    assert!(interrupted >= 5, "only {interrupted} of 50 were interrupted");
}
