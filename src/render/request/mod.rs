//! The reader of requests: a JSON document and dotted keys become a [`Spec`], the checked description of
//! a picture.
//!
//! Each of these overrides what precedes it: defaults, the style, the document, the dotted keys of a
//! query or of `--set`. Materials begin from the document's own layers, as they are after all of these.
//! `null` turns a layer or the sheet off. For a key that may be empty, such as `camera.eye`, it is a value, which
//! overrides what precedes it: nothing is given, or what the key's description says (`surface.color`: the file's
//! colours). For any other key it is the same as leaving the key out of its object.
//! [`table`] is the table of keys, from which [`schema()`] follows.

mod apply;
mod components;
pub(crate) mod document;
mod draft;
mod error;
mod layers_draft;
mod schema;
mod sheet_draft;
mod style;
mod suggest;
mod table;
#[cfg(test)]
mod tests;

pub use crate::spec::words::{Words, word_for, words_of};
pub use apply::keys;
pub use components::{PREFIX as COMPONENTS_PREFIX, components};
pub use document::dotted::all_dotted;
pub use document::mesh_reference::{bad_mesh_name, is_faulty_document, names_mesh};
pub use error::{RequestError, RequestFault};
pub use schema::schema;
pub use style::Style;

use std::collections::BTreeMap;

use crate::image::ImageFormat;
use crate::limits::Limits;
use crate::spec::{BackendChoice, Spec};
use document::item::Item;
use document::{duplicate_keys, json, mesh_reference};
use draft::Draft;
use layers_draft::LayersDraft;
use table::value::{Given, Kind, Value};
use table::{FIELDS, MATERIALS};

/// The style of a request that names none.
const STYLE_DEFAULT: Style = Style::Auto;

/// Most materials of one request: more than any asset has.
const MATERIALS_MAX: usize = 1000;

/// Longest name of a material.
const MATERIAL_NAME_CHARS_MAX: usize = 256;

/// Limits and defaults of the server or command that reads a request.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Image size and JSON depth.
    pub limits: Limits,
    /// The back-end of a request that names none.
    pub backend: BackendChoice,
}

/// Dotted keys and their values, as text.
pub type Overrides = [(String, String)];

/// Reads a document and the dotted keys that override it, in order.
pub fn read(document: Option<&[u8]>, overrides: &Overrides, rules: &Rules) -> Result<Spec, RequestError> {
    let items = match document {
        Some(bytes) => json::flatten(bytes, rules.limits.json_depth)?,
        None => Vec::new(),
    };
    read_items(items, overrides, rules)
}

/// Reads a document that also names its mesh, as [`names_mesh`] finds, and the dotted keys that
/// override it. Returns the mesh's name as it was given.
pub fn read_with_mesh(document: &[u8], overrides: &Overrides, rules: &Rules) -> Result<(String, Spec), RequestError> {
    let mut items = json::flatten(document, rules.limits.json_depth)?;
    let at = items.iter().position(|item| item.material.is_none() && item.key == mesh_reference::KEY);
    let given = at.map(|at| items.remove(at).given);
    // The suggestions for an unknown key include `mesh` here.
    let spec = read_items(items, overrides, rules).map_err(|mut error| {
        if error.fault == RequestFault::UnknownKey && !error.key.contains('.') {
            error.allowed = suggest::allowed(&error.key, &keys());
        }
        error
    })?;
    match given {
        Some(Given::Json(serde_json::Value::String(name))) => Ok((name, spec)),
        Some(other) => {
            Err(RequestError::new(RequestFault::WrongType, mesh_reference::KEY, other.show(), mesh_reference::ALLOWED))
        }
        None => Err(RequestError::new(RequestFault::Missing, mesh_reference::KEY, "", mesh_reference::WHY)),
    }
}

/// Refuses duplicates among the dotted keys of a query. On a command line, in contrast, later flags
/// override earlier ones.
pub fn check_once(overrides: &Overrides, rules: &Rules) -> Result<(), RequestError> {
    duplicate_keys::check(&flatten_all(Vec::new(), overrides, rules)?)
}

/// Reads the dotted keys of a request for a report about a file: only the moment of its animation
/// is allowed.
pub fn read_moment(overrides: &Overrides, rules: &Rules) -> Result<Option<f64>, RequestError> {
    const MOMENT: &str = "scene.time_s";
    if let Some((key, text)) = overrides.iter().find(|(key, _)| key != MOMENT) {
        let allowed = format!("nothing is drawn here: of the keys of a request, allowed is {MOMENT}");
        return Err(RequestError::new(RequestFault::UnknownKey, key, format!("\"{text}\""), allowed));
    }
    Ok(read(None, overrides, rules)?.time_s)
}

/// Sets the picture's format. JPEG has no alpha, so the background is blended over white here, in
/// linear light.
pub fn set_format(spec: &mut Spec, format: ImageFormat) {
    spec.image.format = Some(format);
    if format == ImageFormat::Jpeg {
        spec.image.background = spec.image.background.over_white();
    }
}

/// The keys whose values are words, and those words.
pub fn vocabulary() -> BTreeMap<&'static str, Vec<&'static str>> {
    let of_field = |field: &'static table::field::Field| match &field.kind {
        Kind::Words(words) | Kind::WordList { words, .. } => Some((field.key, words.clone())),
        _ => None,
    };
    FIELDS.iter().filter_map(of_field).chain([("style", words_of::<Style>())]).collect()
}

fn read_items(items: Vec<Item>, overrides: &Overrides, rules: &Rules) -> Result<Spec, RequestError> {
    let items = flatten_all(items, overrides, rules)?;
    let (of_materials, items): (Vec<Item>, Vec<Item>) = items.into_iter().partition(|item| item.material.is_some());
    let (styles, items): (Vec<Item>, Vec<Item>) = items.into_iter().partition(|item| item.key == "style");

    let mut style = STYLE_DEFAULT;
    for item in styles.iter().filter(|item| !item.given.is_null()) {
        if let Value::Word(place) = Kind::Words(words_of::<Style>()).read("style", &item.given, 0)? {
            style = Style::ALL[place].1;
        }
    }
    let mut draft = Draft::new(style, rules.limits.image_px);
    items.iter().try_for_each(|item| apply::apply(&mut draft, item, rules))?;
    let materials = read_materials(&draft, &of_materials, rules)?;
    draft.finish(materials, rules)
}

/// The items of a document, then those of the dotted keys.
fn flatten_all(mut items: Vec<Item>, overrides: &Overrides, rules: &Rules) -> Result<Vec<Item>, RequestError> {
    for (key, text) in overrides {
        items.extend(json::flatten_override(key, text, rules.limits.json_depth)?);
    }
    Ok(items)
}

/// The layers of each material, which begin from the document's; sorted by name.
fn read_materials(base: &Draft, items: &[Item], rules: &Rules) -> Result<Vec<(String, LayersDraft)>, RequestError> {
    let out_of_range = |key: &str, given: String, allowed: String| {
        Err(RequestError::new(RequestFault::OutOfRange, key, given, allowed))
    };
    let mut materials: BTreeMap<&str, Draft> = BTreeMap::new();
    for item in items {
        let name = item.material.as_deref().unwrap_or_default();
        let chars = name.chars().count();
        if chars > MATERIAL_NAME_CHARS_MAX {
            let given = format!("{chars} characters long");
            return out_of_range(&item.whole_key(), given, format!("at most {MATERIAL_NAME_CHARS_MAX}"));
        }
        if item.key.is_empty() && item.given.is_null() {
            continue;
        }
        apply::apply(materials.entry(name).or_insert_with(|| base.clone()), item, rules)?;
        if materials.len() > MATERIALS_MAX {
            let allowed = format!("at most {MATERIALS_MAX} materials");
            return out_of_range(MATERIALS.name, "more than that".to_owned(), allowed);
        }
    }
    Ok(materials.into_iter().map(|(name, draft)| (name.to_owned(), draft.layers)).collect())
}
