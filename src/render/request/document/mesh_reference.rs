//! The recognition of request documents that are sent in place of a mesh file: under the key `mesh`
//! they name a mesh that the server has stored. A glTF file is JSON as well, so the two are told apart
//! here.

use std::fmt;

use serde::Deserializer as _;
use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde_json::Value as Json;

use super::json::DOCUMENT_BYTES_MAX;
use crate::request::error::{RequestError, RequestFault};

/// The key that names the mesh.
pub const KEY: &str = "mesh";

/// Its allowed values, for errors.
pub const ALLOWED: &str = "the SHA-256 of a stored mesh, 64 lower-case hexadecimal digits";

/// Its description in the schema.
pub const ABOUT: &str = "SHA-256 of a stored mesh; only in a JSON body that is sent in place of a mesh.";

/// The error where it is missing.
pub const WHY: &str = "a JSON body is a request document and names the mesh to draw by the SHA-256 under which it is stored, \
                       {\"mesh\": \"64 hexadecimal digits\", ...}; or it is a glTF file, which has `asset`";

/// The error where it is not allowed.
pub const ELSEWHERE: &str = "it names a stored mesh in a JSON body that is sent in place of a mesh, and nowhere else";

/// True for a request document that names its mesh: a JSON object with `mesh`. An object
/// that also has `asset` may be a glTF file, so there the value of `mesh` must be 64 hexadecimal
/// digits.
pub fn names_mesh(body: &[u8]) -> bool {
    begins_object(body) && peek(body).is_some_and(|seen| seen.has_digest || seen.has_mesh && !seen.has_asset)
}

/// True if a body that names no mesh can only be a request document with a mistake.
/// `is_declared_json`: the client declares it as JSON. If not, it must contain `"mesh"`.
pub fn is_faulty_document(body: &[u8], is_declared_json: bool) -> bool {
    let text = body.trim_ascii_start();
    if text.is_empty() || !begins_object(body) {
        // Any other text may be a mesh with a wrong content type.
        return is_declared_json && (text.is_empty() || text.starts_with(b"[") || text.starts_with(b"\""));
    }
    match peek(body) {
        Some(seen) => is_declared_json && !seen.has_asset,
        // Importers explain faults of files: broken glTF, and binary STL whose header begins like
        // an object.
        None if contains(text, b"\"asset\"") || text.contains(&0) => false,
        None => is_declared_json || contains(text, b"\"mesh\""),
    }
}

fn begins_object(body: &[u8]) -> bool {
    body.len() <= DOCUMENT_BYTES_MAX && body.trim_ascii_start().starts_with(b"{")
}

fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}

/// The keys of an object that matter here; None if the body is not JSON.
fn peek(body: &[u8]) -> Option<Seen> {
    let mut parser = serde_json::Deserializer::from_slice(body);
    let seen = parser.deserialize_map(Peek).ok()?;
    parser.end().ok().map(|()| seen)
}

/// The error for a name that no stored mesh can have.
pub fn bad_mesh_name(name: &str) -> RequestError {
    RequestError::new(RequestFault::OutOfRange, KEY, format!("{name:?}"), ALLOWED)
}

/// Keys that an object has.
#[derive(Default)]
struct Seen {
    has_asset: bool,
    has_mesh: bool,
    /// A string of 64 hexadecimal digits under `mesh`.
    has_digest: bool,
}

/// A visitor that looks at the keys of an object and skips their values.
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
            } else {
                seen.has_mesh = true;
                let value = object.next_value::<Json>()?;
                let is_digest = |name: &str| name.len() == 64 && name.bytes().all(|b| b.is_ascii_hexdigit());
                seen.has_digest |= value.as_str().is_some_and(is_digest);
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
            (r#"{"mesh":7}"#.to_owned(), true),
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

    #[test]
    fn a_document_with_a_mistake_is_told_from_a_mesh() {
        // The body, and the answers if it is declared as JSON and if it is not.
        let cases: [(&[u8], bool, bool); 16] = [
            (b"", true, false),
            (b" \n", true, false),
            (br#"{"style":"wire"}"#, true, false),
            (br#"{"mesh":"x",}"#, true, true),
            (br#"{"mesh":"x""#, true, true),
            (br#"{"style":"wire",}"#, true, false),
            (br#"{"style":"wire"} {}"#, true, false),
            (b"{", true, false),
            (b"[]", true, false),
            (b"\"wire\"", true, false),
            (br#"{"asset":{"version":"2.0"}}"#, false, false),
            (br#"{"asset":{"version":"2.0"},}"#, false, false),
            (b"{ a header of binary STL\0\0\0\0", false, false),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", false, false),
            (b"# {\"mesh\"", false, false),
            (b"solid x\nendsolid x\n", false, false),
        ];
        for (body, as_json, as_bytes) in cases {
            let said = [is_faulty_document(body, true), is_faulty_document(body, false)];
            assert_eq!(said, [as_json, as_bytes], "{}", String::from_utf8_lossy(body));
        }
        assert!(is_faulty_document("[".repeat(100_000).as_bytes(), true));
        assert!(is_faulty_document(format!("{{\"a\":{}", "[".repeat(100_000)).as_bytes(), true));
    }
}
