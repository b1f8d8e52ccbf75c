//! The descriptions of the interface under the limits of this server: the JSON Schema of requests, and OpenAPI.

use serde_json::Value as Json;

use super::static_document::StaticDocument;
use meshsnap_render::request::{self, Rules};

/// The description of the interface under the default limits.
const STORED: &str = include_str!("../openapi.json");

/// The schema of request documents under these rules, as it is sent.
pub fn schema(rules: &Rules) -> StaticDocument {
    StaticDocument::new(format!("{:#}\n", request::schema(rules)), "application/schema+json")
}

/// The description of the interface under these rules, as it is sent.
pub fn openapi(rules: &Rules) -> StaticDocument {
    let made = described(rules).map_or_else(|_| STORED.to_owned(), |document| format!("{document:#}\n"));
    StaticDocument::new(made, "application/json")
}

/// The stored description, with the components of requests under these rules.
fn described(rules: &Rules) -> Result<Json, serde_json::Error> {
    let mut document: Json = serde_json::from_str(STORED)?;
    if let Some(Json::Object(schemas)) = document.pointer_mut("/components/schemas") {
        schemas.extend(request::components(rules));
    }
    Ok(document)
}
