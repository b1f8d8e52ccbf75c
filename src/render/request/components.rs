//! The schema of request documents, divided into named components of an OpenAPI document. Tools
//! that generate clients take the names of their types from these components. There is one for each
//! section of a document (such as `camera`), one for a material, one for the whole document, one
//! for a document that names its mesh, and one for the keys of a query.

use serde_json::{Map, Value as Json, json};

use super::Rules;
use super::schema::{or_null, property, schema};
use super::table::field::Field;
use super::table::value::Kind;
use super::table::{FIELDS, MATERIALS, SECTIONS};
use crate::request::document::mesh_reference as mesh;

/// The place of components in an OpenAPI document.
const PLACE: &str = "#/components/schemas/";

/// The beginning of all names.
pub const PREFIX: &str = "Request";

/// The layers of one material.
const MATERIAL: &str = "material";

/// Components by name: `Request`, `RequestOfMesh`, `RequestKeys`, and one for each section. They refer to each other
/// alone.
pub fn components(rules: &Rules) -> Map<String, Json> {
    let mut whole = schema(rules);
    let mut made = Map::new();
    for section in SECTIONS.iter().chain([&MATERIALS]) {
        let inline = whole["properties"][section.name].take();
        // The layers are definitions already.
        let mut object = if section.turn.is_some() { whole["$defs"][section.name].take() } else { inline };
        if section.name == MATERIALS.name {
            let mut one = object["additionalProperties"].take();
            one["type"] = json!("object");
            made.insert(component(MATERIAL), one);
            object["additionalProperties"] = json!({ "$ref": format!("#/$defs/{MATERIAL}") });
        }
        // The places that refer to it allow null.
        object["type"] = json!("object");
        made.insert(component(section.name), object);
        whole["properties"][section.name] = json!({ "$ref": format!("#/$defs/{}", section.name) });
    }
    if let Json::Object(whole) = &mut whole {
        for of_a_file in ["$schema", "$defs", "title"] {
            whole.remove(of_a_file);
        }
    }
    let mut of_mesh = whole.clone();
    of_mesh["required"] = json!([mesh::KEY]);
    if let Json::Object(properties) = &mut whole["properties"] {
        properties.remove(mesh::KEY);
    }
    made.insert(PREFIX.into(), whole);
    made.insert(format!("{PREFIX}OfMesh"), of_mesh);
    made.insert(format!("{PREFIX}Keys"), keys(rules));
    made.values_mut().for_each(refer_to_components);
    made
}

/// The name of a section's component.
fn component(section: &str) -> String {
    let mut letters = section.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    format!("{PREFIX}{}{}", first.map(String::from).unwrap_or_default(), letters.as_str())
}

/// Makes references to definitions of a schema refer to components, or allow null.
fn refer_to_components(schema: &mut Json) {
    if let Some(name) = schema["$ref"].as_str().and_then(|place| place.strip_prefix("#/$defs/")) {
        let place = format!("{PLACE}{}", component(name));
        *schema = json!({ "anyOf": [{ "$ref": place }, { "type": "null" }] });
        return;
    }
    match schema {
        Json::Object(object) => object.values_mut().for_each(refer_to_components),
        Json::Array(list) => list.iter_mut().for_each(refer_to_components),
        _ => {}
    }
}

/// The keys of a query: those of the document, dotted, with values that a query can express.
fn keys(rules: &Rules) -> Json {
    let image_px = rules.limits.image_px;
    let mut properties = Map::new();
    let mut of_materials = Map::new();
    properties.insert("style".into(), schema(rules)["properties"]["style"].take());
    let of_any_material = |key: &str| format!("^{}\\..+\\.{}$", MATERIALS.name, key.replace('.', "\\."));
    for section in SECTIONS {
        let switch = json!({
            "description": format!("{} `{{}}`: with its defaults. A query may also write the object as JSON.", section.about),
            "type": "string",
            "enum": ["{}", "null"],
        });
        if section.is_for_materials {
            of_materials.insert(of_any_material(section.name), switch.clone());
        }
        properties.insert(section.name.into(), switch);
    }
    for field in FIELDS.iter() {
        let property = in_query(field, image_px);
        if field.is_for_materials() {
            of_materials.insert(of_any_material(field.key), property.clone());
        }
        if let Some(short) = field.short {
            let mut property = property.clone();
            property["description"] = format!("Short for {}.", field.key).into();
            properties.insert(short.into(), property);
        }
        properties.insert(field.key.into(), property);
    }
    json!({
        "description": format!(
            "The keys of the request document, dotted, and its short names. They override a document, and none may be given \
             twice, under a short name either. Keys of a material are `{}.NAME.KEY`.", MATERIALS.name
        ),
        "type": "object",
        "properties": properties,
        "patternProperties": of_materials,
        "additionalProperties": false,
    })
}

/// A key's values as the text of a query.
fn in_query(field: &Field, image_px: u64) -> Json {
    const NUMBER: &str = "-?[0-9]{1,30}(\\.[0-9]{1,30})?";
    let text = |pattern: String| or_null(json!({ "type": "string", "pattern": pattern }));
    let mut schema = match &field.kind {
        Kind::Flag => or_null(json!({
            "anyOf": [{ "type": "boolean" }, { "type": "integer", "minimum": 0, "maximum": 1 }],
        })),
        Kind::WordList { words, count_max } => {
            let word = format!("({})", words.join("|"));
            text(format!("^{word}(,{word}){{0,{}}}$", count_max.saturating_sub(1)))
        }
        Kind::Point => text(format!("^{NUMBER},{NUMBER},{NUMBER}$")),
        Kind::Direction => text(format!("^(?![-0.,]*$){NUMBER},{NUMBER},{NUMBER}$")),
        _ => {
            let mut schema = property(field, image_px);
            if let Json::Object(schema) = &mut schema {
                schema.remove("default");
            }
            schema
        }
    };
    schema["description"] = field.about.as_str().into();
    schema
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::table::SCHEMA;
    use crate::request::tests::rules;

    #[test]
    fn components_refer_to_each_other_alone() {
        let made = components(&rules());
        let names: Vec<&str> = made.keys().map(String::as_str).collect();
        assert_eq!(names.len(), 15, "{names:?}");
        assert!(names.iter().all(|name| name.starts_with(PREFIX)), "{names:?}");
        let text = Json::Object(made.clone()).to_string();
        let references: Vec<&str> =
            text.split("\"$ref\":\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
        for reference in &references {
            let name = reference.strip_prefix(PLACE).unwrap_or_else(|| panic!("{reference}"));
            assert!(made.contains_key(name), "{reference}");
        }
        assert_eq!(references.len(), 26);
        assert!(
            made[PREFIX]["properties"][mesh::KEY].is_null()
                && !made["RequestOfMesh"]["properties"][mesh::KEY].is_null()
        );
        assert!(made[PREFIX]["properties"][SCHEMA].is_object());
    }
}
