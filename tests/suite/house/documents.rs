//! Claims of the documents that a test can check: the files that they name exist, ARCHITECTURE.md lists every error
//! code whose status is 429, and no document is left half merged.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::structure::{files_below, sources};

/// Folders of the repository that documents name files in.
const TOP_FOLDERS: [&str; 12] =
    ["src", "web", "shaders", "tests", "docs", "api", "deploy", "fuzz", "xtask", "examples", ".ci", ".github"];

/// Words that stand for a name in a path, such as `src/render/import/NAME/`. The folder before them has to exist.
const PLACEHOLDERS: [&str; 5] = ["NAME", "PATH", "STAGE", "X", "TARGET-WHAT-IT-WAS"];

/// Fewer paths than this mean that the scan is broken: there were 550 when this was written.
const PATHS_MIN: usize = 400;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every document, by its path from the root. Left out are CHANGELOG.md, which tells of files that are gone, and
/// `tests/data`, whose documents came with the meshes.
fn documents() -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(root()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "md") && !path.ends_with("CHANGELOG.md") {
            files.push(path);
        }
    }
    for folder in ["api", "deploy", "docs", "examples", "shaders", "src", "tests", "xtask"] {
        files_below(&root().join(folder), "md", &mut files);
    }
    files.retain(|path| !path.starts_with(root().join("tests/data")));
    files.iter().map(|path| path.strip_prefix(root()).unwrap().to_owned()).collect()
}

/// The back-quoted words of a text that begin with a top-level folder.
fn quoted_paths(text: &str) -> Vec<&str> {
    let is_path = |word: &&str| word.split_once('/').is_some_and(|(top, _)| TOP_FOLDERS.contains(&top));
    let quoted = text.lines().flat_map(|line| line.split('`').skip(1).step_by(2));
    let words = quoted.flat_map(str::split_whitespace);
    words.map(|word| word.trim_matches([',', ';', ':', '(', ')'])).filter(is_path).collect()
}

/// The targets of a text's Markdown links that are files, without the heading that they lead to.
fn linked_files(text: &str) -> Vec<&str> {
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
    let files = targets.filter(|target| !target.contains("://") && !target.starts_with('#') && !target.contains(' '));
    files.map(|target| target.split('#').next().unwrap_or_default()).collect()
}

/// True if the path names something that exists: a file or folder, the folder before a placeholder, or at least one
/// file that a `*` in the last part fits.
fn exists(path: &str) -> bool {
    let mut folder = root();
    for part in path.split('/').filter(|part| !part.is_empty()) {
        let stem = part.split_once('.').map_or(part, |(stem, _)| stem);
        if PLACEHOLDERS.contains(&stem) {
            return folder.is_dir();
        }
        if let Some((before, after)) = part.split_once('*') {
            let fits = |name: &str| name.starts_with(before) && name.ends_with(after);
            let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
            return entries.into_iter().any(|entry| fits(&entry.file_name().to_string_lossy()));
        }
        folder.push(part);
    }
    folder.exists()
}

#[test]
fn paths_in_documents_exist() {
    let documents = documents();
    let (mut checked, mut missing) = (0, Vec::new());
    for document in &documents {
        let text = std::fs::read_to_string(root().join(document)).unwrap();
        let folder = document.parent().unwrap_or(Path::new(""));
        let links = linked_files(&text);
        checked += links.len();
        for link in links.into_iter().filter(|link| !root().join(folder).join(link).exists()) {
            missing.push(format!("{}: the link to {link}", document.display()));
        }
        let quoted = quoted_paths(&text);
        checked += quoted.len();
        for path in quoted.into_iter().filter(|path| !exists(path)) {
            missing.push(format!("{}: `{path}`", document.display()));
        }
    }
    println!("{checked} paths in {} documents", documents.len());
    assert!(documents.len() > 40, "only {} documents found: the scan is broken", documents.len());
    assert!(checked >= PATHS_MIN, "only {checked} paths found: the scan is broken");
    assert!(missing.is_empty(), "these do not exist:\n{}", missing.join("\n"));
}

#[test]
fn no_document_holds_both_sides_of_a_merge() {
    let mut documents = documents();
    documents.push("CHANGELOG.md".into());
    let marks = ["<<<<<<< ", "||||||| ", ">>>>>>> "];
    for document in documents {
        let text = std::fs::read_to_string(root().join(&document)).unwrap();
        let mark = text.lines().position(|line| marks.iter().any(|mark| line.starts_with(mark)));
        assert!(mark.is_none(), "{}:{}: a merge was not finished", document.display(), mark.unwrap_or(0) + 1);
    }
}

#[test]
fn paths_are_found_and_looked_up() {
    let text = "See `src/lib.rs`, `cargo bench` and (`MESHSNAP_ORACLE=long tests/run quick`); [here](docs/a.md#part), \
                [there](https://example.org/docs/b.md), [above](#part).";
    assert_eq!(quoted_paths(text), ["src/lib.rs", "tests/run"]);
    assert_eq!(linked_files(text), ["docs/a.md"]);
    for path in ["src/render/lib.rs", "tests/run", "src/render/import/NAME/", "shaders/PATH.wgsl", "docs/growth.*"] {
        assert!(exists(path), "{path}");
    }
    for path in ["src/render/no.rs", "src/render/no/NAME/", "docs/no.*", "src/OTHER/"] {
        assert!(!exists(path), "{path}");
    }
}

/// The error codes of `ErrorKind::Busy` in the code of a file. A code stands behind the kind, or is one of those that a
/// `let (code, ...) = match` before it chooses from.
fn busy_codes(text: &str) -> Vec<String> {
    let literal =
        |text: &str| text.strip_prefix('"').and_then(|rest| rest.split_once('"')).map(|(code, _)| code.to_owned());
    let mut codes = Vec::new();
    for (at, word) in text.match_indices("ErrorKind::Busy") {
        let after = text[at + word.len()..].trim_start_matches(',').trim_start();
        if let Some(code) = literal(after) {
            codes.push(code);
            continue;
        }
        assert!(after.starts_with("code,"), "which code is this? {}", after.lines().next().unwrap_or_default());
        let choice = text[..at].rfind("let (code").map(|start| &text[start..at]).unwrap();
        codes.extend(choice.split("=> (").skip(1).map(|arm| literal(arm).unwrap()));
    }
    codes
}

#[test]
fn architecture_lists_every_cause_of_a_429() {
    let mut codes = BTreeSet::new();
    let mut maps = Vec::new();
    for (file, text) in sources().into_iter().filter(|(file, _)| file.starts_with("server/")) {
        codes.extend(busy_codes(&text));
        maps.extend(text.match_indices("TOO_MANY_REQUESTS").map(|_| file.clone()));
    }
    assert_eq!(maps, ["server/http/error.rs"], "statuses come from one place");
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let row = text.lines().find(|line| line.starts_with("| Where does a 429 come from?")).unwrap();
    let is_code = |word: &&str| word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let listed: BTreeSet<String> = row.split('`').skip(1).step_by(2).filter(is_code).map(str::to_owned).collect();
    assert!(codes.len() >= 9, "only {codes:?} found: the scan is broken");
    assert_eq!(codes, listed);
}
