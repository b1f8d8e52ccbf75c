//! The JSON document as a flat list of dotted keys.

use serde_json::Value as Json;

use super::error::{RequestError, RequestFault};
use super::fields::{GROUPS, LAYERS};
use super::value::Given;

/// Longest document: a thousand times what anybody writes by hand, and small when parsed.
const DOCUMENT_BYTES_MAX: usize = 1 << 20;

/// Parses a document and flattens its objects, in document order of the sorted keys.
pub fn flatten(document: &[u8], depth_max: u64) -> Result<Vec<(String, Given)>, RequestError> {
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
    let json: Json =
        serde_json::from_slice(document).map_err(|e| not_json(format!("not JSON ({e})"), "a JSON object".into()))?;
    let Json::Object(object) = json else {
        return Err(not_json(Given::Json(json).show(), "a JSON object".into()));
    };
    let mut pairs = Vec::new();
    for (key, value) in object {
        if key.contains('.') {
            return Err(dotted(&key, &value));
        }
        match value {
            Json::Object(inner) if is_object_key(&key) && !inner.is_empty() => {
                for (name, value) in inner {
                    pairs.push((format!("{key}.{name}"), Given::Json(value)));
                }
            }
            other => pairs.push((key, Given::Json(other))),
        }
    }
    Ok(pairs)
}

fn is_object_key(key: &str) -> bool {
    LAYERS.iter().any(|&(layer, _)| layer == key) || GROUPS.contains(&key)
}

fn dotted(key: &str, value: &Json) -> RequestError {
    let nested = key.split_once('.').map_or(String::new(), |(a, b)| format!("{{\"{a}\": {{\"{b}\": ...}}}}"));
    let allowed = format!("dotted keys are for query parameters and --set; write {nested} in the document");
    RequestError::new(RequestFault::UnknownKey, key, value, allowed)
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
