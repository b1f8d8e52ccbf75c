//! The JSON Schema (draft 2020-12) of request documents, written from the table of keys.
//!
//! It states what the reader checks, with these exceptions: the length and the depth of the document; a
//! key is not given twice, nor a short name and its key; the places where a document may name its mesh;
//! `eye` and `target` differ; a sheet has views or a turntable, not both, it excludes some keys of the
//! camera, and its cells and frames have limits of size; `uv-layout` is not for materials alone; the
//! hulls of several materials share a unit, and their barycentric wires share `hidden`; the number of
//! line styles; limits of a key that depend on the style or, for a material, on keys of the document.

use serde_json::{Map, Value as Json, json};

use super::table::{FIELDS, MATERIALS, SCHEMA, SECTIONS, STYLE_ABOUT};
use super::{MATERIAL_NAME_CHARS_MAX, MATERIALS_MAX, Rules, STYLE_DEFAULT};
use crate::request::document::mesh_reference as mesh;
use crate::request::layers_draft::{MULTIPLE_MAX, OUTLINE_PX_MAX};
use crate::request::style::Style;
use crate::request::table::field::{Field, Section};
use crate::request::table::value::{COORDINATE_MAX, Kind};
use crate::spec::words::{word_for, words_of};

/// The schema of documents that [`super::read`] understands under these rules.
pub fn schema(rules: &Rules) -> Json {
    let image_px = rules.limits.image_px;
    let mut definitions = Map::new();
    let mut properties = Map::new();
    let style = json!({
        "description": STYLE_ABOUT, "enum": words_of::<Style>(), "default": word_for(STYLE_DEFAULT),
    });
    properties.insert("style".into(), or_null(style));
    for section in SECTIONS {
        let mut object = object(section, image_px);
        // Materials refer to layers.
        if section.turn.is_some() {
            definitions.insert(section.name.into(), object);
            object = reference(section.name);
        }
        properties.insert(section.name.into(), object);
    }
    properties.insert(MATERIALS.name.into(), materials());
    for field in FIELDS.iter() {
        let mut property = property(field, image_px);
        if !field.key.contains('.') {
            properties.insert(field.key.into(), property);
        } else if let Some(short) = field.short {
            property["description"] = format!("Short for {}.", field.key).into();
            properties.insert(short.into(), property);
        }
    }
    let digest = json!({ "description": mesh::ABOUT, "type": "string", "pattern": "^[0-9a-f]{64}$" });
    properties.insert(mesh::KEY.into(), digest);
    let own = json!({ "description": "Address of this schema, for editors.", "type": ["string", "null"] });
    properties.insert(SCHEMA.into(), own);
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "meshsnap request",
        "description": "How to turn a mesh into an image. A layer that is present is drawn, null turns it off; any other key \
                        that is null counts as absent, unless its description says otherwise. Dotted keys of a query \
                        (wire.color) and short names override the document.",
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
        "$defs": definitions,
    })
}

fn reference(name: &str) -> Json {
    json!({ "$ref": format!("#/$defs/{name}") })
}

fn materials() -> Json {
    let layers = SECTIONS.iter().filter(|section| section.is_for_materials);
    let layers: Map<String, Json> = layers.map(|layer| (layer.name.to_owned(), reference(layer.name))).collect();
    json!({
        "description": MATERIALS.about,
        "type": ["object", "null"],
        "maxProperties": MATERIALS_MAX,
        "propertyNames": { "maxLength": MATERIAL_NAME_CHARS_MAX },
        "additionalProperties": { "type": ["object", "null"], "properties": layers, "additionalProperties": false },
    })
}

/// A section with its keys, and the conditions between them.
fn object(section: &Section, image_px: u64) -> Json {
    let fields = FIELDS.iter().filter_map(|field| Some((field.key.split_once('.')?, field)));
    let fields = fields.filter(|((home, _), _)| *home == section.name);
    let properties: Map<String, Json> =
        fields.map(|((_, key), field)| (key.to_owned(), property(field, image_px))).collect();
    let mut schema = json!({
        "description": section.about,
        "type": ["object", "null"],
        "properties": properties,
        "additionalProperties": false,
    });
    let given = |key: &str, is: Json| json!({ "properties": { key: is }, "required": [key] });
    let rule = match section.name {
        "wire" => {
            let thin = json!({ "properties": { "thickness": { "maximum": MULTIPLE_MAX } } });
            Some((given("method", json!({ "not": { "enum": ["exact", null] } })), thin))
        }
        "outline" => {
            let thin = json!({ "properties": { "thickness": { "maximum": OUTLINE_PX_MAX } } });
            Some((given("unit", json!({ "const": "px" })), thin))
        }
        "camera" => {
            let point = |key| given(key, json!({ "type": "array" }));
            let no_file = json!({ "properties": { "from_file": { "enum": [false, null] } } });
            let all = json!({ "allOf": [point("eye"), point("target"), no_file] });
            Some((json!({ "anyOf": [point("eye"), point("target")] }), all))
        }
        _ => None,
    };
    if let Some((condition, consequence)) = rule {
        schema["if"] = condition;
        schema["then"] = consequence;
    }
    schema
}

/// The schema of a key's values.
pub(super) fn property(field: &Field, image_px: u64) -> Json {
    let mut schema = or_null(of_kind(&field.kind, image_px));
    schema["description"] = field.about.as_str().into();
    if let Some(default) = &field.default {
        schema["default"] = default.clone();
    }
    schema
}

/// The schema of a value that may also be null.
pub(super) fn or_null(mut schema: Json) -> Json {
    if let Some(Json::Array(words)) = schema.get_mut("enum") {
        words.push(Json::Null);
    }
    if let Some(Json::Array(choices)) = schema.get_mut("anyOf") {
        choices.push(json!({ "type": "null" }));
    }
    if let Some(of_type) = schema.get_mut("type") {
        *of_type = json!([of_type.take(), "null"]);
    }
    schema
}

fn color_pattern() -> String {
    let hex = "[0-9a-fA-F]";
    format!("(transparent|#?({hex}{{3,4}}|{hex}{{6}}|{hex}{{8}}))")
}

/// The whole numbers from 1 to `max`, which is not 0, as a pattern.
fn up_to(max: u64) -> String {
    let digits = max.to_string();
    let mut alternatives = Vec::new();
    if let Some(fewer) = digits.len().checked_sub(2) {
        alternatives.push(format!("[1-9][0-9]{{0,{fewer}}}"));
    }
    for (place, digit) in digits.bytes().enumerate() {
        let (before, after) = (&digits[..place], digits.len() - 1 - place);
        let lowest = if place == 0 { b'1' } else { b'0' };
        if digit > lowest {
            alternatives.push(format!("{before}[{}-{}][0-9]{{{after}}}", lowest as char, (digit - 1) as char));
        }
    }
    alternatives.push(digits);
    format!("({})", alternatives.join("|"))
}

fn of_kind(kind: &Kind, image_px: u64) -> Json {
    let whole = || json!({ "type": "integer", "minimum": 1, "maximum": image_px });
    let coordinates = || {
        let coordinate = json!({ "type": "number", "minimum": -COORDINATE_MAX, "maximum": COORDINATE_MAX });
        json!({ "type": "array", "items": coordinate, "minItems": 3, "maxItems": 3 })
    };
    match kind {
        Kind::Number { min, max } => json!({ "type": "number", "minimum": min, "maximum": max }),
        Kind::NumberOr { word, min, max } => {
            json!({ "anyOf": [{ "type": "number", "minimum": min, "maximum": max }, { "type": "string", "const": word }] })
        }
        Kind::Above0 { max } => json!({ "type": "number", "exclusiveMinimum": 0, "maximum": max }),
        Kind::OneOf(values) => json!({ "enum": values }),
        Kind::OneOfOr { word, values } => {
            json!({ "anyOf": [{ "type": "string", "const": word }, { "type": "integer", "enum": values }] })
        }
        Kind::Pixels => whole(),
        Kind::Size => {
            let side = up_to(image_px);
            json!({ "anyOf": [whole(), { "type": "string", "pattern": format!("^{side}([xX]{side})?$") }] })
        }
        Kind::Words(words) => json!({ "enum": words }),
        Kind::WordList { words, count_max } => {
            json!({ "type": "array", "items": { "type": "string", "enum": words }, "minItems": 1, "maxItems": count_max })
        }
        Kind::Count { min, max } => json!({ "type": "integer", "minimum": min, "maximum": max }),
        Kind::Color => json!({ "type": "string", "pattern": format!("^{}$", color_pattern()) }),
        Kind::Background => {
            json!({ "type": "string", "pattern": format!("^{0}(\\.\\.{0})?$", color_pattern()) })
        }
        Kind::Point => coordinates(),
        Kind::Direction => {
            let mut schema = coordinates();
            // Without the type, this would also exclude null.
            schema["not"] = json!({ "type": "array", "items": { "const": 0 } });
            schema
        }
        Kind::Flag => json!({ "type": "boolean" }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_counts() {
        let mut numbers = 0;
        for max in [1, 9, 10, 64, 100, 640, 999, 4096, 16384] {
            let pattern = jsonschema::draft202012::new(&json!({ "pattern": format!("^{}$", up_to(max)) })).unwrap();
            for number in 0..=20_000_u64 {
                let expected = (1..=max).contains(&number);
                assert_eq!(pattern.is_valid(&number.to_string().into()), expected, "{number} up to {max}");
                numbers += 1;
            }
        }
        assert_eq!(numbers, 9 * 20_001);
    }
}
