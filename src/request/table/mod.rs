//! The table of keys: everything that a request document may say. Reading, error messages, the JSON Schema and the list of
//! capabilities all follow from it.

pub(crate) mod fields;
mod layers;
mod scene;
pub(crate) mod value;
pub(crate) mod words;

use std::sync::LazyLock;

use self::fields::{Field, Group, Layer};
use self::value::Kind;
use super::draft::Draft;
use crate::request::layer_draft::Look;

/// Every key with a value. `style` is read before them, since presets come first.
pub static FIELDS: LazyLock<Vec<Field>> =
    LazyLock::new(|| layers::fields().into_iter().chain(scene::fields()).collect());

/// What is drawn.
pub const LAYERS: &[Layer] = &[
    Layer::of_looks("surface", "The filled surface.", Look::turn_surface),
    Layer::of_looks("wire", "Lines along the mesh's edges.", Look::turn_wire),
    Layer::of_looks("outline", "The line around the shape.", Look::turn_outline),
    Layer::of_document(
        "topology",
        "Edges that say how the mesh hangs together, each kind in its own colour; null draws none \
             of a kind.",
        Draft::turn_topology,
    ),
];

/// What else is told.
pub const GROUPS: &[Group] = &[
    Group { name: "scene", about: "Which state of the file is drawn." },
    Group { name: "camera", about: "Where the picture is taken from; by default the mesh is fitted into it." },
    Group { name: "light", about: "Lamps over light that comes from everywhere." },
    Group { name: "image", about: "The picture." },
];

/// Layers by the asset's own material names.
pub const MATERIALS: Group = Group {
    name: "materials",
    about: "Layers for the asset's materials of these names, over the document's own: \
            {\"Glass\": {\"surface\": {\"opacity\": 0.3}, \"outline\": null}}.",
};

/// Where an editor finds the schema of a document; nothing to a picture.
pub const SCHEMA: &str = "$schema";

/// What [`super::Style`] chooses.
pub const STYLE_ABOUT: &str = "A preset of layers, which the layers then override.";

/// Short names, and the keys they stand for.
pub const SHORT: &[(&str, &str)] = &[
    ("format", "image.format"),
    ("samples", "image.samples"),
    ("background", "image.background"),
    ("max_error", "image.max_error"),
    ("view", "camera.view"),
    ("up", "camera.up"),
];

/// A share, such as an opacity.
const SHARE: Kind = Kind::Number { min: 0.0, max: 1.0 };

fn number(min: f64, max: f64) -> Kind {
    Kind::Number { min, max }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_belongs_somewhere_and_says_what_it_does() {
        let homes: Vec<&str> = LAYERS.iter().map(|l| l.name).chain(GROUPS.iter().map(|g| g.name)).collect();
        let mut keys = 0;
        for field in FIELDS.iter() {
            let home = field.key.split_once('.').map(|(home, _)| home);
            assert!(home.is_none_or(|home| homes.contains(&home)), "{}", field.key);
            assert!(field.about.ends_with('.') && !field.about.contains('\n'), "{}", field.key);
            let layer = LAYERS.iter().find(|l| home == Some(l.name));
            assert_eq!(layer.is_some_and(Layer::is_for_materials), field.is_for_materials(), "{}", field.key);
            keys += 1;
        }
        assert_eq!(keys, 54);
        assert!(SHORT.iter().all(|(_, long)| FIELDS.iter().any(|f| f.key == *long)));
    }
}
