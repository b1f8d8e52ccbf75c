//! The table of keys: all that a request document may contain, except `style`, `mesh` and `$schema`. The
//! reader, its error messages, the JSON Schema and the list of capabilities follow from it. A new key needs one
//! entry of [`keys`], and the field of a draft that it sets. Most drafts hold structs of the spec as they are; where
//! one does not, its `finish` sets the field of the spec.

pub(crate) mod dependent;
pub(crate) mod field;
mod keys;
pub(crate) mod value;

use std::sync::LazyLock;

use self::field::{Field, Section};

/// Every key that holds a value, except `$schema`, `mesh`, and `style`, which is read before all others.
pub static FIELDS: LazyLock<Vec<Field>> = LazyLock::new(keys::all);

/// The objects that hold keys: layers, then groups.
pub const SECTIONS: &[Section] = &[
    Section {
        name: "surface",
        about: "The filled surface.",
        turn: Some(|d, on| d.layers.surface = on.then(|| *d.surface())),
        is_for_materials: true,
    },
    Section {
        name: "wire",
        about: "Lines along the mesh's edges.",
        turn: Some(|d, on| d.layers.wire = on.then(|| *d.wire_draft())),
        is_for_materials: true,
    },
    Section {
        name: "outline",
        about: "The line around the shape.",
        turn: Some(|d, on| d.layers.outline = on.then(|| *d.outline())),
        is_for_materials: true,
    },
    Section {
        name: "topology",
        about: "Edges coloured by how the mesh is connected; kinds whose colour is null are not drawn.",
        turn: Some(|d, on| d.topology = on.then(|| *d.topology())),
        is_for_materials: false,
    },
    group("points", "Points of the file."),
    group("scene", "State of the file that is drawn, and what it stands on."),
    group("camera", "Position and lens; by default the mesh is fitted into the picture."),
    Section {
        name: "sheet",
        about: "Several views in one picture: its cells share the picture's width and height.",
        turn: Some(|d, on| d.sheet = on.then(|| d.sheet().clone())),
        is_for_materials: false,
    },
    group("light", "Lamps and ambient light."),
    group("image", "The picture."),
];

/// Layers by the asset's own material names.
pub const MATERIALS: Section = group(
    "materials",
    "Layers for the asset's materials of these names, over the document's own: {\"Glass\": {\"surface\": {\"opacity\": \
     0.3}, \"outline\": null}}.",
);

/// The key under which editors find the schema of a document. It has no effect on the picture.
pub const SCHEMA: &str = "$schema";

/// The description of `style`.
pub const STYLE_ABOUT: &str = "A preset of layers, which the layers then override.";

/// The section of this name.
pub fn section(name: &str) -> Option<&'static Section> {
    SECTIONS.iter().find(|section| section.name == name)
}

/// The field that a key or a short name stands for. Materials have no short names.
pub fn field(key: &str, of_material: bool) -> Option<&'static Field> {
    FIELDS.iter().find(|field| match of_material {
        true => field.key == key && field.is_for_materials(),
        false => field.key == key || field.short == Some(key),
    })
}

const fn group(name: &'static str, about: &'static str) -> Section {
    Section { name, about, turn: None, is_for_materials: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_belongs_somewhere_and_says_what_it_does() {
        let mut keys = 0;
        for field in FIELDS.iter() {
            assert_eq!(field.key.contains('.'), field.section().is_some(), "{}", field.key);
            assert!(field.about.ends_with('.') && !field.about.contains('\n'), "{}", field.key);
            assert!(field.section().is_none_or(|s| s.turn.is_some() || !s.is_for_materials), "{}", field.key);
            keys += 1;
        }
        assert_eq!(keys, 67);
        assert_eq!(FIELDS.iter().filter(|field| field.short.is_some()).count(), 6);
    }
}
