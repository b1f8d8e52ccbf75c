//! `render --watch`: a picture that follows its files.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use crate::support::server::{CUBE_OBJ, meshsnap};

/// Far more than a change takes, on a machine that is busy with other tests.
const PATIENCE: Duration = Duration::from_secs(60);

/// A program that watches, with the lines that it says.
struct Watcher {
    child: Child,
    said: Receiver<String>,
}

impl Watcher {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut command = meshsnap();
        command.current_dir(folder).args(["render", "--watch", "--backend", "cpu", "--size", "32"]).args(arguments);
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let (sender, said) = channel();
        std::thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { child, said }
    }

    /// Waits until a line holds these words. Gives the lines up to it.
    #[track_caller]
    fn until(&self, words: &str) -> Vec<String> {
        let mut lines = Vec::new();
        loop {
            match self.said.recv_timeout(PATIENCE) {
                Ok(line) => lines.push(line),
                Err(error) => panic!("{error}: nobody said {words:?}, but {lines:?}"),
            }
            if lines.last().unwrap().contains(words) {
                return lines;
            }
        }
    }

    /// Waits until the program has ended by itself.
    #[track_caller]
    fn exit_code(&mut self) -> Option<i32> {
        loop {
            match self.said.recv_timeout(PATIENCE) {
                Ok(_) => {}
                Err(RecvTimeoutError::Disconnected) => return self.child.wait().unwrap().code(),
                Err(RecvTimeoutError::Timeout) => panic!("it still watches"),
            }
        }
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A cube that one factor stretches.
fn cube(factor: &str) -> Vec<u8> {
    String::from_utf8(CUBE_OBJ.to_vec()).unwrap().replace("v -1 ", &format!("v -{factor} ")).into_bytes()
}

/// Gives a file new content as editors do: a new file takes the old one's name.
fn replace(path: &Path, bytes: &[u8]) {
    let new = path.with_extension("new");
    fs::write(&new, bytes).unwrap();
    fs::rename(new, path).unwrap();
}

#[test]
fn a_picture_follows_its_mesh_through_faults_and_new_files() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, picture) = (folder.path().join("cube.obj"), folder.path().join("cube.png"));
    fs::write(&mesh, cube("1")).unwrap();
    let watcher = Watcher::start(folder.path(), &["cube.obj", "-o", "cube.png"]);
    watcher.until("waiting for changes of 1 file;");
    let first = fs::read(&picture).unwrap();

    // Written in place.
    fs::write(&mesh, cube("2.5")).unwrap();
    watcher.until("drawn in");
    let second = fs::read(&picture).unwrap();
    assert_ne!(first, second);

    // Broken: the old picture stays.
    replace(&mesh, b"v 0 0 0\nf 1 2 3\n");
    watcher.until("cube.obj: ");
    assert_eq!(fs::read(&picture).unwrap(), second);

    // Gone, and back.
    fs::remove_file(&mesh).unwrap();
    watcher.until("cube.obj: ");
    replace(&mesh, &cube("1"));
    watcher.until("drawn in");
    assert_eq!(fs::read(&picture).unwrap(), first);
}

#[test]
fn a_request_document_and_siblings_are_watched_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mesh = [b"mtllib cube.mtl\nusemtl paint\n", CUBE_OBJ].concat();
    fs::write(at("cube.obj"), mesh).unwrap();
    fs::write(at("cube.mtl"), "newmtl paint\nKd 1 0 0\n").unwrap();
    fs::write(at("look.json"), r#"{"style": "flat"}"#).unwrap();
    let watcher =
        Watcher::start(folder.path(), &["cube.obj", "-o", "cube.png", "--siblings", "--request", "look.json"]);
    watcher.until("waiting for changes of 3 files");
    let mut pictures = vec![fs::read(at("cube.png")).unwrap()];
    for (name, text) in [
        ("cube.mtl", "newmtl paint\nKd 0 0 1\n"),
        ("look.json", r#"{"style": "flat", "image": {"background": "transparent"}}"#),
    ] {
        replace(&at(name), text.as_bytes());
        watcher.until("drawn in");
        let picture = fs::read(at("cube.png")).unwrap();
        assert!(!pictures.contains(&picture), "{name} changed nothing");
        pictures.push(picture);
    }
}

#[test]
fn of_a_folder_only_the_meshes_that_changed_are_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("in")).unwrap();
    for name in ["in/a.obj", "in/b.obj"] {
        fs::write(at(name), cube("1")).unwrap();
    }
    // The pictures lie beside the meshes, and are no changes.
    let watcher = Watcher::start(folder.path(), &["in", "-o", "in/"]);
    let said = watcher.until("waiting for changes of 2 files");
    assert!(said.contains(&"2 drawn, 0 failed".to_owned()), "{said:?}");
    let b = fs::metadata(at("in/b.png")).unwrap().modified().unwrap();
    replace(&at("in/a.obj"), &cube("2.5"));
    assert_eq!(watcher.until("drawn in")[0], "1 drawn, 0 failed");
    assert_ne!(fs::read(at("in/a.png")).unwrap(), fs::read(at("in/b.png")).unwrap());
    assert_eq!(fs::metadata(at("in/b.png")).unwrap().modified().unwrap(), b);
    // A new mesh is found.
    fs::write(at("in/c.obj"), cube("1")).unwrap();
    assert_eq!(watcher.until("drawn in")[0], "1 drawn, 0 failed");
    assert_eq!(fs::read(at("in/c.png")).unwrap(), fs::read(at("in/b.png")).unwrap());
}

#[test]
fn what_cannot_be_watched_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cube.obj"), CUBE_OBJ).unwrap();
    for (arguments, code, part) in [
        (["-", "-o", "cube.png"], 2, "`-`, a stream"),
        (["cube.obj", "-o", "-"], 2, "`-`, a stream"),
        (["gone.obj", "-o", "cube.png"], 1, "gone.obj"),
        (["cube.obj", "-o", "cube.obj"], 2, "is the input itself"),
    ] {
        let mut watcher = Watcher::start(folder.path(), &arguments);
        watcher.until(part);
        assert_eq!(watcher.exit_code(), Some(code), "{arguments:?}");
    }
}
