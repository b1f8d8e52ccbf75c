//! What a query says: how the mesh is read, and the dotted keys of the request document.

use axum::extract;
use axum::http::{StatusCode, Uri};

use crate::import::Format;
use crate::request::{self, Overrides, RequestError, RequestFault, Rules};
use crate::service::http::error::ApiError;
use crate::service::store::Reading;

/// A query.
pub struct Query {
    /// `format_in` and `entry`.
    pub reading: Reading,
    /// The dotted keys of the request document.
    pub overrides: Box<Overrides>,
}

impl Query {
    /// Reads a query, which says everything once. The dotted keys are still as they were given.
    pub fn read(uri: &Uri, rules: &Rules) -> Result<Self, ApiError> {
        let extract::Query(mut pairs) = extract::Query::<Vec<(String, String)>>::try_from_uri(uri)
            .map_err(|e| bad("bad_query", format!("the query cannot be read: {}", e.body_text())))?;
        let format_in = take(&mut pairs, "format_in")?;
        let format_in = format_in.map(|name| {
            Format::from_name(&name).ok_or_else(|| {
                let allowed = Format::names().join(", ");
                bad("out_of_range", format!("`format_in` is {}, and allowed is one of {allowed}", short(&name)))
            })
        });
        let reading = Reading { format_in: format_in.transpose()?, entry: take(&mut pairs, "entry")? };
        request::check_once(&pairs, rules)?;
        Ok(Self { reading, overrides: pairs.into() })
    }

    /// Reads a query that asks what is in a mesh: how it is read, and at which moment of its animation.
    pub fn moment(uri: &Uri, rules: &Rules) -> Result<(Reading, Option<f64>), ApiError> {
        let Self { reading, overrides } = Self::read(uri, rules)?;
        Ok((reading, request::read_moment(&overrides, rules).map_err(told)?))
    }

    /// Reads a query where nothing is drawn.
    pub fn reading(uri: &Uri, rules: &Rules) -> Result<Reading, ApiError> {
        let Self { reading, overrides } = Self::read(uri, rules)?;
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

/// A part of a query, with what means something there percent-encoded (RFC 3986, 3.4).
pub fn escape(text: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~,:/".contains(&byte);
    text.bytes().map(|byte| if plain(byte) { char::from(byte).into() } else { format!("%{byte:02X}") }).collect()
}

/// What a query is told about a key that there is not: the request module knows of the document's keys alone.
pub fn told(mut error: RequestError) -> ApiError {
    if error.fault == RequestFault::UnknownKey && !error.key.contains('.') {
        error.allowed.push_str("; of the mesh, a query says `format_in` and `entry`");
    }
    error.into()
}

/// The value of a key that is about the mesh and not about the picture.
fn take(pairs: &mut Vec<(String, String)>, key: &str) -> Result<Option<String>, ApiError> {
    let mut values: Vec<String> = pairs.extract_if(.., |(name, _)| name == key).map(|(_, value)| value).collect();
    if values.len() > 1 {
        return Err(bad("conflicting_keys", format!("`{key}` is given twice, and each key is given once")));
    }
    Ok(values.pop())
}

fn bad(code: &'static str, detail: String) -> ApiError {
    ApiError::new(StatusCode::BAD_REQUEST, code, detail)
}

fn short(text: &str) -> String {
    format!("{:?}", text.chars().take(40).collect::<String>())
}
