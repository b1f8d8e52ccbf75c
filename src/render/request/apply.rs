//! The reading of one item of a request, which is a key and its value. The value is checked and put
//! into the draft, which collects what all items say. If the key is unknown or the value wrong, the
//! result is an error whose sentence says what is allowed.

use crate::limits::IMAGE_PX_MAX;
use crate::request::Rules;
use crate::request::document::item::Item;
use crate::request::document::mesh_reference;
use crate::request::draft::Draft;
use crate::request::error::{RequestError, RequestFault, shorten_key};
use crate::request::suggest;
use crate::request::table::value::{Given, Kind, Value};
use crate::request::table::{self, FIELDS, MATERIALS, SCHEMA, SECTIONS};

/// Puts the value of an item into a draft: the document's, or that of the material which the item
/// is about.
pub fn apply(draft: &mut Draft, item: &Item, rules: &Rules) -> Result<(), RequestError> {
    let (key, given) = (item.key.as_str(), &item.given);
    let of_material = item.material.is_some();
    let is_void = given.is_null() || given.is_empty_object();
    let section = table::section(key).filter(|section| !of_material || section.is_for_materials);
    let object = match section {
        Some(section) if section.turn.is_some() => Some("an object with the layer's keys"),
        Some(_) => Some("an object"),
        None if of_material && key.is_empty() => Some("an object with the layers surface, wire and outline"),
        None if !of_material && key == MATERIALS.name => Some("an object of materials by their names"),
        None => None,
    };
    if let Some(expected) = object {
        let turn = section.and_then(|section| section.turn);
        return match turn {
            Some(turn) if is_void => {
                turn(draft, !given.is_null());
                Ok(())
            }
            Some(_) => Err(no_object(item, expected, "{} for its defaults, or null to turn the layer off")),
            None if is_void => Ok(()),
            None => Err(no_object(item, expected, "or null")),
        };
    }
    let Some(field) = table::field(key, of_material) else {
        return Err(if of_material { unknown_of_material(item) } else { unknown(key, given) });
    };
    if given.is_null() {
        match field.section().and_then(|section| section.turn) {
            _ if field.nullable => (field.set)(draft, Value::Null),
            // As in an object without the key.
            Some(turn) => turn(draft, true),
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
    (field.set)(draft, value);
    Ok(())
}

/// Every key, sorted, for lists and suggestions.
pub fn keys() -> Vec<&'static str> {
    let mut keys: Vec<_> = FIELDS.iter().flat_map(|field| [Some(field.key), field.short]).flatten().collect();
    keys.extend(SECTIONS.iter().map(|section| section.name));
    keys.extend([MATERIALS.name, mesh_reference::KEY, "style"]);
    keys.sort_unstable();
    keys
}

/// The error for another value where an object is expected. In a query or a flag, it says how to
/// give one key alone.
fn no_object(item: &Item, expected: &str, others: &str) -> RequestError {
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
    RequestError::new(RequestFault::WrongType, &whole, item.given.show(), format!("{expected}{how}, {others}"))
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
    let layers: Vec<&str> = SECTIONS.iter().filter(|s| s.is_for_materials).map(|s| s.name).collect();
    let of_layers = FIELDS.iter().filter(|f| f.is_for_materials()).map(|f| f.key);
    let known: Vec<&str> = of_layers.chain(layers.iter().copied()).collect();
    let has_layer = item.key.split_once('.').is_some_and(|(layer, _)| layers.contains(&layer));
    let home = shorten_key(&format!("{}.{}.", MATERIALS.name, item.material.as_deref().unwrap_or_default()));
    let allowed = if has_layer {
        suggest::allowed_within(&home, &item.key, &known)
    } else {
        let near: Vec<String> = suggest::nearest(&item.key, &known).iter().map(|key| format!("{home}{key}")).collect();
        let near = if near.is_empty() { String::new() } else { format!(" (did you mean {}?)", near.join(" or ")) };
        format!("a material has the layers {} and their keys{near}", layers.join(", "))
    };
    RequestError::new(RequestFault::UnknownKey, &item.whole_key(), item.given.show(), allowed)
}
