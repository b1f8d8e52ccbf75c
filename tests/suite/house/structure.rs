//! Who may import whom. ARCHITECTURE.md draws the picture; this holds it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Modules under `src/`, and what each may name of the others.
const ALLOWED: &[(&str, &[&str])] = &[
    ("limits", &[]),
    ("image", &[]),
    ("mesh", &["limits"]),
    ("report", &["mesh", "limits"]),
    ("scene", &["mesh", "image", "limits"]),
    ("plan", &["scene", "mesh", "image", "limits"]),
    ("backend", &["plan", "image", "limits"]),
    ("encode", &["image"]),
    ("pipeline", &["report", "encode", "backend", "plan", "scene", "mesh", "image", "limits"]),
    ("request", &["scene", "mesh", "image", "limits"]),
    ("jobs", &["pipeline", "backend", "scene", "mesh", "encode", "image", "limits"]),
    ("store", &["jobs", "mesh", "limits"]),
    (
        "http",
        &[
            "store",
            "jobs",
            "pipeline",
            "report",
            "request",
            "backend",
            "scene",
            "mesh",
            "image",
            "limits",
            "config",
            "telemetry",
        ],
    ),
    (
        "cli",
        &[
            "http",
            "pipeline",
            "report",
            "request",
            "backend",
            "scene",
            "mesh",
            "image",
            "limits",
            "config",
            "telemetry",
        ],
    ),
    ("config", &["request", "limits"]),
    ("telemetry", &["config"]),
    ("lib", &[]),
    ("main", &["cli"]),
];

/// Crates and what of std may be named where: a word, and the path prefixes under `src/` that may hold it.
const ONLY_UNDER: &[(&str, &[&str])] = &[
    ("wgpu::", &["backend/gpu/"]),
    ("axum::", &["http/"]),
    ("sha2::", &["store/"]),
    ("clap::", &["cli", "main.rs", "config"]),
    ("tokio::", &["http/", "jobs/", "main.rs", "cli", "telemetry"]),
    ("std::fs", &["cli", "config", "main.rs", "http/"]),
    ("std::env", &["cli", "config", "main.rs", "telemetry"]),
    ("Instant::now", &["cli", "http/", "jobs/", "telemetry", "main.rs"]),
    ("SystemTime", &["cli", "http/", "jobs/", "telemetry", "main.rs"]),
];

#[test]
fn imports_go_one_way() {
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let mut faults = Vec::new();
    let mut seen = 0;
    // A module's own tests may reach for anything that makes them short.
    for (file, text) in sources().into_iter().filter(|(file, _)| !file.ends_with("tests.rs")) {
        let module = file.split(['/', '.']).next().unwrap_or_default();
        let may =
            allowed.get(module).unwrap_or_else(|| panic!("src/{file}: say in ALLOWED what `{module}` may import"));
        for (line, used) in crate_paths(&text) {
            seen += 1;
            if used != module && allowed.contains_key(used.as_str()) && !may.contains(&used.as_str()) {
                faults.push(format!("src/{file}:{line}: {module} may not import {used}"));
            }
        }
    }
    assert!(seen > 50, "only {seen} imports found: the scan is broken");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_two_back_ends_do_not_know_each_other() {
    let mut files = 0;
    for (file, text) in sources() {
        for (own, other) in [("backend/cpu/", "gpu::"), ("backend/gpu/", "cpu::")] {
            if file.starts_with(own) {
                files += 1;
                assert!(!code(&text).any(|(_, line)| line.contains(other)), "src/{file} names {other}");
            }
        }
    }
    assert!(files >= 8, "only {files} back-end files found");
}

#[test]
fn libraries_stay_in_their_rooms() {
    let mut faults = Vec::new();
    let mut found = 0;
    for (file, text) in sources() {
        for (word, rooms) in ONLY_UNDER {
            for (line, content) in code(&text) {
                if content.contains(word) {
                    found += 1;
                    if !rooms.iter().any(|room| file.starts_with(room)) && !file.ends_with("tests.rs") {
                        faults.push(format!("src/{file}:{line}: {word} belongs under {rooms:?}"));
                    }
                }
            }
        }
    }
    assert!(found >= 5, "only {found} mentions found: the scan is broken");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_shader_has_a_cpu_twin_or_says_why_not() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut twins = 0;
    for entry in std::fs::read_dir(root.join("shaders")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if root.join("src/backend/cpu").join(format!("{name}.rs")).exists() {
            twins += 1;
        } else {
            let first = std::fs::read_to_string(&path).unwrap().lines().next().unwrap_or_default().to_owned();
            assert!(first.starts_with("//"), "{}: no twin, and no first line that says what it is", path.display());
        }
    }
    assert!(twins >= 3, "only {twins} twins");
}

/// Every Rust file under src, by its path from there.
fn sources() -> Vec<(String, String)> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    collect(&root, &root, &mut files);
    assert!(files.len() > 20, "only {} files under src", files.len());
    files
}

fn collect(root: &Path, folder: &Path, files: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(root, &path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let name = path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
            files.push((name, std::fs::read_to_string(&path).unwrap()));
        }
    }
}

/// Lines that are not comments, numbered from 1.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(|(_, line)| !line.trim_start().starts_with("//"))
}

/// The module names in `crate::NAME` and in `use crate::{NAME, ...}`, and in main.rs in `meshsnap::NAME`.
fn crate_paths(text: &str) -> Vec<(usize, String)> {
    let mut out = Vec::new();
    for (line, content) in code(text) {
        for prefix in ["crate::", "meshsnap::"] {
            for (at, _) in content.match_indices(prefix) {
                let rest = &content[at + prefix.len()..];
                let list = rest.strip_prefix('{').map_or_else(|| vec![rest], |l| l.split(',').collect());
                for item in list {
                    let name: String = item.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                    out.push((line, name));
                }
            }
        }
    }
    out
}
