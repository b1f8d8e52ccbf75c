//! The request document: JSON and dotted keys to a [`Spec`].
//!
//! Defaults, then the style's preset, then the document, then the dotted keys of a query or of `--set`: each overrides
//! what came before. Materials begin from what the document's own layers have become by then, wherever they stand.
//! A layer that is `null` is off; of any other key `null` is its default, or as if the key were not there.
//! [`table`] is the table of keys; a new key is a line there, and [`schema()`] writes it out for others.

pub(crate) mod document;
mod draft;
mod error;
pub(crate) mod layer_draft;
mod schema;
mod suggest;
mod table;
#[cfg(test)]
mod tests;

pub use crate::request::document::dotted::all_dotted;
pub use crate::request::document::mesh_reference::{bad_mesh_name, is_faulty_document, names_mesh};
use document::{duplicate_keys, json, mesh_reference};
pub use error::{RequestError, RequestFault};
pub use schema::schema;
pub use table::words::{Style, Words, word_for, words_of};

use std::collections::BTreeMap;

use crate::image::ImageFormat;
use crate::limits::{IMAGE_PX_MAX, Limits};
use crate::request::document::item::Item;
use crate::spec::BackendChoice;
use crate::spec::Spec;
use crate::spec::color::Rgba;
use draft::Draft;
use layer_draft::Look;
use table::fields::{Layer, Target};
use table::value::{Given, Kind, Value};
use table::{FIELDS, GROUPS, LAYERS, MATERIALS, SCHEMA, SHORT};

/// The style of a request that names none.
const STYLE_DEFAULT: Style = Style::Flat;

/// Materials of one request: more than any asset has, and soon looked through.
const MATERIALS_MAX: usize = 1000;

/// Longest name of a material.
const MATERIAL_NAME_CHARS_MAX: usize = 256;

/// What a request is read against.
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

/// Reads a document that also names its mesh, as [`names_mesh`] says, and the dotted keys that override it. The mesh's name is
/// as it was given.
pub fn read_with_mesh(document: &[u8], overrides: &Overrides, rules: &Rules) -> Result<(String, Spec), RequestError> {
    let mut items = json::flatten(document, rules.limits.json_depth)?;
    let at = items.iter().position(|item| item.material.is_none() && item.key == mesh_reference::KEY);
    let given = at.map(|at| items.remove(at).given);
    // A misspelt `mesh` is an unknown key, and not only missing.
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

/// Refuses dotted keys two of which say the same. A query is written at once; on a command line, later flags override earlier
/// ones.
pub fn check_once(overrides: &Overrides, rules: &Rules) -> Result<(), RequestError> {
    let mut items = Vec::new();
    for (key, text) in overrides {
        items.extend(json::flatten_override(key, text, rules.limits.json_depth)?);
    }
    duplicate_keys::check(&items)
}

/// Reads the dotted keys of who asks what is in a file: the moment of its animation alone can be said.
pub fn read_moment(overrides: &Overrides, rules: &Rules) -> Result<Option<f64>, RequestError> {
    const MOMENT: &str = "scene.time_s";
    if let Some((key, text)) = overrides.iter().find(|(key, _)| key != MOMENT) {
        let allowed = format!("nothing is drawn here: of the keys of a request, allowed is {MOMENT}");
        return Err(RequestError::new(RequestFault::UnknownKey, key, format!("\"{text}\""), allowed));
    }
    Ok(read(None, overrides, rules)?.time_s)
}

fn read_items(mut items: Vec<Item>, overrides: &Overrides, rules: &Rules) -> Result<Spec, RequestError> {
    for (key, text) in overrides {
        items.extend(json::flatten_override(key, text, rules.limits.json_depth)?);
    }
    let (of_materials, mut items): (Vec<Item>, Vec<Item>) = items.into_iter().partition(|i| i.material.is_some());

    let mut style = STYLE_DEFAULT;
    for item in items.iter().filter(|item| item.key == "style" && !item.given.is_null()) {
        style = read_style(&item.given)?;
    }
    items.retain(|item| item.key != "style");
    let mut draft = Draft::new(style, rules.backend);
    // A picture whose size nobody gave must not be larger than one that somebody could ask for.
    let side_max = u32::try_from(rules.limits.image_px).unwrap_or(u32::MAX);
    let image = &mut draft.image;
    (image.width_px, image.height_px) = (image.width_px.min(side_max), image.height_px.min(side_max));
    for item in &items {
        apply(&mut Target::Document(&mut draft), item, rules)?;
    }
    let materials = read_materials(&draft.look, of_materials, rules)?;
    draft.finish(materials)
}

/// Settles the picture's format. JPEG has no alpha, so its background is laid over white here, in linear light.
pub fn set_format(spec: &mut Spec, format: ImageFormat) {
    spec.image.format = Some(format);
    if format == ImageFormat::Jpeg {
        let [r, g, b, a] = spec.image.background.premultiplied();
        spec.image.background = Rgba([r + (1.0 - a), g + (1.0 - a), b + (1.0 - a), 1.0]);
    }
}

/// Every key, sorted, for lists and suggestions.
pub fn keys() -> Vec<&'static str> {
    let mut keys: Vec<_> = FIELDS.iter().map(|f| f.key).collect();
    keys.extend(LAYERS.iter().map(|layer| layer.name));
    keys.extend(SHORT.iter().map(|&(key, _)| key));
    keys.extend(GROUPS.iter().map(|group| group.name));
    keys.extend([MATERIALS.name, mesh_reference::KEY, "style"]);
    keys.sort_unstable();
    keys
}

/// The keys whose values are words, and those words.
pub fn vocabulary() -> BTreeMap<&'static str, Vec<&'static str>> {
    let of_field = |field: &'static table::fields::Field| match &field.kind {
        Kind::Words(words) => Some((field.key, words.clone())),
        _ => None,
    };
    FIELDS.iter().filter_map(of_field).chain([("style", words_of::<Style>())]).collect()
}

fn read_style(given: &Given) -> Result<Style, RequestError> {
    match Kind::Words(words_of::<Style>()).read("style", given, 0)? {
        Value::Word(place) => Ok(Style::ALL[place].1),
        _ => Ok(STYLE_DEFAULT),
    }
}

/// Each material's layers, which begin from the document's; sorted by name.
fn read_materials(base: &Look, items: Vec<Item>, rules: &Rules) -> Result<Vec<(String, Look)>, RequestError> {
    let mut materials: BTreeMap<String, Look> = BTreeMap::new();
    for item in items {
        let name = item.material.clone().unwrap_or_default();
        let chars = name.chars().count();
        if chars > MATERIAL_NAME_CHARS_MAX {
            let (given, allowed) = (format!("{chars} characters long"), format!("at most {MATERIAL_NAME_CHARS_MAX}"));
            return Err(RequestError::new(RequestFault::OutOfRange, &item.whole_key(), given, allowed));
        }
        if item.key.is_empty() && item.given.is_null() {
            continue;
        }
        let look = materials.entry(name).or_insert_with(|| base.clone());
        apply(&mut Target::Material(look), &item, rules)?;
        if materials.len() > MATERIALS_MAX {
            let (given, allowed) = ("more than that".to_owned(), format!("at most {MATERIALS_MAX} materials"));
            return Err(RequestError::new(RequestFault::OutOfRange, MATERIALS.name, given, allowed));
        }
    }
    Ok(materials.into_iter().collect())
}

fn apply(target: &mut Target<'_>, item: &Item, rules: &Rules) -> Result<(), RequestError> {
    let (key, given) = (item.key.as_str(), &item.given);
    let layer = LAYERS.iter().find(|layer| layer.name == key && (!target.is_material() || layer.is_for_materials()));
    if let Some(layer) = layer {
        if given.is_null() || given.is_empty_object() {
            layer.turn(target, !given.is_null());
            return Ok(());
        }
        return Err(no_object(
            item,
            "an object with the layer's keys",
            "{} for its defaults, or null to turn the layer off",
        ));
    }
    let allowed = match target {
        Target::Material(_) => key.is_empty().then_some("an object with the layers surface, wire and outline"),
        Target::Document(_) if key == MATERIALS.name => Some("an object of materials by their names"),
        Target::Document(_) => GROUPS.iter().any(|group| group.name == key).then_some("an object"),
    };
    if let Some(allowed) = allowed {
        return if given.is_empty_object() || given.is_null() {
            Ok(())
        } else {
            Err(no_object(item, allowed, "or null"))
        };
    }
    let long = SHORT.iter().find(|&&(short, _)| short == key && !target.is_material()).map_or(key, |&(_, long)| long);
    let field = FIELDS.iter().find(|f| f.key == long && (!target.is_material() || f.is_for_materials()));
    let Some(field) = field else {
        return Err(if target.is_material() { unknown_of_material(item) } else { unknown(key, given) });
    };
    if given.is_null() {
        match LAYERS.iter().find(|layer| long.split_once('.').is_some_and(|(home, _)| home == layer.name)) {
            _ if field.nullable => field.set(target, Value::Null),
            // As in an object without the key.
            Some(layer) => layer.turn(target, true),
            None => {}
        }
        return Ok(());
    }
    let value = field.kind.read(&item.whole_key(), given, rules.limits.image_px).map_err(|mut error| {
        let is_image_limit = matches!(field.kind, Kind::Pixels | Kind::Size);
        if is_image_limit && error.fault == RequestFault::OutOfRange && rules.limits.image_px < IMAGE_PX_MAX {
            error.flag = Some("--limit-image-px");
        }
        if field.nullable {
            error.allowed.push_str(", or null");
        }
        error
    })?;
    field.set(target, value);
    Ok(())
}

/// Something else where an object belongs. In a query or a flag, there is a way to give one of its keys alone.
fn no_object(item: &Item, allowed: &str, others: &str) -> RequestError {
    let whole = item.whole_key();
    let key = match &item.material {
        None if item.key == MATERIALS.name => "NAME.LAYER.KEY",
        Some(_) if item.key.is_empty() => "LAYER.KEY",
        _ => "KEY",
    };
    let how = match &item.given {
        Given::Json(_) => String::new(),
        Given::Text(_) => format!(" as JSON, such as {{\"KEY\": VALUE}} (one key alone is {whole}.{key}=VALUE)"),
    };
    RequestError::new(RequestFault::WrongType, &whole, item.given.show(), format!("{allowed}{how}, {others}"))
}

fn unknown(key: &str, given: &Given) -> RequestError {
    if key == mesh_reference::KEY {
        return RequestError::new(RequestFault::UnknownKey, key, given.show(), mesh_reference::ELSEWHERE);
    }
    let mut known = keys();
    known.retain(|&known| known != mesh_reference::KEY);
    if let Given::Json(_) = given {
        known.insert(0, SCHEMA);
    }
    RequestError::new(RequestFault::UnknownKey, key, given.show(), suggest::allowed(key, &known))
}

fn unknown_of_material(item: &Item) -> RequestError {
    let layers: Vec<&str> = LAYERS.iter().filter(|l| Layer::is_for_materials(l)).map(|l| l.name).collect();
    let of_layers = FIELDS.iter().filter(|f| f.is_for_materials()).map(|f| f.key).chain(layers.iter().copied());
    let known: Vec<&str> = of_layers.collect();
    let has_layer = item.key.split_once('.').is_some_and(|(layer, _)| layers.contains(&layer));
    let allowed = if has_layer {
        suggest::allowed(&item.key, &known)
    } else {
        let near = suggest::nearest(&item.key, &known);
        let near = if near.is_empty() { String::new() } else { format!(" (did you mean {}?)", near.join(" or ")) };
        format!("a material has the layers {} and their keys{near}", layers.join(", "))
    };
    RequestError::new(RequestFault::UnknownKey, &item.whole_key(), item.given.show(), allowed)
}
