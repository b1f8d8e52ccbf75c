//! The translation of a request into dotted keys alone (such as `wire.color`), for use in the query of an
//! address. A JSON document and the dotted keys that override it become one list of keys that means the
//! same picture.

use serde_json::Value as Json;

use super::item::Item;
use super::json::{flatten, flatten_override};
use crate::request::document::{duplicate_keys, mesh_reference};
use crate::request::table::value::Given;
use crate::request::{Overrides, Rules, check_once, read, set_format};
use crate::spec::Spec;

/// Most keys: an address has no room for more.
const KEYS_MAX: usize = 200;

/// The dotted keys that mean `spec`, which a document (with or without its mesh) and its overrides
/// mean too; without the picture's format. None where no query can express it.
pub fn all_dotted(document: &[u8], overrides: &Overrides, spec: &Spec, rules: &Rules) -> Option<Vec<(String, String)>> {
    let mut items = flatten(document, rules.limits.json_depth).ok()?;
    for (key, text) in overrides {
        items.extend(flatten_override(key, text, rules.limits.json_depth).ok()?);
    }
    let is_format = |key: &str| key == "format" || key == "image.format";
    items.retain(|item| item.material.is_some() || item.key != mesh_reference::KEY && !is_format(&item.key));
    if items.len() > KEYS_MAX {
        return None;
    }
    // Of duplicates the last counts; a query must not have any.
    let has_later = |at: usize| items[at + 1..].iter().any(|later| same_key(&items[at], later));
    let kept: Vec<&Item> = (0..items.len()).filter(|&at| !has_later(at)).map(|at| &items[at]).collect();
    let pairs: Vec<(String, String)> = kept.into_iter().map(|item| (item.whole_key(), text(&item.given))).collect();

    // Read the result back: dots in a material's name may change the meaning of its key, and so may
    // a key left out.
    check_once(&pairs, rules).ok()?;
    let mut again = read(None, &pairs, rules).ok()?;
    set_format(&mut again, spec.image.format?);
    (again == *spec).then_some(pairs)
}

fn same_key(a: &Item, b: &Item) -> bool {
    a.material == b.material && duplicate_keys::long(a) == duplicate_keys::long(b)
}

/// The value as a query writes it.
fn text(given: &Given) -> String {
    match given {
        Given::Json(Json::String(text)) | Given::Text(text) => text.clone(),
        Given::Json(other) => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::tests::rules;
    use crate::request::{ImageFormat, read_with_mesh};

    fn dotted(document: &str, overrides: &[(&str, &str)]) -> Option<String> {
        let overrides: Vec<_> = overrides.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect();
        let (_, mut spec) = read_with_mesh(document.as_bytes(), &overrides, &rules()).unwrap();
        set_format(&mut spec, ImageFormat::Jpeg);
        let pairs = all_dotted(document.as_bytes(), &overrides, &spec, &rules())?;
        Some(pairs.iter().map(|(key, text)| format!("{key}={text}")).collect::<Vec<_>>().join("&"))
    }

    #[test]
    fn a_document_becomes_dotted_keys() {
        let cases = [
            (r#"{"mesh":"x"}"#, &[][..], Some("")),
            (
                r##"{"mesh":"x","style":"wire","wire":{"color":"#f00","lit":true},"size":64}"##,
                &[],
                Some("size=64&style=wire&wire.color=#f00&wire.lit=true"),
            ),
            (
                r#"{"mesh":"x","camera":{"eye":[1,2.5,3],"target":[0,0,0]},"format":"webp"}"#,
                &[],
                Some("camera.eye=[1,2.5,3]&camera.target=[0,0,0]"),
            ),
            (
                r#"{"mesh":"x","outline":{},"surface":null,"background":"transparent"}"#,
                &[],
                Some("background=transparent&outline={}&surface=null"),
            ),
            (
                r#"{"mesh":"x","materials":{"Glass v2.1":{"surface":{"opacity":0.5}},"B":{}}}"#,
                &[],
                Some("materials.B={}&materials.Glass v2.1.surface.opacity=0.5"),
            ),
            // The query overrides the document.
            (
                r#"{"mesh":"x","style":"wire","samples":1}"#,
                &[("image.samples", "4"), ("style", "flat")],
                Some("image.samples=4&style=flat"),
            ),
            (r#"{"mesh":"x","wire":{"color":"f00"}}"#, &[("wire", "null")], Some("wire.color=f00&wire=null")),
            // No query can express these.
            (r#"{"mesh":"x","size":64}"#, &[("image.width", "32")], None),
            (r#"{"mesh":"x","materials":{"A.b":{}}}"#, &[], None),
        ];
        for (document, overrides, expected) in cases {
            assert_eq!(dotted(document, overrides).as_deref(), expected, "{document}");
        }
        assert_eq!(cases.len(), 9);
        let many: String = (0..201).map(|i| format!(r#","m{i}":{{}}"#)).collect();
        assert_eq!(dotted(&format!(r#"{{"mesh":"x","materials":{{"a":{{}}{many}}}}}"#), &[]), None);
    }
}
