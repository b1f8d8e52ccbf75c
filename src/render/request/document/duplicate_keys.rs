//! The check that refuses a document or a query with duplicate keys: two under the same name, or one
//! under its short name and one under its long one (`samples` and `image.samples`). The sender meant
//! both values, and one would be lost. In a document, `null` under the other name does not count. On a
//! command line, later flags override earlier ones instead.

use std::collections::BTreeMap;

use super::item::Item;
use crate::request::error::{RequestError, RequestFault};
use crate::request::table;
use crate::request::table::value::Given;

/// The keys that `size` sets.
const OF_SIZE: &[&str] = &["image.width", "image.height"];

/// Refuses items two of which set the same key. In a document, `null` sets nothing.
pub fn check(items: &[Item]) -> Result<(), RequestError> {
    let mut seen: BTreeMap<(Option<&str>, &str), &Item> = BTreeMap::new();
    let sets_nothing = |item: &&Item| matches!(&item.given, Given::Json(json) if json.is_null());
    for item in items.iter().filter(|item| !sets_nothing(item)) {
        let material = item.material.as_deref();
        for key in meanings(item) {
            let Some(first) = seen.insert((material, key), item) else { continue };
            return Err(duplicate(first, item));
        }
    }
    Ok(())
}

/// The long names of the keys that an item sets.
fn meanings(item: &Item) -> Vec<&str> {
    let key = item.key.as_str();
    if item.material.is_none() && key == "size" {
        return OF_SIZE.to_vec();
    }
    vec![long(item)]
}

/// The long name of an item's key.
pub fn long(item: &Item) -> &str {
    table::field(&item.key, item.material.is_some()).map_or(&item.key, |field| field.key)
}

fn duplicate(first: &Item, again: &Item) -> RequestError {
    let (first_key, key) = (first.whole_key(), again.whole_key());
    if first_key == key {
        return RequestError::new(RequestFault::Conflict, &key, "given twice", "each key is given once");
    }
    let why = format!("`{first_key}` ({}) says the same: give one of the two", first.given.show());
    RequestError::new(RequestFault::Conflict, &key, again.given.show(), why)
}

#[cfg(test)]
mod tests {
    use crate::request::{RequestFault, check_once, tests};

    #[test]
    fn duplicates_are_refused_under_both_names() {
        let cases: &[(&[&str], &str, &str)] = &[
            (&["style=wire", "style=flat"], "style", "given twice"),
            (&["style=wire", "style=wire"], "style", "given twice"),
            (&["max_error=1", "image.max_error=2"], "image.max_error", "`max_error` (\"1\") says the same"),
            (&["image.width=8", "size=9"], "size", "`image.width` (\"8\") says the same"),
            (&["size=9", "wire={}", "image.height=8"], "image.height", "`size` (\"9\") says the same"),
            (&["camera.up=z", "up=y"], "up", "`camera.up`"),
            (&["outline.thickness=3", "outline={\"thickness\":8}"], "outline.thickness", "given twice"),
            (&["image={\"width\":8}", "size=9"], "size", "`image.width` (8) says the same"),
            (&["materials.A.wire={}", "materials.A.wire=null"], "materials.A.wire", "given twice"),
            (&["materials.A={}", "materials={\"A\":{}}"], "materials.A", "given twice"),
            (&["nonsense=1", "nonsense=2"], "nonsense", "given twice"),
        ];
        let check = |texts: &[&str]| {
            let pair = |text: &&str| text.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
            check_once(&texts.iter().map(pair).collect::<Vec<_>>(), &tests::rules())
        };
        for (texts, key, part) in cases {
            let error = check(texts).expect_err(&format!("{texts:?}"));
            assert_eq!((error.fault, error.key.as_str()), (RequestFault::Conflict, *key), "{error}");
            assert!(error.to_string().contains(part), "{error}");
        }
        assert_eq!(cases.len(), 11);
        let fine: [&[&str]; 4] = [
            &["wire={}", "wire.color=f00", "materials.A.wire.color=0f0", "materials.B.wire.color=00f"],
            &["image.width=8", "image.height=9", "camera.view=top"],
            &["materials.A.wire.color=0f0", "materials.A.outline={\"color\":\"f00\"}"],
            &[],
        ];
        for texts in fine {
            assert!(check(texts).is_ok(), "{texts:?}");
        }
    }

    #[test]
    fn duplicates_in_a_document_are_refused_too() {
        let cases = [
            (r#"{"size":64,"image":{"width":32}}"#, Some("size")),
            (r#"{"size":64,"image":{"width":null,"samples":1}}"#, None),
            (r#"{"size":null,"image":{"width":32}}"#, None),
            (r#"{"up":"z","camera":{"up":"y"}}"#, Some("up")),
            (r#"{"up":"z","camera":{"view":"top"}}"#, None),
        ];
        for (document, key) in cases {
            let error = tests::json(document).err();
            assert_eq!(error.as_ref().map(|error| error.key.as_str()), key, "{document}");
            assert!(error.is_none_or(|error| error.fault == RequestFault::Conflict), "{document}");
        }
    }
}
