//! The JSON document as a flat list of dotted keys.

use serde_json::Value as Json;

use super::error::{RequestError, RequestFault};
use super::item::Item;
use super::table::{GROUPS, LAYERS, MATERIALS, SCHEMA};
use super::unique::{Fault, parse};
use super::value::Given;

/// Longest document: a thousand times what anybody writes by hand, and small when parsed.
pub const DOCUMENT_BYTES_MAX: usize = 1 << 20;

/// Parses a document and flattens its objects, in document order of the sorted keys.
pub fn flatten(document: &[u8], depth_max: u64) -> Result<Vec<Item>, RequestError> {
    let not_json = |given: String, allowed: String| RequestError::new(RequestFault::NotJson, "request", given, allowed);
    if document.len() > DOCUMENT_BYTES_MAX {
        return Err(not_json(format!("{} bytes long", document.len()), format!("{DOCUMENT_BYTES_MAX} bytes")));
    }
    // Before the parser, whose recursion costs stack.
    if depth(document) > depth_max {
        let mut error = not_json(format!("nested {} deep", depth(document)), format!("a depth of {depth_max}"));
        error.flag = Some("--limit-json-depth");
        return Err(error);
    }
    let json = parse(document).map_err(|fault| match fault {
        Fault::NotJson(e) => not_json(format!("not JSON ({e})"), "a JSON object".into()),
        Fault::Repeated(key) => {
            RequestError::new(RequestFault::Conflict, &key, "given twice", "an object has a key once")
        }
    })?;
    let Json::Object(object) = json else {
        return Err(not_json(Given::Json(json).show(), "a JSON object".into()));
    };
    let mut items = Vec::new();
    for (key, value) in object {
        if key.contains('.') {
            return Err(dotted("", &key, &value));
        }
        match value {
            // Editors write it to find the schema.
            Json::String(_) | Json::Null if key == SCHEMA => {}
            other if key == SCHEMA => {
                return Err(RequestError::new(RequestFault::WrongType, SCHEMA, other, "a string"));
            }
            Json::Object(materials) if key == MATERIALS.name => {
                for (name, value) in materials {
                    flatten_material(name, value, &mut items)?;
                }
            }
            other => flatten_object(None, key, other, &mut items),
        }
    }
    Ok(items)
}

fn flatten_material(name: String, value: Json, items: &mut Vec<Item>) -> Result<(), RequestError> {
    match value {
        Json::Object(layers) if !layers.is_empty() => {
            for (layer, value) in layers {
                if layer.contains('.') {
                    return Err(dotted(&format!("{}.{name}.", MATERIALS.name), &layer, &value));
                }
                flatten_object(Some(&name), layer, value, items);
            }
        }
        other => items.push(Item { material: Some(name), key: String::new(), given: Given::Json(other) }),
    }
    Ok(())
}

/// The keys of a layer or a group, one by one; anything else as it is.
fn flatten_object(material: Option<&String>, key: String, value: Json, items: &mut Vec<Item>) {
    let holds_keys = LAYERS.iter().map(|l| l.name).chain(GROUPS.iter().map(|g| g.name)).any(|name| name == key);
    let item = |key, value| Item { material: material.cloned(), key, given: Given::Json(value) };
    match value {
        Json::Object(inner) if holds_keys && !inner.is_empty() => {
            items.extend(inner.into_iter().map(|(name, value)| item(format!("{key}.{name}"), value)));
        }
        other => items.push(item(key, other)),
    }
}

fn dotted(prefix: &str, key: &str, value: &Json) -> RequestError {
    let nested = key.split_once('.').map_or(String::new(), |(a, b)| format!("{{\"{a}\": {{\"{b}\": ...}}}}"));
    let allowed = format!("dotted keys are for query parameters and --set; write {nested} in the document");
    RequestError::new(RequestFault::UnknownKey, &format!("{prefix}{key}"), value, allowed)
}

/// Deepest nesting of objects and arrays, without recursion. Exact for valid JSON; for anything else the parser speaks.
fn depth(bytes: &[u8]) -> u64 {
    let (mut depth, mut deepest, mut in_string, mut escaped) = (0_u64, 0, false, false);
    for &byte in bytes {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            _ if in_string => {}
            b'{' | b'[' => {
                depth += 1;
                deepest = deepest.max(depth);
            }
            b'}' | b']' => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_counts_brackets_outside_strings() {
        let cases: [(&str, u64); 6] =
            [("{}", 1), ("[[[]]]", 3), (r#"{"a":"[[[["}"#, 1), (r#"{"a":"\"[[","b":[]}"#, 2), ("1", 0), ("]]][", 1)];
        for (text, expected) in cases {
            assert_eq!(depth(text.as_bytes()), expected, "{text}");
        }
    }

    #[test]
    fn a_document_100_000_deep_is_refused_before_it_is_parsed() {
        let deep = "[".repeat(100_000);
        let error = flatten(deep.as_bytes(), 64).unwrap_err();
        assert_eq!(error.flag, Some("--limit-json-depth"));
        assert_eq!(error.fault, RequestFault::NotJson);
    }
}
