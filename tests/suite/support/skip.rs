//! Skipped tests, by name. libtest knows no skipped tests, so each one that lacks something says so
//! here: `tests/run` prints the list, and under `MESHSNAP_TEST_REQUIRE` the test fails instead.
#![allow(clippy::unwrap_used, clippy::panic)] // clippy knows tests, but not their helpers

use std::io::Write as _;
use std::panic::Location;

/// A thing that a test may lack.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// A Vulkan device; one in software will do.
    Gpu,
    /// The folder of meshes whose licences do not allow a copy in the repository.
    LargeData,
    /// A program on the `PATH`.
    Curl,
    /// A shell on the `PATH`.
    Shell,
    /// Leave to mount a file system in a namespace of one's own.
    Mount,
    /// Tools in Python, which `tests/run` installs into `target/python`.
    Python,
    /// `systemd-analyze` on the `PATH`.
    Systemd,
    /// A C compiler, `cc`, on the `PATH`.
    Compiler,
    /// `nats-server` on the `PATH`, and a later one, which `tests/run` installs into `target/python`.
    Nats,
    /// Chromium on the `PATH`, and the tools that drive it, which `tests/run` installs into `target/node`.
    Browser,
    /// The tools that build the pages of `web/`, which `tests/run` installs into `target/web`.
    Npm,
}

impl Need {
    /// Its word in `MESHSNAP_TEST_REQUIRE`.
    const fn word(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::LargeData => "data",
            Self::Curl => "curl",
            Self::Shell => "shells",
            Self::Mount => "mount",
            Self::Python => "python",
            Self::Systemd => "systemd",
            Self::Compiler => "compiler",
            Self::Nats => "nats",
            Self::Browser => "browser",
            Self::Npm => "npm",
        }
    }
}

/// Notes that the running test, or a part of it, is skipped because `what` is missing.
///
/// Panics where `MESHSNAP_TEST_REQUIRE` is `all` or lists the need's word: `gpu,curl`.
#[track_caller]
pub fn skip(need: Need, what: &str) {
    let required = std::env::var("MESHSNAP_TEST_REQUIRE").unwrap_or_default();
    let is_required = required.split(',').any(|word| word == "all" || word == need.word());
    assert!(!is_required, "MESHSNAP_TEST_REQUIRE={required}, and {what} is missing");
    let line = format!("{}: {what} is missing\n", test_name(Location::caller()));
    eprint!("skipped: {line}");
    if let Some(path) = std::env::var_os("MESHSNAP_TEST_SKIPPED") {
        // One write of a whole line, so that tests that run at the same time do not mix theirs.
        std::fs::OpenOptions::new().create(true).append(true).open(path).unwrap().write_all(line.as_bytes()).unwrap();
    }
}

/// libtest names a test's thread after the test, unless it runs all of them on the main thread.
fn test_name(caller: &Location<'_>) -> String {
    match std::thread::current().name() {
        Some(name) if name != "main" => name.to_owned(),
        _ => format!("{}:{}", caller.file(), caller.line()),
    }
}
