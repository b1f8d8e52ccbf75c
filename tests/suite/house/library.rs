//! The library's interface changes on purpose only: `src/library/interface.txt` lists it.

use std::path::{Path, PathBuf};

use super::structure::sources;

fn stored() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/library/interface.txt")
}

/// Each public function, type and field of the crate `meshsnap`, one on a line, under the file that has it: signatures up to
/// their body, and the names that are passed on from the renderer (not what those have).
fn interface() -> String {
    let mut out = String::new();
    for (file, text) in sources().into_iter().filter(|(file, _)| file.starts_with("library/")) {
        let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        out.push_str(&format!("{file}\n"));
        let mut lines = text.lines().map(str::trim).filter(|line| !line.starts_with("//"));
        while let Some(line) = lines.next() {
            let is_style = line.strip_suffix(',').and_then(|line| line.split_once(" = \""));
            if let Some((function, _)) = is_style.filter(|(name, _)| name.chars().all(|c| c.is_lowercase() || c == '_'))
            {
                out.push_str(&format!("    pub fn {function}() -> Self\n"));
            } else if line.starts_with("pub ") && !line.contains('$') {
                let mut item = line.to_owned();
                // A signature or a list of names may go on in the lines that follow.
                let is_list = item.starts_with("pub use ");
                let is_open =
                    |item: &str| if is_list { !item.ends_with(';') } else { !item.ends_with([';', '{', ',']) };
                while is_open(&item) || item.matches('(').count() > item.matches(')').count() {
                    let Some(more) = lines.next() else { break };
                    item.push(' ');
                    item.push_str(more);
                }
                out.push_str(&format!("    {}\n", item.trim_end_matches([' ', '{', ';', ','])));
            }
        }
    }
    out
}

#[test]
fn the_interface_is_the_stored_one() {
    let (now, path) = (interface(), stored());
    assert!(now.lines().count() > 60, "the scan is broken:\n{now}");
    if std::env::var("MESHSNAP_GOLDEN").is_ok_and(|value| value == "write") {
        std::fs::write(&path, &now).unwrap();
        panic!("{} is written anew: look at it, then test again", path.display());
    }
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    let differing = now.lines().zip(stored.lines()).find(|(now, stored)| now != stored);
    assert!(now == stored, "{} differs, first in {differing:?}; MESHSNAP_GOLDEN=write stores it anew", path.display());
}

#[test]
fn nothing_public_is_hidden() {
    let hidden = |text: &str| text.contains("doc(hidden)");
    let found: Vec<_> = sources().into_iter().filter(|(_, text)| hidden(text)).map(|(file, _)| file).collect();
    assert!(found.is_empty(), "{found:?}");
}
