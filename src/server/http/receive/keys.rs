//! The parameters of a check or a comparison, such as `rules` and `max_distance`. They come from the query, and from the
//! JSON document that names stored meshes in place of an upload. They have nothing to do with API keys.

use std::fmt;

use axum::http::Uri;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value as Json;

use super::query::{self, bad, quote};
use crate::digest::Digest;
use crate::http::error::ApiError;
use crate::store::Reading;

/// Longest document, bytes.
const DOCUMENT_BYTES_MAX: usize = 64 << 10;

/// Keys with their values as text, each key once.
#[derive(Clone, Debug, Default)]
pub struct Keys(Vec<(String, String)>);

impl Keys {
    /// Reads a query. `known` are the keys beside those that say how a mesh is read.
    pub fn of_query(uri: &Uri, known: &[&str]) -> Result<(Reading, Self), ApiError> {
        let (reading, pairs) = query::pairs(uri)?;
        let keys = Self(pairs);
        keys.check(known, "; of the mesh, a query says `format_in` and `entry`")?;
        Ok((reading, keys))
    }

    /// The keys that were stored.
    pub fn stored(pairs: &[(String, String)]) -> Self {
        Self(pairs.to_vec())
    }

    /// Adds the keys of a document that names stored meshes under `names`, and returns these. The query overrides
    /// the document.
    pub fn add_document<const N: usize>(
        &mut self,
        document: &[u8],
        known: &[&str],
        names: [&str; N],
    ) -> Result<[Digest; N], ApiError> {
        if document.len() > DOCUMENT_BYTES_MAX {
            let detail = format!("a document that names stored meshes has at most {DOCUMENT_BYTES_MAX} bytes");
            return Err(bad("out_of_range", detail));
        }
        let Pairs(mut pairs) = serde_json::from_slice(document)
            .map_err(|error| bad("not_json", format!("the document cannot be read as a JSON object: {error}")))?;
        let mut digests = Vec::new();
        for name in names {
            let found: Vec<Json> = pairs.extract_if(.., |(key, _)| key == name).map(|(_, value)| value).collect();
            let digest = match found.as_slice() {
                [] => return Err(bad("missing_key", format!("`{name}` is missing; it is {DIGEST}"))),
                [Json::String(text)] => Digest::parse(text),
                [_] => None,
                _ => return Err(twice(name)),
            };
            let given = || found[0].to_string().chars().take(80).collect::<String>();
            digests
                .push(digest.ok_or_else(|| bad("out_of_range", format!("`{name}` is {}; it is {DIGEST}", given())))?);
        }
        let mut of_document = Self::default();
        for (key, value) in pairs {
            let text = text_of(&key, value)?;
            of_document.0.push((key, text));
        }
        of_document.check(known, &format!("; it names its meshes under {}", list(&names)))?;
        of_document.0.retain(|(key, _)| self.get(key).is_none());
        self.0.extend(of_document.0);
        digests.try_into().map_err(|_| ApiError::internal())
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    /// All pairs.
    pub fn pairs(&self) -> &[(String, String)] {
        &self.0
    }

    /// True if a failed verdict is to be answered with 422.
    pub fn may_fail(&self) -> Result<bool, ApiError> {
        match self.get("fail") {
            None => Ok(false),
            Some("422") => Ok(true),
            Some(other) => Err(bad("out_of_range", format!("`fail` is {}, and allowed is 422", quote(other)))),
        }
    }

    fn check(&self, known: &[&str], more: &str) -> Result<(), ApiError> {
        for (index, (key, _)) in self.0.iter().enumerate() {
            if !known.contains(&key.as_str()) {
                let detail = format!("there is no key {} here; the keys are {}{more}", quote(key), list(known));
                return Err(bad("unknown_key", detail));
            }
            if self.0[..index].iter().any(|(other, _)| other == key) {
                return Err(twice(key));
            }
        }
        Ok(())
    }
}

/// The value of a key that names a stored mesh, for errors.
const DIGEST: &str = "the SHA-256 of a stored mesh, 64 lower-case hexadecimal digits";

fn twice(key: &str) -> ApiError {
    bad("conflicting_keys", format!("`{key}` is given twice, and each key is given once"))
}

fn list(keys: &[&str]) -> String {
    keys.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ")
}

/// A value of a document as a query has it.
fn text_of(key: &str, value: Json) -> Result<String, ApiError> {
    let wrong = || bad("wrong_type", format!("the value of {} is a text, a number, or a list of texts", quote(key)));
    match value {
        Json::String(text) => Ok(text),
        Json::Number(number) => Ok(number.to_string()),
        Json::Array(values) => {
            let texts = values.iter().map(|value| value.as_str().ok_or_else(wrong)).collect::<Result<Vec<_>, _>>()?;
            Ok(texts.join(","))
        }
        Json::Null | Json::Bool(_) | Json::Object(_) => Err(wrong()),
    }
}

/// The pairs of a JSON object, with those whose keys repeat.
struct Pairs(Vec<(String, Json)>);

impl<'de> Deserialize<'de> for Pairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(PairsVisitor)
    }
}

struct PairsVisitor;

impl<'de> Visitor<'de> for PairsVisitor {
    type Value = Pairs;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Pairs, A::Error> {
        let mut pairs = Vec::new();
        while let Some(pair) = map.next_entry()? {
            pairs.push(pair);
        }
        Ok(Pairs(pairs))
    }
}
