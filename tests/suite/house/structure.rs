//! The rules of the source tree: imports between rooms, circles between files, crowded folders.
//! ARCHITECTURE.md draws the picture; these tests hold it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms under `src/`, and what each may name of the others. A file belongs to the room with the
/// longest name that begins its path.
const ALLOWED: &[(&str, &[&str])] = &[
    ("limits", &[]),
    // The transfer function that importers, colours of a request, textures and the stored byte share.
    ("srgb", &[]),
    ("image", &["srgb"]),
    ("warning", &[]),
    ("guard", &[]),
    ("pluralise", &[]),
    ("percent", &[]),
    ("parallel", &[]),
    // For the tests of several rooms.
    ("made_obj", &[]),
    ("mesh", &["parallel", "limits", "warning"]),
    ("import", &["guard", "mesh", "parallel", "srgb", "limits", "warning", "pluralise"]),
    ("report", &["import", "texture", "mesh", "limits", "warning", "pluralise"]),
    // Of the report the bounds, of the plan the overlaps in the texture.
    ("check", &["report", "import", "texture", "plan", "mesh", "limits", "pluralise"]),
    // Of the report the bounds and the topology under the names that clients read, of the plan the colours of numbers.
    ("diff", &["report", "import", "plan", "mesh", "guard", "image", "srgb", "parallel", "limits", "pluralise"]),
    ("spec", &["mesh", "image", "srgb", "limits"]),
    ("request", &["spec", "mesh", "image", "limits"]),
    ("texture", &["guard", "mesh", "srgb", "limits", "warning"]),
    ("scene", &["spec", "mesh", "parallel", "limits"]),
    ("plan", &["scene", "spec", "texture", "mesh", "parallel", "image", "limits", "warning"]),
    // Of spec the choice of a back-end alone.
    ("backend", &["plan", "spec", "image", "srgb", "limits"]),
    ("encode", &["image", "limits"]),
    ("caption", &["image"]),
    ("sheet", &["caption", "spec", "image", "limits"]),
    (
        "pipeline",
        &[
            "check", "diff", "report", "import", "encode", "caption", "sheet", "backend", "plan", "scene", "spec",
            "mesh", "image", "limits", "warning",
        ],
    ),
    (
        "service/jobs",
        &[
            "service/metrics",
            "service/durable",
            "service/digest",
            "service/memory",
            "service/priority",
            "service/residents",
            "pipeline",
            "check",
            "report",
            "backend",
            "spec",
            "import",
            "mesh",
            "encode",
            "image",
            "limits",
            "warning",
            // Of it the traces alone.
            "telemetry",
        ],
    ),
    ("service/memory", &["limits"]),
    ("service/priority", &[]),
    ("service/cache", &["service/memory"]),
    ("service/metrics", &[]),
    ("service/signature", &[]),
    // Of jobs the owner alone, here and in rates.
    ("service/keys", &["service/digest", "service/jobs"]),
    ("service/rates", &["service/jobs"]),
    ("service/digest", &["import"]),
    ("service/durable", &["service/digest"]),
    ("service/residents", &["service/cache", "service/memory", "pipeline", "limits"]),
    ("service/pictures", &["service/cache", "service/memory", "service/jobs", "backend", "image", "warning"]),
    (
        "service/store",
        &[
            "service/jobs",
            "service/keys",
            "service/memory",
            "service/durable",
            "service/digest",
            "import",
            "mesh",
            "limits",
        ],
    ),
    ("service/webhooks", &["service/metrics"]),
    ("service/warm_up", &["pipeline", "request", "backend", "spec", "import", "limits"]),
    (
        "service/http",
        &[
            "service/warm_up",
            "service/keys",
            "service/memory",
            "service/priority",
            "service/webhooks",
            "service/rates",
            "service/signature",
            "service/metrics",
            "service/store",
            "service/durable",
            "service/digest",
            "service/jobs",
            "service/residents",
            "service/pictures",
            "pipeline",
            "check",
            "diff",
            "report",
            "request",
            "backend",
            "spec",
            "import",
            "mesh",
            "image",
            "limits",
            "percent",
            "warning",
            "config",
            "telemetry",
        ],
    ),
    ("service", &[]),
    ("sandbox", &["import", "limits"]),
    (
        "cli",
        &[
            "sandbox",
            "service",
            "service/http",
            "service/jobs",
            "service/durable",
            "service/signature",
            "service/digest",
            "check",
            "diff",
            "encode",
            "pipeline",
            "report",
            "request",
            "backend",
            "spec",
            "import",
            "mesh",
            "image",
            "limits",
            "warning",
            "config",
            "telemetry",
            "guard",
            "percent",
            "pluralise",
        ],
    ),
    ("config", &["request", "spec", "limits"]),
    ("telemetry", &["config"]),
    // The crate's public face is made of what the rooms have.
    (
        "library",
        &["pipeline", "request", "encode", "backend", "plan", "spec", "import", "mesh", "image", "limits", "warning"],
    ),
    ("lib", &["*"]),
    ("main", &["cli"]),
];

/// Lines of a source file; past that it holds more than one idea.
const LINES_MAX: usize = 600;

/// Files directly in a folder, `mod.rs` included; past that it needs sub-folders that say what
/// belongs together.
const DIRECT_FILES_MAX: usize = 14;

/// Crates and what of std may be named where: a word, and the path prefixes under `src/` that may
/// hold it.
const ONLY_UNDER: &[(&str, &[&str])] = &[
    ("wgpu::", &["backend/gpu/"]),
    ("axum::", &["service/http/"]),
    ("sha2::", &["service/digest", "service/signature", "service/webhooks"]),
    ("redb::", &["service/durable/"]),
    ("prometheus::", &["service/metrics"]),
    ("object_store::", &["service/durable/"]),
    ("quick_cache::", &["service/cache", "service/residents", "service/jobs/estimates"]),
    ("memmap2::", &["cli"]),
    ("rustix::", &["sandbox/", "service/priority"]),
    ("landlock::", &["sandbox/"]),
    ("seccompiler::", &["sandbox/"]),
    ("libc::", &["sandbox/"]),
    ("clap::", &["cli", "main.rs", "config"]),
    ("tokio::", &["service/", "main.rs", "cli", "telemetry"]),
    (
        "std::fs",
        &[
            "cli",
            "sandbox/",
            "config",
            "main.rs",
            "service/http/",
            "service/durable/",
            "service/keys/",
            "backend/gpu/pipelines/file.rs",
            // Counts the process's threads.
            "backend/gpu/displays.rs",
        ],
    ),
    // The sandbox hands a hook of tests on, in debug builds; drivers are told by a variable to leave displays alone.
    ("std::env", &["cli", "config", "main.rs", "telemetry", "sandbox/pool.rs", "backend/gpu/displays.rs"]),
    // Who draws may depend on what both back-ends took: decision 22.
    (
        "Instant::now",
        &[
            "cli",
            "sandbox/",
            "service/",
            "telemetry",
            "main.rs",
            "backend/cpu/stopwatch.rs",
            "backend/costs.rs",
            "backend/recovery.rs",
        ],
    ),
    ("SystemTime", &["cli", "service/", "telemetry", "main.rs"]),
];

#[test]
fn imports_go_one_way() {
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let mut faults = Vec::new();
    let mut seen = 0;
    // A module's own tests may reach for anything that makes them short.
    for (file, text) in
        sources().into_iter().filter(|(file, _)| !file.ends_with("tests.rs") && !file.contains("/tests/"))
    {
        let room = room_of(&file);
        let may = allowed.get(room).unwrap_or_else(|| panic!("src/{file}: say in ALLOWED what its room may import"));
        for (line, path) in paths(&text, &module(&file)) {
            seen += 1;
            let path = path.join("/");
            let used = room_of(&path);
            if used != room && !may.contains(&"*") && allowed.contains_key(used) && !may.contains(&used) {
                faults.push(format!("src/{file}:{line}: {room} may not import {used}"));
            }
        }
    }
    assert!(seen > 300, "only {seen} imports found: the scan is broken");
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

/// A child may use its parents' types, and a parent calls its children. Between other files,
/// imports make no circle.
#[test]
fn no_files_import_each_other_in_a_circle() {
    let files: Vec<(String, String)> = sources().into_iter().filter(|(file, _)| !file.ends_with("tests.rs")).collect();
    let index: BTreeMap<String, usize> = files.iter().enumerate().map(|(i, (file, _))| (module(file), i)).collect();
    let mut imports = vec![BTreeSet::new(); files.len()];
    let mut edges = 0;
    for (i, (file, text)) in files.iter().enumerate() {
        let own = module(file);
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for (_, path) in paths(text, &own) {
            let target = (1..=path.len()).rev().find_map(|k| index.get(&path[..k].join("::")));
            let Some(&target) = target.filter(|&&target| target != i) else { continue };
            let other = module(&files[target].0);
            let is_family = own.starts_with(&format!("{other}::")) || other.starts_with(&format!("{own}::"));
            if !is_family && imports[i].insert(target) {
                edges += 1;
            }
        }
    }
    let circles = circles(&imports);
    let named: Vec<String> = circles
        .iter()
        .map(|circle| circle.iter().map(|&i| files[i].0.as_str()).collect::<Vec<_>>().join(", "))
        .collect();
    println!("{} files, {edges} imports between them, {} circles", files.len(), circles.len());
    assert!(edges > 300, "only {edges} imports found: the scan is broken");
    assert!(circles.is_empty(), "{} circles:\n{}", circles.len(), named.join("\n"));
}

/// Sets of files, each of which reaches every other of its set.
fn circles(imports: &[BTreeSet<usize>]) -> Vec<Vec<usize>> {
    let reach: Vec<BTreeSet<usize>> = (0..imports.len())
        .map(|start| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
            while let Some(at) = open.pop() {
                open.extend(imports[at].iter().copied().filter(|&next| seen.insert(next)));
            }
            seen
        })
        .collect();
    let mut done = BTreeSet::new();
    (0..imports.len())
        .filter_map(|i| {
            let circle: Vec<usize> = reach[i].iter().copied().filter(|&j| reach[j].contains(&i)).collect();
            (circle.len() > 1 && done.insert(circle.clone())).then_some(circle)
        })
        .collect()
}

#[test]
fn circles_are_found() {
    let graph = |edges: &[&[usize]]| edges.iter().map(|to| to.iter().copied().collect()).collect::<Vec<BTreeSet<_>>>();
    assert!(circles(&graph(&[&[1, 2], &[2], &[]])).is_empty());
    assert_eq!(circles(&graph(&[&[1], &[2], &[0], &[0]])), [vec![0, 1, 2]]);
}

#[test]
fn rooms_are_not_crowded_and_files_are_not_long() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut faults = Vec::new();
    let mut folders = vec![root.join("src"), root.join("shaders"), root.join("tests/suite"), root.join("tests/oracle")];
    let mut seen = 0;
    while let Some(folder) = folders.pop() {
        let mut direct = 0;
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            direct += 1;
            seen += 1;
            let lines = std::fs::read_to_string(&path).unwrap_or_default().lines().count();
            if path.extension().is_some_and(|e| e == "rs" || e == "wgsl") && lines > LINES_MAX {
                faults.push(format!("{}: {lines} lines", path.display()));
            }
        }
        if direct > DIRECT_FILES_MAX {
            faults.push(format!("{}: {direct} files", folder.display()));
        }
    }
    assert!(seen > 300, "only {seen} files found: the scan is broken");
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
    let (mut twins, mut shaders) = (0, Vec::new());
    files_below(&root.join("shaders"), "wgsl", &mut shaders);
    for path in &shaders {
        let twin = path.strip_prefix(root.join("shaders")).unwrap().with_extension("rs");
        if root.join("src/backend/cpu").join(&twin).exists() {
            twins += 1;
        } else {
            let first = std::fs::read_to_string(path).unwrap().lines().next().unwrap_or_default().to_owned();
            assert!(first.starts_with("//"), "{}: no twin, and no first line that says what it is", path.display());
        }
    }
    assert!(twins >= 15, "only {twins} of {} shaders have twins", shaders.len());
}

/// Every Rust file under src, by its path from there.
pub fn sources() -> Vec<(String, String)> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    files_below(&root, "rs", &mut files);
    assert!(files.len() > 200, "only {} files under src", files.len());
    let name = |path: &Path| path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
    files.iter().map(|path| (name(path), std::fs::read_to_string(path).unwrap())).collect()
}

fn files_below(folder: &Path, extension: &str, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files_below(&path, extension, files);
        } else if path.extension().is_some_and(|e| e == extension) {
            files.push(path);
        }
    }
    files.sort();
}

/// Lines that are not comments, numbered from 1.
pub fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(|(_, line)| !line.trim_start().starts_with("//"))
}

/// The longest room in [`ALLOWED`] that a file or a path is in; the first word of the path where
/// there is none.
fn room_of(path: &str) -> &str {
    let path = path.strip_suffix(".rs").unwrap_or(path);
    let is_in = |room: &str| path == room || path.strip_prefix(room).is_some_and(|rest| rest.starts_with('/'));
    let room = ALLOWED.iter().map(|(room, _)| *room).filter(|room| is_in(room)).max_by_key(|room| room.len());
    room.unwrap_or_else(|| path.split('/').next().unwrap_or_default())
}

/// `plan/lines/mod.rs` -> `plan::lines`
fn module(file: &str) -> String {
    let path = file.strip_suffix(".rs").unwrap_or(file);
    path.strip_suffix("/mod").unwrap_or(path).replace('/', "::")
}

/// Paths in a file's code, from the crate's root, as far as they begin with `crate`, `meshsnap`,
/// `self` or `super`. Of a list in braces each item is a path.
fn paths(text: &str, own: &str) -> Vec<(usize, Vec<String>)> {
    let mut out = Vec::new();
    let lines: Vec<(usize, &str)> = code(text).collect();
    for (at, &(number, line)) in lines.iter().enumerate() {
        for start in ["crate::", "meshsnap::", "super::", "self::"] {
            for (i, _) in line.match_indices(start) {
                let before = line[..i].chars().next_back();
                if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                    continue;
                }
                // A list may go on in the lines that follow.
                let mut rest = line[i..].to_owned();
                for &(_, more) in lines.iter().skip(at + 1).take(12) {
                    if rest.matches('{').count() <= rest.matches('}').count() || !line.trim_start().contains("use ") {
                        break;
                    }
                    rest.push_str(more.trim());
                }
                expand(&rest, own, number, &mut out);
            }
        }
    }
    out
}

/// Adds each path of `text`, which begins with one: `crate::a::{b, c::d} ...`.
fn expand(text: &str, own: &str, number: usize, out: &mut Vec<(usize, Vec<String>)>) {
    let mut base: Vec<String> = Vec::new();
    let mut rest = text;
    let mut is_first = true;
    loop {
        let word: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        rest = &rest[word.len()..];
        match word.as_str() {
            "crate" | "meshsnap" if is_first => {}
            "self" if is_first => base = own.split("::").map(str::to_owned).collect(),
            "super" => {
                if is_first {
                    base = own.split("::").map(str::to_owned).collect();
                }
                base.pop();
            }
            "" => break,
            _ => base.push(word),
        }
        is_first = false;
        match rest.strip_prefix("::") {
            Some(more) => rest = more,
            None => break,
        }
    }
    if let Some(list) = rest.strip_prefix('{') {
        let list = list.rsplit_once('}').map_or(list, |(list, _)| list);
        for item in list.split(',') {
            let item: Vec<String> = item
                .trim()
                .split("::")
                .map(|word| word.split_whitespace().next().unwrap_or_default().trim_matches(['{', '}']).to_owned())
                .take_while(|word| !word.is_empty() && word != "self")
                .collect();
            out.push((number, [base.clone(), item].concat()));
        }
    } else {
        out.push((number, base));
    }
}
