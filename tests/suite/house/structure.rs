//! Enforces rules of the source tree that ARCHITECTURE.md describes: imports between rooms, no
//! circles between files, where libraries may be used, the size of files and folders, and twins of
//! shaders.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms of the crates under `src/`, and what each may name of the others in its crate. Which crate may use which is for Cargo
/// to say. A file belongs to the room with the longest name that begins its path.
const ALLOWED: &[(&str, &[&str])] = &[
    ("render/limits", &[]),
    // The transfer function that importers, colours of a request, textures and the stored byte share.
    ("render/srgb", &[]),
    ("render/image", &["render/srgb"]),
    ("render/warning", &[]),
    ("render/guard", &[]),
    ("render/pluralise", &[]),
    ("render/parallel", &[]),
    ("render/mesh", &["render/parallel", "render/limits", "render/warning"]),
    (
        "render/import",
        &[
            "render/guard",
            "render/mesh",
            "render/parallel",
            "render/srgb",
            "render/limits",
            "render/warning",
            "render/pluralise",
        ],
    ),
    ("render/spec", &["render/mesh", "render/image", "render/srgb", "render/limits"]),
    ("render/request", &["render/spec", "render/mesh", "render/image", "render/limits"]),
    ("render/texture", &["render/guard", "render/mesh", "render/srgb", "render/limits", "render/warning"]),
    ("render/scene", &["render/spec", "render/mesh", "render/parallel", "render/limits"]),
    (
        "render/plan",
        &[
            "render/scene",
            "render/spec",
            "render/texture",
            "render/mesh",
            "render/parallel",
            "render/image",
            "render/limits",
            "render/warning",
            "render/pluralise",
        ],
    ),
    ("render/backend", &["render/plan", "render/spec", "render/image", "render/srgb", "render/limits"]),
    ("render/encode", &["render/image", "render/limits"]),
    ("render/caption", &["render/image"]),
    ("render/sheet", &["render/caption", "render/spec", "render/image", "render/limits"]),
    (
        "render/pipeline",
        &[
            "render/import",
            "render/encode",
            "render/caption",
            "render/sheet",
            "render/backend",
            "render/plan",
            "render/scene",
            "render/spec",
            "render/mesh",
            "render/image",
            "render/limits",
            "render/warning",
        ],
    ),
    (
        "server/jobs",
        &[
            "server/metrics",
            "server/durable",
            "server/digest",
            "server/memory",
            "server/priority",
            "server/residents",
            "server/telemetry",
        ],
    ),
    ("server/memory", &[]),
    ("server/priority", &[]),
    ("server/cache", &["server/memory"]),
    ("server/metrics", &[]),
    ("server/signature", &[]),
    ("server/keys", &["server/digest", "server/jobs"]),
    ("server/rates", &["server/jobs"]),
    ("server/digest", &[]),
    ("server/durable", &["server/digest"]),
    ("server/residents", &["server/cache", "server/memory"]),
    ("server/pictures", &["server/cache", "server/memory", "server/jobs"]),
    ("server/store", &["server/jobs", "server/keys", "server/memory", "server/durable", "server/digest"]),
    ("server/shared_store", &["server/store", "server/jobs", "server/keys", "server/durable", "server/digest"]),
    ("server/shared_queue", &["server/durable"]),
    ("server/webhooks", &["server/metrics"]),
    ("server/warm_up", &[]),
    (
        "server/http",
        &[
            "server/warm_up",
            "server/keys",
            "server/memory",
            "server/priority",
            "server/webhooks",
            "server/rates",
            "server/signature",
            "server/metrics",
            "server/store",
            "server/shared_store",
            "server/shared_queue",
            "server/durable",
            "server/digest",
            "server/jobs",
            "server/residents",
            "server/pictures",
            "server/config",
            "server/telemetry",
        ],
    ),
    ("server/config", &[]),
    ("server/telemetry", &["server/config"]),
    // One room: what is public is the whole of it.
    ("library", &[]),
    ("inspect/geometry", &[]),
    ("inspect/made_obj", &[]),
    ("inspect/report", &["inspect/geometry", "inspect/images"]),
    ("inspect/check", &["inspect/geometry", "inspect/images", "inspect/report"]),
    ("inspect/diff", &["inspect/geometry", "inspect/report"]),
    ("inspect/images", &[]),
    ("inspect/drawing", &["inspect/check", "inspect/diff"]),
    // What commands share, then a room for each command or kind of commands.
    ("program/error", &[]),
    ("program/progress", &[]),
    ("program/format_arg", &[]),
    ("program/settings", &[]),
    ("program/sandbox", &[]),
    ("program/isolation", &["program/sandbox"]),
    ("program/files", &["program/error"]),
    ("program/bundle", &["program/error", "program/files"]),
    ("program/siblings", &["program/error", "program/bundle"]),
    ("program/output", &["program/error", "program/files", "program/bundle"]),
    (
        "program/render",
        &[
            "program/error",
            "program/progress",
            "program/settings",
            "program/isolation",
            "program/files",
            "program/bundle",
            "program/siblings",
            "program/output",
        ],
    ),
    ("program/inspect", COMMAND_ON_MESHES),
    ("program/check", COMMAND_ON_MESHES),
    ("program/diff", COMMAND_ON_MESHES),
    ("program/serve", &["program/error", "program/settings", "program/isolation", "program/files"]),
    ("program/health", &["program/error"]),
    ("program/jobs", &["program/error", "program/files"]),
    ("program/manual", &["program/error", "program/files"]),
    ("program/sign", &["program/error", "program/files"]),
];

/// The rooms that commands on meshes share. `render` has what the others draw with.
const COMMAND_ON_MESHES: &[&str] = &[
    "program/error",
    "program/progress",
    "program/format_arg",
    "program/settings",
    "program/isolation",
    "program/files",
    "program/bundle",
    "program/siblings",
    "program/output",
    "program/render",
];

/// Files that stand for a whole crate, and may name all of it.
const ROOTS: [&str; 3] = ["lib", "main", "build"];

/// Lines of a source file; past that it holds more than one idea.
const LINES_MAX: usize = 600;

/// Files directly in a folder, `mod.rs` included; past that it needs sub-folders that say what
/// belongs together.
const DIRECT_FILES_MAX: usize = 14;

/// Libraries and what of std may be named where: a word, and the path prefixes under `src/` that may hold it.
const ONLY_UNDER: &[(&str, &[&str])] = &[
    ("wgpu::", &["render/backend/gpu/"]),
    ("axum::", &["server/http/"]),
    ("sha2::", &["server/digest", "server/signature", "server/webhooks"]),
    ("redb::", &["server/durable/"]),
    ("prometheus::", &["server/metrics"]),
    ("object_store::", &["server/durable/", "server/shared_store/"]),
    ("async_nats::", &["server/shared_queue/"]),
    ("quick_cache::", &["server/cache", "server/residents", "server/jobs/estimates"]),
    ("rustix::", &["program/sandbox/", "server/priority"]),
    ("landlock::", &["program/sandbox/"]),
    ("seccompiler::", &["program/sandbox/"]),
    ("libc::", &["program/sandbox/"]),
    (
        "std::fs",
        &[
            "program/",
            "server/config",
            "server/http/",
            "server/durable/",
            "server/shared_store/",
            "server/keys/",
            "render/backend/gpu/pipelines/file.rs",
            // Counts the process's threads.
            "render/backend/gpu/displays.rs",
        ],
    ),
    // Drivers are told by a variable to leave displays alone.
    (
        "std::env",
        &["program/", "server/build.rs", "server/config", "server/telemetry", "render/backend/gpu/displays.rs"],
    ),
    // Who draws may depend on what both back-ends took: decision 22.
    (
        "Instant::now",
        &[
            "program/",
            "server/",
            "render/backend/cpu/stopwatch.rs",
            "render/backend/costs.rs",
            "render/backend/recovery.rs",
        ],
    ),
    ("SystemTime", &["program/", "server/"]),
];

/// The crates under `src/` by the names that code calls them: a path of a crate begins in its folder.
const CRATES: [(&str, &str); 3] =
    [("meshsnap_render", "render"), ("meshsnap_inspect", "inspect"), ("meshsnap_server", "server")];

#[test]
fn imports_go_one_way() {
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let (mut faults, mut homeless) = (Vec::new(), BTreeSet::new());
    let mut seen = 0;
    // A module's own tests may reach for anything that makes them short.
    for (file, text) in
        sources().into_iter().filter(|(file, _)| !file.ends_with("tests.rs") && !file.contains("/tests/"))
    {
        let room = room_of(&file);
        for (line, path) in paths(&text, &module(&file)) {
            seen += 1;
            let path = path.join("/");
            let used = room_of(&path);
            let Some(may) = allowed.get(room) else {
                if !ROOTS.iter().any(|root| room.ends_with(root)) {
                    homeless.insert(format!("src/{file}"));
                }
                continue;
            };
            let same_crate = room.split('/').next() == used.split('/').next();
            if same_crate && used != room && allowed.contains_key(used) && !may.contains(&used) {
                faults.push(format!("src/{file}:{line}: {room} may not import {used}"));
            }
        }
    }
    assert!(seen > 300, "only {seen} imports found: the scan is broken");
    assert!(homeless.is_empty(), "say in ALLOWED what the rooms of these may import: {homeless:#?}");
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
            if path.is_symlink() {
                continue;
            }
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
        for (own, other) in [("render/backend/cpu/", "gpu::"), ("render/backend/gpu/", "cpu::")] {
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
        if root.join("src/render/backend/cpu").join(&twin).exists() {
            twins += 1;
        } else {
            let text = std::fs::read_to_string(path).unwrap();
            let head = text.lines().take_while(|line| line.starts_with("//")).collect::<String>().to_lowercase();
            assert!(!head.is_empty(), "{}: no comment that says what it is", path.display());
            let is_kernel = text.contains("@compute");
            assert!(!is_kernel || head.contains("twin"), "{}: nothing is said of a twin", path.display());
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

/// Adds the files below a folder whose names end with this extension. Links are left out.
pub fn files_below(folder: &Path, extension: &str, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_symlink() {
            continue;
        }
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

/// The longest room in [`ALLOWED`] that a file or a path is in; the first two words of the path where
/// there is none.
fn room_of(path: &str) -> &str {
    let path = path.strip_suffix(".rs").unwrap_or(path);
    let is_in = |room: &str| path == room || path.strip_prefix(room).is_some_and(|rest| rest.starts_with('/'));
    let room = ALLOWED.iter().map(|(room, _)| *room).filter(|room| is_in(room)).max_by_key(|room| room.len());
    let two = path.match_indices('/').nth(1).map_or(path, |(at, _)| &path[..at]);
    room.unwrap_or(two)
}

/// `plan/lines/mod.rs` -> `plan::lines`
fn module(file: &str) -> String {
    let path = file.strip_suffix(".rs").unwrap_or(file);
    path.strip_suffix("/mod").unwrap_or(path).replace('/', "::")
}

/// Paths in a file's code, from `src/`, as far as they begin with `crate`, one of [`CRATES`],
/// `self` or `super`. Of a list in braces each item is a path.
fn paths(text: &str, own: &str) -> Vec<(usize, Vec<String>)> {
    let mut out = Vec::new();
    let lines: Vec<(usize, &str)> = code(text).collect();
    for (at, &(number, line)) in lines.iter().enumerate() {
        for start in ["crate::", "meshsnap_render::", "meshsnap_inspect::", "meshsnap_server::", "super::", "self::"] {
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
            "crate" if is_first => base = own.split("::").take(1).map(str::to_owned).collect(),
            name if is_first && CRATES.iter().any(|(krate, _)| *krate == name) => {
                base =
                    CRATES.iter().filter(|(krate, _)| *krate == name).map(|(_, folder)| (*folder).to_owned()).collect();
            }
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
