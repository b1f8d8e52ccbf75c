//! A JSON parser that refuses objects with duplicate keys: RFC 8259 leaves open which of two values
//! counts. Documents that are nested too deep are refused, too.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value as Json};

/// The reason why a document is refused.
pub enum DocumentError {
    /// It is nested this deep.
    TooDeep(u64),
    /// It is not JSON.
    NotJson(serde_json::Error),
    /// An object has this key twice. The keys of the objects around it precede it, with dots
    /// between.
    Repeated(String),
}

/// Parses a document of at most this depth.
pub fn parse(document: &[u8], depth_max: u64) -> Result<Json, DocumentError> {
    // Checked before the parser runs, because it is recursive.
    let depth = depth(document);
    if depth > depth_max {
        return Err(DocumentError::TooDeep(depth));
    }
    let mut repeated = None;
    let mut parser = serde_json::Deserializer::from_slice(document);
    let parsed = KeySearch { path: "", repeated: &mut repeated }.deserialize(&mut parser);
    match (parsed.and_then(|json| parser.end().map(|()| json)), repeated) {
        (_, Some(key)) => Err(DocumentError::Repeated(key)),
        (Ok(json), None) => Ok(json),
        (Err(error), None) => Err(DocumentError::NotJson(error)),
    }
}

/// A search for duplicate keys: the path of the value that is read, and the first duplicate key.
struct KeySearch<'a> {
    path: &'a str,
    repeated: &'a mut Option<String>,
}

impl<'de> DeserializeSeed<'de> for KeySearch<'_> {
    type Value = Json;

    fn deserialize<D: Deserializer<'de>>(self, parser: D) -> Result<Json, D::Error> {
        parser.deserialize_any(self)
    }
}

/// Visits values that hold no others.
macro_rules! plain {
    ($($visit:ident($type:ty))*) => {
        $(fn $visit<E: Error>(self, value: $type) -> Result<Json, E> {
            Ok(value.into())
        })*
    };
}

impl<'de> Visitor<'de> for KeySearch<'_> {
    type Value = Json;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Json, E> {
        Ok(Json::Null)
    }

    plain! { visit_bool(bool) visit_i64(i64) visit_u64(u64) visit_f64(f64) visit_str(&str) }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Json, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed(KeySearch { path: self.path, repeated: self.repeated })? {
            values.push(value);
        }
        Ok(Json::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Json, A::Error> {
        let mut values = Map::new();
        while let Some(key) = object.next_key::<String>()? {
            let path = if self.path.is_empty() { key.clone() } else { format!("{}.{key}", self.path) };
            if values.contains_key(&key) {
                *self.repeated = Some(path);
                return Err(A::Error::custom("a key twice"));
            }
            let value = object.next_value_seed(KeySearch { path: &path, repeated: self.repeated })?;
            values.insert(key, value);
        }
        Ok(Json::Object(values))
    }
}

/// Deepest nesting of objects and arrays, without recursion. Exact for valid JSON; the parser
/// refuses anything else.
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
    fn what_is_read_is_what_serde_reads() {
        let texts = [
            "null",
            "true",
            "-7",
            "18446744073709551615",
            "-1e-3",
            "0.1",
            r#""a\u00e9\"b""#,
            "[]",
            "[1,[2,{}],null]",
            r#"{"a":{"b":[{"c":1},{"c":2}]},"b":{"b":""}}"#,
        ];
        let mut cases = 0;
        for text in texts {
            let want: Json = serde_json::from_str(text).unwrap();
            assert!(matches!(parse(text.as_bytes(), 128), Ok(json) if json == want), "{text}");
            cases += 1;
        }
        assert_eq!(cases, 10);
        for text in ["", "{", "[1,]", "1 2", "{\"a\":1}}", "nul", "\"\u{1}\"", "1e999"] {
            assert!(matches!(parse(text.as_bytes(), 128), Err(DocumentError::NotJson(_))), "{text}");
        }
    }

    #[test]
    fn a_key_that_stands_twice_is_named() {
        let cases = [
            (r#"{"a":1,"a":1}"#, "a"),
            (r#"{"wire":{"color":"f00","lit":true,"color":"0f0"}}"#, "wire.color"),
            (r#"{"wire":{},"surface":{},"wire":null}"#, "wire"),
            (r#"{"materials":{"A":{"wire":{}},"A":{}}}"#, "materials.A"),
            (r#"{"x":[{"y":1,"\u0079":2}]}"#, "x.y"),
            (r#"{"":1,"":2}"#, ""),
        ];
        for (text, key) in cases {
            assert!(
                matches!(parse(text.as_bytes(), 128), Err(DocumentError::Repeated(named)) if named == key),
                "{text}"
            );
        }
    }
}
