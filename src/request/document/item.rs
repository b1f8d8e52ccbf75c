//! A key of a request and what was given for it, wherever in the request it stood.

use crate::request::table::value::Given;
use crate::request::table::{LAYERS, MATERIALS};

/// A key and its value.
#[derive(Clone, Debug)]
pub struct Item {
    /// The material that it is about; None: the document itself.
    pub material: Option<String>,
    /// A layer, or a layer and its key with a dot between, or another key of the document. Of a material, nothing stands for
    /// the whole of it.
    pub key: String,
    /// Its value.
    pub given: Given,
}

impl Item {
    /// From a dotted key. A material's name may have dots of its own: the key ends in a layer, or in a layer and its key.
    pub fn dotted(key: &str, text: &str) -> Self {
        let given = Given::Text(text.to_owned());
        let Some(rest) = key.strip_prefix(MATERIALS.name).and_then(|rest| rest.strip_prefix('.')) else {
            return Self { material: None, key: key.to_owned(), given };
        };
        let is_layer = |name: &str| LAYERS.iter().any(|layer| layer.name == name);
        let (name, inner) = match rest.rsplit_once('.') {
            Some((name, last)) if is_layer(last) => (name, last),
            Some((before, last)) => match before.rsplit_once('.') {
                Some((name, _)) => (name, &rest[name.len() + 1..]),
                // Neither can be a layer of a material: refused where it is looked up.
                None => (before, last),
            },
            None => (rest, ""),
        };
        Self { material: Some(name.to_owned()), key: inner.to_owned(), given }
    }

    /// The whole key, as error messages name it.
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
