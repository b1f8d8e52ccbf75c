//! The query of a request: how the mesh is read (`format_in`, `entry`), and keys of the request document in dotted
//! form (`camera.azimuth_deg=30`). `keys.rs` reads the other keys of a check or a comparison.

use axum::extract;
use axum::http::Uri;

use crate::http::error::{ApiError, ErrorKind};
use crate::store::Reading;
use meshsnap_render::import::Format;
use meshsnap_render::request::{self, Overrides, RequestError, RequestFault, Rules};

/// A query.
pub struct Query {
    /// The keys about reading the mesh: `format_in` and `entry`.
    pub reading: Reading,
    /// The dotted keys of the request document.
    pub overrides: Box<Overrides>,
}

impl Query {
    /// Reads a query and refuses keys that are given twice. The values of dotted keys stay text.
    pub fn read(uri: &Uri, rules: &Rules) -> Result<Self, ApiError> {
        let (reading, pairs) = pairs(uri)?;
        request::check_once(&pairs, rules)?;
        Ok(Self { reading, overrides: pairs.into() })
    }

    /// Reads the query of a report on a mesh: how the mesh is read, and the time in seconds within
    /// its animation.
    pub fn read_for_report(uri: &Uri, rules: &Rules) -> Result<(Reading, Option<f64>), ApiError> {
        let Self { reading, overrides } = Self::read(uri, rules)?;
        Ok((reading, request::read_moment(&overrides, rules).map_err(query_error)?))
    }

    /// Reads the query of an upload, where nothing is drawn.
    pub fn read_for_upload(uri: &Uri, rules: &Rules) -> Result<Reading, ApiError> {
        let Self { reading, overrides } = Self::read(uri, rules)?;
        match overrides.first() {
            None => Ok(reading),
            Some((key, _)) => {
                let detail = format!(
                    "nothing is drawn here, so there is no key {}; allowed are `format_in` and `entry`",
                    quote(key)
                );
                Err(bad("unknown_key", detail))
            }
        }
    }
}

/// The keys about reading the mesh, and the other pairs of a query.
pub fn pairs(uri: &Uri) -> Result<(Reading, Vec<(String, String)>), ApiError> {
    let extract::Query(mut pairs) = extract::Query::<Vec<(String, String)>>::try_from_uri(uri)
        .map_err(|e| bad("bad_query", format!("the query cannot be read: {}", e.body_text())))?;
    let format_in = take(&mut pairs, "format_in")?;
    let format_in = format_in.map(|name| {
        Format::from_name(&name).ok_or_else(|| {
            let allowed = Format::names().join(", ");
            bad("out_of_range", format!("`format_in` is {}, and allowed is one of {allowed}", quote(&name)))
        })
    });
    Ok((Reading { format_in: format_in.transpose()?, entry: take(&mut pairs, "entry")? }, pairs))
}

/// The error of a dotted key. For an unknown key it adds the keys that only a query has, because
/// the request module does not know them.
pub fn query_error(mut error: RequestError) -> ApiError {
    if error.fault == RequestFault::UnknownKey && !error.key.contains('.') {
        error.allowed.push_str("; of the mesh, a query says `format_in` and `entry`");
    }
    error.into()
}

/// Removes a key that concerns the mesh and not the picture, and returns its value.
fn take(pairs: &mut Vec<(String, String)>, key: &str) -> Result<Option<String>, ApiError> {
    let mut values: Vec<String> = pairs.extract_if(.., |(name, _)| name == key).map(|(_, value)| value).collect();
    if values.len() > 1 {
        return Err(bad("conflicting_keys", format!("`{key}` is given twice, and each key is given once")));
    }
    Ok(values.pop())
}

/// The error of a request that is malformed.
pub fn bad(code: &'static str, detail: String) -> ApiError {
    ApiError::new(ErrorKind::BadRequest, code, detail)
}

/// The beginning of a client's text, in quotes.
pub fn quote(text: &str) -> String {
    format!("{:?}", text.chars().take(40).collect::<String>())
}
