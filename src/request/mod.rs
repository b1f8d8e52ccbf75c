//! The request document: JSON and dotted keys to a [`Spec`].
//!
//! Defaults, then the style's preset, then the document, then the dotted keys of a query or of `--set`: each overrides
//! what came before. [`fields`] is the table of keys; a new key is a line there.

mod draft;
mod error;
mod fields;
mod json;
mod suggest;
#[cfg(test)]
mod tests;
mod value;
mod words;

pub use error::{RequestError, RequestFault};
pub use words::{Style, Words, word_for, words_of};

use crate::image::ImageFormat;
use crate::limits::{BackendChoice, IMAGE_PX_MAX, Limits};
use crate::scene::Spec;
use crate::scene::color::Rgba;
use draft::Draft;
use fields::{FIELDS, GROUPS, LATER, LAYERS, SHORT};
use value::{Given, Kind, Value};

/// The style of a request that names none.
const STYLE_DEFAULT: Style = Style::Flat;

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
    let mut pairs = match document {
        Some(bytes) => json::flatten(bytes, rules.limits.json_depth)?,
        None => Vec::new(),
    };
    pairs.extend(overrides.iter().map(|(key, text)| (key.clone(), Given::Text(text.clone()))));

    let mut style = STYLE_DEFAULT;
    for (_, given) in pairs.iter().filter(|(key, _)| key == "style") {
        style = read_style(given)?;
    }
    let mut draft = Draft::new(style, rules.backend);
    // A picture whose size nobody gave must not be larger than one that somebody could ask for.
    let side_max = u32::try_from(rules.limits.image_px).unwrap_or(u32::MAX);
    let image = &mut draft.spec.image;
    (image.width_px, image.height_px) = (image.width_px.min(side_max), image.height_px.min(side_max));
    for (key, given) in pairs.iter().filter(|(key, _)| key != "style") {
        apply(&mut draft, key, given, rules)?;
    }
    draft.finish()
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
    keys.extend(LAYERS.iter().map(|&(key, _)| key));
    keys.extend(SHORT.iter().map(|&(key, _)| key));
    keys.push("style");
    keys.sort_unstable();
    keys
}

fn read_style(given: &Given) -> Result<Style, RequestError> {
    let kind = Kind::Words { now: words_of::<Style>(), later: Style::LATER };
    match kind.read("style", given, 0)? {
        Value::Word(place) => Ok(Style::NOW[place].1),
        _ => Ok(STYLE_DEFAULT),
    }
}

fn apply(draft: &mut Draft, key: &str, given: &Given, rules: &Rules) -> Result<(), RequestError> {
    if let Some((_, turn)) = LAYERS.iter().find(|&&(layer, _)| layer == key) {
        if given.is_null() || given.is_empty_object() {
            turn(draft, !given.is_null());
            return Ok(());
        }
        let allowed = "an object with the layer's keys, {} for its defaults, or null to turn the layer off";
        return Err(RequestError::new(RequestFault::WrongType, key, given.show(), allowed));
    }
    if GROUPS.contains(&key) {
        if given.is_empty_object() {
            return Ok(());
        }
        return Err(RequestError::new(RequestFault::WrongType, key, given.show(), "an object"));
    }
    let long = SHORT.iter().find(|&&(short, _)| short == key).map_or(key, |&(_, long)| long);
    let Some(field) = FIELDS.iter().find(|f| f.key == long) else {
        return Err(unknown(key, given));
    };
    if field.nullable && given.is_null() {
        field.set(draft, Value::Null);
        return Ok(());
    }
    let value = field.kind.read(key, given, rules.limits.image_px).map_err(|mut error| {
        let is_image_limit = matches!(field.kind, Kind::Pixels | Kind::Size);
        if is_image_limit && error.fault == RequestFault::OutOfRange && rules.limits.image_px < IMAGE_PX_MAX {
            error.flag = Some("--limit-image-px");
        }
        error
    })?;
    field.set(draft, value);
    Ok(())
}

fn unknown(key: &str, given: &Given) -> RequestError {
    let later = LATER.contains(&key) || LATER.iter().any(|l| key.strip_prefix(l).is_some_and(|r| r.starts_with('.')));
    if later {
        return RequestError::new(RequestFault::NotYet, key, given.show(), "leave it out");
    }
    RequestError::new(RequestFault::UnknownKey, key, given.show(), suggest::allowed(key, &keys()))
}
