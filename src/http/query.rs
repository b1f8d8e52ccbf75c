//! What a query says: how the mesh is read, and the dotted keys of the request document.

use axum::extract;
use axum::http::{StatusCode, Uri};

use super::error::ApiError;
use crate::mesh::Format;
use crate::request::Overrides;
use crate::store::Reading;

/// A query.
pub struct Query {
    /// `format_in` and `entry`.
    pub reading: Reading,
    /// The dotted keys of the request document.
    pub overrides: Box<Overrides>,
}

impl Query {
    /// Reads a query. The dotted keys are still as they were given.
    pub fn read(uri: &Uri) -> Result<Self, ApiError> {
        let bad = |code, detail: String| ApiError::new(StatusCode::BAD_REQUEST, code, detail);
        let extract::Query(mut pairs) = extract::Query::<Vec<(String, String)>>::try_from_uri(uri)
            .map_err(|e| bad("bad_query", format!("the query cannot be read: {}", e.body_text())))?;
        let mut format_in = None;
        for (_, name) in pairs.iter().filter(|(key, _)| key == "format_in") {
            let format = Format::from_name(name).ok_or_else(|| {
                let allowed = Format::NAMES.join(", ");
                bad("out_of_range", format!("`format_in` is {}, and allowed is one of {allowed}", short(name)))
            })?;
            format_in = Some(format);
        }
        let entry = pairs.iter().rfind(|(key, _)| key == "entry").map(|(_, name)| name.clone());
        pairs.retain(|(key, _)| key != "format_in" && key != "entry");
        Ok(Self { reading: Reading { format_in, entry }, overrides: pairs.into() })
    }

    /// Reads a query where nothing is drawn.
    pub fn reading(uri: &Uri) -> Result<Reading, ApiError> {
        let Self { reading, overrides } = Self::read(uri)?;
        match overrides.first() {
            None => Ok(reading),
            Some((key, _)) => {
                let detail = format!(
                    "nothing is drawn here, so there is no key {}; allowed are `format_in` and `entry`",
                    short(key)
                );
                Err(ApiError::new(StatusCode::BAD_REQUEST, "unknown_key", detail))
            }
        }
    }
}

fn short(text: &str) -> String {
    format!("{:?}", text.chars().take(40).collect::<String>())
}
