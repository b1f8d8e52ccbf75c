//! A document in place of a mesh: it names one that is stored, under the key `mesh`.

use std::fmt;

use serde::Deserializer as _;
use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde_json::Value as Json;

use super::error::{RequestError, RequestFault};
use super::json::DOCUMENT_BYTES_MAX;

/// The key of the mesh's name.
pub const KEY: &str = "mesh";

/// What stands there.
pub const ALLOWED: &str = "the SHA-256 of a stored mesh, 64 lower-case hexadecimal digits";

/// Whether a body is a request document that names its mesh rather than a mesh: a JSON object with a string under `mesh`.
/// A glTF file, which is a JSON object with `asset`, is one only if that string is 64 hexadecimal digits.
pub fn names_mesh(body: &[u8]) -> bool {
    if body.len() > DOCUMENT_BYTES_MAX || body.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return false;
    }
    let mut parser = serde_json::Deserializer::from_slice(body);
    parser.deserialize_map(Peek).is_ok_and(|seen| seen.has_digest || seen.has_name && !seen.has_asset)
}

/// The error for a name that no stored mesh can have.
pub fn bad_mesh_name(name: &str) -> RequestError {
    RequestError::new(RequestFault::OutOfRange, KEY, format!("{name:?}"), ALLOWED)
}

#[derive(Default)]
struct Seen {
    has_asset: bool,
    /// A string under `mesh`.
    has_name: bool,
    /// The same, of 64 hexadecimal digits.
    has_digest: bool,
}

/// Looks at the keys of an object and skips what is in it.
struct Peek;

impl<'de> Visitor<'de> for Peek {
    type Value = Seen;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Seen, A::Error> {
        let mut seen = Seen::default();
        while let Some(key) = object.next_key::<String>()? {
            if key != KEY {
                seen.has_asset |= key == "asset";
                object.next_value::<IgnoredAny>()?;
            } else if let Json::String(name) = object.next_value()? {
                seen.has_name = true;
                seen.has_digest |= name.len() == 64 && name.bytes().all(|b| b.is_ascii_hexdigit());
            }
        }
        Ok(seen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_is_told_from_a_gltf_file() {
        let digest = "0123456789abcdef".repeat(4);
        let cases = [
            (format!(r#"{{"mesh":"{digest}"}}"#), true),
            (format!("\t\r\n {{\"style\":\"wire\",\"image\":{{\"width\":8}},\"mesh\":\"{digest}\"}}"), true),
            (format!(r#"{{"mesh":"{}"}}"#, digest.to_uppercase()), true),
            (format!(r#"{{"asset":{{"version":"2.0"}},"mesh":"{digest}"}}"#), true),
            (format!(r#"{{"mesh":"{digest}","mesh":1}}"#), true),
            (r#"{"mesh":"bunny"}"#.to_owned(), true),
            (r#"{"asset":{"version":"2.0"},"mesh":"bunny"}"#.to_owned(), false),
            (r#"{"asset":{"version":"2.0"},"meshes":[]}"#.to_owned(), false),
            (r#"{"mesh":7}"#.to_owned(), false),
            (r#"{"style":"wire"}"#.to_owned(), false),
            (format!(r#"{{"a":{{"mesh":"{digest}"}}}}"#), false),
            (format!(r#"[{{"mesh":"{digest}"}}]"#), false),
            (format!(r#"{{"mesh":"{digest}""#), false),
            (format!("{{{}\"mesh\":\"{digest}\"}}", " ".repeat(DOCUMENT_BYTES_MAX)), false),
            ("[".repeat(100_000), false),
            (format!("{{\"a\":{}", "[".repeat(100_000)), false),
            (String::new(), false),
        ];
        for (text, expected) in &cases {
            assert_eq!(names_mesh(text.as_bytes()), *expected, "{text:.200}");
        }
        assert_eq!(cases.len(), 17);
    }
}
