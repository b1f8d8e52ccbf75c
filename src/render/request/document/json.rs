//! The flattening of a JSON document into a list of dotted keys and their values: an object `wire` with
//! the key `color` becomes the key `wire.color`. After that, documents and queries are read by the same
//! code.

use serde_json::Value as Json;

use super::item::Item;
use crate::request::document::duplicate_keys;
use crate::request::document::unique_keys::{DocumentError, parse};
use crate::request::error::{RequestError, RequestFault};
use crate::request::table::value::Given;
use crate::request::table::{self, MATERIALS, SCHEMA};

/// Longest document: a thousand times the usual length, and still small when parsed.
pub const DOCUMENT_BYTES_MAX: usize = 1 << 20;

/// Parses a document and flattens its objects; keys are in alphabetical order.
pub fn flatten(document: &[u8], depth_max: u64) -> Result<Vec<Item>, RequestError> {
    let not_json = |given: String, allowed: String| RequestError::new(RequestFault::NotJson, "request", given, allowed);
    if document.len() > DOCUMENT_BYTES_MAX {
        return Err(not_json(format!("{} bytes long", document.len()), format!("{DOCUMENT_BYTES_MAX} bytes")));
    }
    let json = parse(document, depth_max).map_err(|fault| match fault {
        DocumentError::TooDeep(depth) => {
            let error = not_json(format!("nested {depth} deep"), format!("a depth of {depth_max}"));
            RequestError { flag: Some("--limit-json-depth"), ..error }
        }
        DocumentError::NotJson(_) if document.trim_ascii().is_empty() => {
            not_json("empty".into(), "a JSON object".into())
        }
        DocumentError::NotJson(e) => not_json(not_json_at(&e), String::new()),
        DocumentError::Repeated(key) => repeated(&key),
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
            // Editors use it to find the schema.
            Json::String(_) | Json::Null if key == SCHEMA => {}
            other if key == SCHEMA => {
                return Err(RequestError::new(RequestFault::WrongType, SCHEMA, other, "a string"));
            }
            other => flatten_key(key, other, &mut items)?,
        }
    }
    duplicate_keys::check(&items)?;
    Ok(items)
}

/// Flattens a dotted key and its text: to one item, or, if the text is an object with keys
/// (`outline={"thickness":8}`), to the same items as that object in a document.
pub fn flatten_override(key: &str, text: &str, depth_max: u64) -> Result<Vec<Item>, RequestError> {
    let item = Item::dotted(key, text);
    let may_hold_keys = match &item.material {
        None => item.key == MATERIALS.name || table::section(&item.key).is_some(),
        Some(_) => item.key.is_empty() || table::section(&item.key).is_some(),
    };
    if !may_hold_keys || !text.trim_start().starts_with('{') || text.len() > DOCUMENT_BYTES_MAX {
        return Ok(vec![item]);
    }
    let whole = item.whole_key();
    let wrong = |why: String| {
        let allowed =
            format!("an object as JSON, such as {{\"KEY\": VALUE}} (one key alone is {whole}.KEY=VALUE){why}");
        RequestError::new(RequestFault::WrongType, &whole, item.given.show(), allowed)
    };
    let value = parse(text.as_bytes(), depth_max).map_err(|fault| match fault {
        DocumentError::TooDeep(_) => wrong(format!(", at most {depth_max} deep")),
        DocumentError::NotJson(e) => wrong(format!("; this is {}", not_json_at(&e))),
        DocumentError::Repeated(key) => repeated(&format!("{whole}.{key}")),
    })?;
    let mut items = Vec::new();
    match item.material {
        None => flatten_key(item.key, value, &mut items)?,
        Some(name) if item.key.is_empty() => flatten_material(name, value, &mut items)?,
        Some(name) => flatten_object(Some(&name), item.key, value, &mut items),
    }
    Ok(items)
}

/// The error for a key that an object has twice.
fn repeated(key: &str) -> RequestError {
    RequestError::new(RequestFault::Conflict, key, "given twice", "an object has a key once")
}

/// The place and the reason why a text is not JSON. The place comes first, because long errors are
/// cut off at the end.
fn not_json_at(error: &serde_json::Error) -> String {
    let said = error.to_string();
    let why = said.split(" at line ").next().unwrap_or_default();
    format!("not JSON at line {}, column {} ({why})", error.line(), error.column())
}

/// Flattens a key of the document itself.
fn flatten_key(key: String, value: Json, items: &mut Vec<Item>) -> Result<(), RequestError> {
    match value {
        Json::Object(materials) if key == MATERIALS.name && !materials.is_empty() => {
            materials.into_iter().try_for_each(|(name, value)| flatten_material(name, value, items))
        }
        other => {
            flatten_object(None, key, other, items);
            Ok(())
        }
    }
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

/// Flattens a section into its keys. Any other value becomes one item.
fn flatten_object(material: Option<&String>, key: String, value: Json, items: &mut Vec<Item>) {
    let item = |key, value| Item { material: material.cloned(), key, given: Given::Json(value) };
    match value {
        Json::Object(inner) if table::section(&key).is_some() && !inner.is_empty() => {
            items.extend(inner.into_iter().map(|(name, value)| item(format!("{key}.{name}"), value)));
        }
        other => items.push(item(key, other)),
    }
}

/// The error for a dotted key in a document.
fn dotted(prefix: &str, key: &str, value: &Json) -> RequestError {
    let nested = key.split_once('.').map_or(String::new(), |(a, b)| format!("{{\"{a}\": {{\"{b}\": ...}}}}"));
    let allowed = format!("dotted keys are for query parameters and --set; write {nested} in the document");
    RequestError::new(RequestFault::UnknownKey, &format!("{prefix}{key}"), value, allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_100_000_deep_is_refused_before_it_is_parsed() {
        let deep = "[".repeat(100_000);
        let error = flatten(deep.as_bytes(), 64).unwrap_err();
        assert_eq!(error.flag, Some("--limit-json-depth"));
        assert_eq!(error.fault, RequestFault::NotJson);
    }
}
