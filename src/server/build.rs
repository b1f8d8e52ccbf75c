//! The build script, which tells the program the commit that it is built from, for `/version`.
//!
//! `MESHSNAP_COMMIT` comes first, for builds without the repository, such as that of the container. Otherwise a
//! build of the release profile asks git. Builds of the dev profile have none, so that a commit
//! does not make them compile again.

use std::process::Command;

/// The repository, from this package's folder, which is where this runs.
const ROOT: &str = "../..";

fn main() {
    println!("cargo:rerun-if-env-changed=MESHSNAP_COMMIT");
    println!("cargo:rerun-if-changed=build.rs");
    let given = std::env::var("MESHSNAP_COMMIT").ok();
    let is_release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    if is_release {
        println!("cargo:rerun-if-changed={ROOT}/.git/logs/HEAD");
    }
    let commit = given.or_else(|| if is_release { head() } else { None });
    if let Some(commit) = commit.filter(|commit| is_hash(commit)) {
        println!("cargo:rustc-env=MESHSNAP_BUILT_FROM={commit}");
    }
}

/// The commit that is checked out here. None if this is no repository: an archive of the crate may lie within another one.
fn head() -> Option<String> {
    std::path::Path::new(ROOT).join(".git").exists().then_some(())?;
    let output = Command::new("git").args(["rev-parse", "HEAD"]).output().ok().filter(|out| out.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

fn is_hash(text: &str) -> bool {
    (7..=64).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}
