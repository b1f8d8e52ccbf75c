//! One key of a request and its value, from the document, a query or `--set`.

use crate::request::table::value::Given;
use crate::request::table::{self, MATERIALS};

/// A key and its value.
#[derive(Clone, Debug)]
pub struct Item {
    /// The material that it belongs to; None: the document itself.
    pub material: Option<String>,
    /// Dotted, such as `wire` or `wire.color`. Empty for a material as a whole.
    pub key: String,
    /// Its value.
    pub given: Given,
}

impl Item {
    /// Reads a dotted key. A material's name may contain dots, so the end decides: a layer, or a
    /// layer and one of its keys.
    pub fn dotted(key: &str, text: &str) -> Self {
        let given = Given::Text(text.to_owned());
        let Some(rest) = key.strip_prefix(MATERIALS.name).and_then(|rest| rest.strip_prefix('.')) else {
            return Self { material: None, key: key.to_owned(), given };
        };
        let is_layer = |name: &str| table::section(name).is_some_and(|section| section.turn.is_some());
        let (name, inner) = match rest.rsplit_once('.') {
            Some((name, last)) if is_layer(last) => (name, last),
            Some((before, last)) => match before.rsplit_once('.') {
                Some((name, _)) => (name, &rest[name.len() + 1..]),
                // Neither is a layer of a material, which the look-up will refuse.
                None => (before, last),
            },
            None => (rest, ""),
        };
        Self { material: Some(name.to_owned()), key: inner.to_owned(), given }
    }

    /// The whole dotted key, for error messages.
    pub fn whole_key(&self) -> String {
        match &self.material {
            None => self.key.clone(),
            Some(name) if self.key.is_empty() => format!("{}.{name}", MATERIALS.name),
            Some(name) => format!("{}.{name}.{}", MATERIALS.name, self.key),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_names_may_have_dots() {
        let cases = [
            ("materials.Glass.surface.opacity", Some("Glass"), "surface.opacity"),
            ("materials.Glass.surface", Some("Glass"), "surface"),
            ("materials.Glass.v2.1.surface", Some("Glass.v2.1"), "surface"),
            ("materials.Glass.v2.1.wire.color", Some("Glass.v2.1"), "wire.color"),
            ("materials.wire.wire.color", Some("wire"), "wire.color"),
            ("materials.surface.wire", Some("surface"), "wire"),
            ("materials..surface", Some(""), "surface"),
            ("materials...surface", Some("."), "surface"),
            ("materials.Glass", Some("Glass"), ""),
            ("materials.Glass.opacity", Some("Glass"), "opacity"),
            ("materials.", Some(""), ""),
            ("materials", None, "materials"),
            ("materialsx.a", None, "materialsx.a"),
            ("wire.color", None, "wire.color"),
            ("", None, ""),
        ];
        for (key, material, inner) in cases {
            let item = Item::dotted(key, "1");
            assert_eq!((item.material.as_deref(), item.key.as_str()), (material, inner), "{key}");
            assert!(item.whole_key() == key || key == "materials.", "{key}: {}", item.whole_key());
        }
    }
}
