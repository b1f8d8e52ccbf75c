//! The pages that are checked in are what their sources in `web/` give, and the sources fit the interface.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::skip::{Need, skip};

/// A copy of `web/` with the tools that build it, which `tests/run` installs into `target/web`. None, and the test counts
/// as skipped, where they are missing.
#[track_caller]
fn workshop() -> Option<tempfile::TempDir> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let modules = root.join("target/web/node_modules");
    if !modules.is_dir() {
        skip(Need::Npm, "target/web, for which npm's registry is needed,");
        return None;
    }
    // Tools of another list may build other bytes.
    let lists =
        ["target/web/package-lock.json", "web/package-lock.json"].map(|path| fs::read(root.join(path)).unwrap());
    assert!(lists[0] == lists[1], "target/web is old: run tests/run");
    let folder = tempfile::tempdir().unwrap();
    copy(&root.join("web"), &folder.path().join("web"));
    std::os::unix::fs::symlink(modules, folder.path().join("web/node_modules")).unwrap();
    std::os::unix::fs::symlink(root.join("api"), folder.path().join("api")).unwrap();
    Some(folder)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        match path.is_dir() {
            _ if entry.file_name() == "node_modules" => {}
            true => copy(&path, &to),
            false => fs::copy(&path, &to).map(drop).unwrap(),
        }
    }
}

/// Runs one of the scripts that `web/package.json` has.
fn script(folder: &tempfile::TempDir, name: &str) {
    let mut command = Command::new("npm");
    command.args(["run", "--silent", name]).current_dir(folder.path().join("web")).stdin(Stdio::null());
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "npm run {name}: {}\n{said}", output.status);
}

#[test]
fn the_pages_are_what_their_sources_give() {
    let Some(folder) = workshop() else { return };
    script(&folder, "build");
    let pages: PathBuf = ["src", "server", "page"].iter().collect();
    for name in ["index.html", "status.html"] {
        let made = fs::read(folder.path().join(&pages).join(name)).unwrap();
        let stored = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(&pages).join(name)).unwrap();
        assert!(made == stored, "src/server/page/{name} is old: run `npm ci && npm run build` in web/");
    }
}

#[test]
fn looks_lines_cameras_and_controls_of_the_pages_are_right() {
    let Some(folder) = workshop() else { return };
    script(&folder, "test");
}

#[test]
fn the_sources_of_the_pages_fit_the_described_interface() {
    let Some(folder) = workshop() else { return };
    script(&folder, "check");
}
