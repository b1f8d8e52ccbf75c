//! The library's interface changes on purpose only: `src/library/interface.txt` lists it.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::process::Command;

use public_api::{Builder, PublicItem};
use serde_json::Value;

use super::structure::sources;

fn stored() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/library/interface.txt")
}

/// Has rustdoc describe the library and the renderer in JSON, with the one feature that the interface depends on, and gives
/// the folder. Of other crates only the metadata is made.
fn documented() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("interface");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["doc", "--locked", "--quiet", "--lib", "--no-deps", "--package=meshsnap", "--package=meshsnap-render"]);
    cargo.args(["--no-default-features", "--features=meshsnap/gpu", "--target-dir"]).arg(&target);
    cargo.current_dir(env!("CARGO_MANIFEST_DIR"));
    // A stable rustdoc writes JSON only so. Build scripts look at this variable, too: hence the folder of its own.
    cargo.env("RUSTC_BOOTSTRAP", "1").env("RUSTDOCFLAGS", "-Z unstable-options --output-format json");
    let done = cargo.output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    target.join("doc")
}

/// Every public item of the crate `meshsnap`, one on a line, and below them those of the types that it passes on from
/// `meshsnap_render`, as `cargo public-api` writes them.
fn interface(folder: &Path) -> String {
    let [own, renderer] = ["meshsnap.json", "meshsnap_render.json"].map(|name| Documented::read(&folder.join(name)));
    let mut out = own.lines(|_| true);
    let uses = own.json["index"].as_object().unwrap().values().filter_map(|item| item["inner"].get("use"));
    let passed_on: BTreeMap<&str, &Value> = uses.map(|item| (item["name"].as_str().unwrap(), item)).collect();
    for (name, item) in passed_on {
        // Types of other crates are those crates' to keep.
        let Some(path) = own.path(&item["id"]).filter(|path| path[0] == "meshsnap_render") else { continue };
        let id = renderer.id(path).unwrap_or_else(|| panic!("nothing is known of {path:?}"));
        out.push_str(&format!("\n# {name}\n{}", renderer.lines(|item| renderer.is_within(item, id))));
    }
    out
}

/// A crate's JSON of rustdoc, and its public items by their numbers in it.
struct Documented {
    json: Value,
    items: Vec<PublicItem>,
    by_id: HashMap<u32, usize>,
}

impl Documented {
    fn read(path: &Path) -> Self {
        let json = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let api = Builder::from_rustdoc_json(path).omit_blanket_impls(true).omit_auto_trait_impls(true).build();
        let api = api.unwrap_or_else(|error| panic!("{error}: the crate public-api reads the JSON of another rustdoc"));
        let items: Vec<PublicItem> = api.into_items().collect();
        let by_id = items.iter().enumerate().map(|(i, item)| (item.id().0, i)).collect();
        Self { json, items, by_id }
    }

    /// The path at which an item is defined.
    fn path(&self, id: &Value) -> Option<&[Value]> {
        self.json["paths"][id.to_string()]["path"].as_array().map(Vec::as_slice)
    }

    /// The number of the item that is defined at a path.
    fn id(&self, path: &[Value]) -> Option<u32> {
        let paths = self.json["paths"].as_object()?;
        paths.iter().find(|(_, item)| item["path"].as_array().is_some_and(|of| of == path))?.0.parse().ok()
    }

    fn parent(&self, item: &PublicItem) -> Option<&PublicItem> {
        self.by_id.get(&item.parent_id()?.0).map(|&i| &self.items[i])
    }

    /// True if an item is the one with this number, or a part of it.
    fn is_within(&self, item: &PublicItem, id: u32) -> bool {
        item.id().0 == id || self.parent(item).is_some_and(|parent| self.is_within(parent, id))
    }

    /// Each of these items once, however many paths it has. Of the implementation of a trait the head and the types: the trait
    /// says which functions there are.
    fn lines(&self, is_wanted: impl Fn(&PublicItem) -> bool) -> String {
        let mut seen = BTreeSet::new();
        let mut out = String::new();
        for item in self.items.iter().filter(|item| is_wanted(item)) {
            let text = item.to_string();
            let in_trait = self.parent(item).map(ToString::to_string);
            let in_trait = in_trait.is_some_and(|parent| parent.starts_with("impl") && parent.contains(" for "));
            // The compiler's own mark of a derived `PartialEq`.
            let is_mark = text.contains("StructuralPartialEq");
            if (!in_trait || text.starts_with("pub type")) && !is_mark && seen.insert(item.id().0) {
                out.push_str(&text);
                out.push('\n');
            }
        }
        out
    }
}

#[test]
fn the_interface_is_the_stored_one() {
    let (now, path) = (interface(&documented()), stored());
    assert!(now.lines().count() > 500, "items are missing:\n{now}");
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
