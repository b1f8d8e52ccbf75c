//! What is wrong with a request document: always one sentence that names the key, what was given and what is allowed.

use std::fmt;

/// A request that cannot be understood. It is the client's fault, and the text is safe to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestError {
    /// What kind of fault.
    pub fault: RequestFault,
    /// The dotted key, such as `wire.color`; `request` for the document as a whole.
    pub key: String,
    /// What was given, shortened.
    pub given: String,
    /// What would have been understood.
    pub allowed: String,
    /// The flag of `serve` that allows more, where one does.
    pub flag: Option<&'static str>,
}

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestFault {
    /// No such key.
    UnknownKey,
    /// Right type, wrong value.
    OutOfRange,
    /// A string for a number, an object for a colour ...
    WrongType,
    /// The document is not JSON, or too deep or too long to look at.
    NotJson,
    /// Two keys that contradict each other.
    Conflict,
    /// A key that has to be there is not.
    Missing,
}

impl RequestFault {
    /// Stable, snake case.
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
    /// An error of the given kind; `given` is shortened here.
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

/// A material's name may be long, and what is asked of it stands at the key's end: what is left out is in the middle.
fn shorten_key(key: &str) -> String {
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

/// Keeps an answer short and printable, whatever was sent.
fn shorten_to(text: &str, chars_max: usize) -> String {
    let mut short: String = text.chars().take(chars_max).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(chars_max).is_some() {
        short.push_str("...");
    }
    short
}
