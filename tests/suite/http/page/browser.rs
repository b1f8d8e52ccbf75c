//! Scripts that drive Chromium. A script starts the servers that it needs, and says of each case how it went.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use crate::support::server::meshsnap;
use crate::support::skip::{Need, skip};

/// The browser, and the folder of modules with this one in it. None, and the test counts as skipped, where one is
/// missing.
#[track_caller]
pub fn browser_and(module: &str) -> Option<(PathBuf, PathBuf)> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let find = |name: &str| std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file());
    let modules = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/node/node_modules");
    let Some(browser) = ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(find) else {
        skip(Need::Browser, "chromium");
        return None;
    };
    if !modules.join(module).is_dir() || find("node").is_none() {
        skip(Need::Browser, &format!("node, or {module} in target/node,"));
        return None;
    }
    Some((browser, modules))
}

/// Held while a browser runs: several at a time would take the processor from tests that have a deadline.
static BROWSER: Mutex<()> = Mutex::new(());

/// Runs a script of `tests/node/page`, all of whose cases must pass.
#[track_caller]
fn passes(script: &str, cases: usize) {
    let Some((browser, modules)) = browser_and("playwright-core") else { return };
    let _one = BROWSER.lock().unwrap_or_else(PoisonError::into_inner);
    let mut command = Command::new("node");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/node/page").join(script));
    command.env("MESHSNAP_TEST_PROGRAM", meshsnap().get_program()).env("MESHSNAP_TEST_BROWSER", browser);
    command.env("MESHSNAP_TEST_TOOLS", modules.parent().unwrap());
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{script}: {}\n{said}", output.status);
    assert_eq!(said.lines().filter(|line| line.starts_with("ok: ")).count(), cases, "{said}");
    println!("{said}");
}

#[test]
fn a_mesh_is_dropped_turned_and_styled_and_the_last_picture_is_shown() {
    passes("picture.mjs", 6);
}

#[test]
fn each_setting_changes_its_key() {
    passes("controls.mjs", 3);
}

#[test]
fn lines_to_copy_give_the_bytes_that_are_shown() {
    passes("lines.mjs", 2);
}

#[test]
fn troubles_are_said_in_the_servers_words() {
    passes("troubles.mjs", 7);
}

#[test]
fn operators_see_jobs_and_failures() {
    passes("status.mjs", 2);
}

#[test]
fn the_pages_work_below_a_path() {
    passes("prefix.mjs", 1);
}

#[test]
fn the_page_looks_as_it_was_looked_at() {
    passes("pictures.mjs", 3);
}

#[test]
fn the_pages_have_no_fault_of_accessibility() {
    passes("accessible.mjs", 4);
}
