//! JSON whose objects have no key twice. RFC 8259 leaves open which of two values counts, and whoever wrote both meant both.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value as Json};

/// Why bytes are no such document.
pub enum Fault {
    /// They are not JSON.
    NotJson(serde_json::Error),
    /// This key, with those of the objects around it before it, stands twice in an object.
    Repeated(String),
}

/// Parses; whoever calls has looked at the depth.
pub fn parse(document: &[u8]) -> Result<Json, Fault> {
    let mut repeated = None;
    let mut parser = serde_json::Deserializer::from_slice(document);
    let parsed = Place { path: "", repeated: &mut repeated }.deserialize(&mut parser);
    match (parsed.and_then(|json| parser.end().map(|()| json)), repeated) {
        (_, Some(key)) => Err(Fault::Repeated(key)),
        (Ok(json), None) => Ok(json),
        (Err(error), None) => Err(Fault::NotJson(error)),
    }
}

/// Where in the document a value is read, and where to say that a key is there again.
struct Place<'a> {
    path: &'a str,
    repeated: &'a mut Option<String>,
}

impl<'de> DeserializeSeed<'de> for Place<'_> {
    type Value = Json;

    fn deserialize<D: Deserializer<'de>>(self, parser: D) -> Result<Json, D::Error> {
        parser.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Place<'_> {
    type Value = Json;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Json, E> {
        Ok(Json::Null)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Json, E> {
        Ok(value.into())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Json, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Json, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Json, E> {
        Ok(value.into())
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Json, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Json, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed(Place { path: self.path, repeated: self.repeated })? {
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
            let value = object.next_value_seed(Place { path: &path, repeated: self.repeated })?;
            values.insert(key, value);
        }
        Ok(Json::Object(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert!(matches!(parse(text.as_bytes()), Ok(json) if json == want), "{text}");
            cases += 1;
        }
        assert_eq!(cases, 10);
        for text in ["", "{", "[1,]", "1 2", "{\"a\":1}}", "nul", "\"\u{1}\"", "1e999"] {
            assert!(matches!(parse(text.as_bytes()), Err(Fault::NotJson(_))), "{text}");
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
            assert!(matches!(parse(text.as_bytes()), Err(Fault::Repeated(named)) if named == key), "{text}");
        }
    }
}
