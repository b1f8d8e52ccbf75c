//! Errors of requests. Each is one sentence for the client. Most name the key, the given value and the
//! allowed ones.

use std::fmt;

/// A fault of a request. The sentence is meant for the client and safe to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestError {
    /// The kind of fault.
    pub fault: RequestFault,
    /// The dotted key, such as `wire.color`; `request` for the document as a whole.
    pub key: String,
    /// The given value, shortened.
    pub given: String,
    /// The allowed values, or other advice.
    pub allowed: String,
    /// The flag of `serve` that raises the limit, if there is one.
    pub flag: Option<&'static str>,
}

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RequestFault {
    /// There is no such key.
    UnknownKey,
    /// The type is right, the value is not allowed.
    OutOfRange,
    /// The type is wrong: a string for a number, an object for a colour.
    WrongType,
    /// The document is not JSON, too deep, or too long.
    NotJson,
    /// Two keys contradict each other, or one is given twice.
    Conflict,
    /// A required key is missing.
    Missing,
}

impl RequestFault {
    /// The stable code of the fault, in snake case.
    pub fn code(self) -> &'static str {
        match self {
            Self::UnknownKey => "unknown_key",
            Self::OutOfRange => "out_of_range",
            Self::WrongType => "wrong_type",
            Self::NotJson => "not_json",
            Self::Conflict => "conflicting_keys",
            Self::Missing => "missing_key",
        }
    }
}

impl RequestError {
    /// Makes an error; `key` and `given` are shortened here.
    pub fn new(fault: RequestFault, key: &str, given: impl fmt::Display, allowed: impl Into<String>) -> Self {
        let given = shorten(&given.to_string());
        Self { fault, key: shorten_key(key), given, allowed: allowed.into(), flag: None }
    }
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, given, allowed, .. } = self;
        match self.fault {
            RequestFault::UnknownKey => write!(f, "there is no key `{key}` (given {given}); {allowed}"),
            RequestFault::OutOfRange | RequestFault::WrongType => {
                write!(f, "`{key}` is {given}, and allowed is {allowed}")
            }
            RequestFault::NotJson if allowed.is_empty() => write!(f, "the request document is {given}"),
            RequestFault::NotJson => write!(f, "the request document is {given}, and allowed is {allowed}"),
            RequestFault::Conflict => write!(f, "`{key}` is {given}, and {allowed}"),
            RequestFault::Missing => write!(f, "`{key}` is missing: {allowed}"),
        }?;
        match self.flag {
            Some(flag) => write!(f, " (raise it with {flag})"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for RequestError {}

/// Shortens a key in the middle: a material's name may be long, and its layer and key are at the
/// end.
pub fn shorten_key(key: &str) -> String {
    const CHARS_MAX: usize = 120;
    let count = key.chars().count();
    if count <= CHARS_MAX {
        return shorten_to(key, CHARS_MAX);
    }
    let end: String = key.chars().skip(count - CHARS_MAX / 2).collect();
    shorten_to(key, CHARS_MAX / 2) + &shorten_to(&end, CHARS_MAX / 2)
}

fn shorten(text: &str) -> String {
    shorten_to(text, 80)
}

/// Shortens a text and replaces control characters, so that answers stay short and printable.
fn shorten_to(text: &str, chars_max: usize) -> String {
    let mut short: String = text.chars().take(chars_max).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(chars_max).is_some() {
        short.push_str("...");
    }
    short
}
