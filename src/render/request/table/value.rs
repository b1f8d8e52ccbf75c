//! Values of a request, in three types: `Given` is a value as it was sent, as JSON or as text; `Kind`
//! says which values a key allows, and checks them; `Value` is a value that has passed the check.

use serde_json::Value as Json;

use crate::request::error::{RequestError, RequestFault};
use crate::request::suggest;
use crate::spec::color::Rgba;
use crate::spec::{BETWEEN, Background};

/// A value as it is given: JSON of a document, or the text of a query parameter or of `--set`.
#[derive(Clone, Debug)]
pub enum Given {
    /// A value of a document.
    Json(Json),
    /// The text of a query parameter or a flag, also for numbers and lists.
    Text(String),
}

impl Given {
    /// True for `null`.
    pub fn is_null(&self) -> bool {
        match self {
            Self::Json(json) => json.is_null(),
            Self::Text(text) => text == "null",
        }
    }

    /// True for an object without keys, which turns a layer on with its defaults.
    pub fn is_empty_object(&self) -> bool {
        match self {
            Self::Json(json) => json.as_object().is_some_and(serde_json::Map::is_empty),
            Self::Text(text) => text == "{}",
        }
    }

    /// The value, for error messages.
    pub fn show(&self) -> String {
        match self {
            Self::Json(json) => json.to_string(),
            Self::Text(text) => format!("\"{text}\""),
        }
    }

    fn text(&self) -> Option<&str> {
        match self {
            Self::Json(json) => json.as_str(),
            Self::Text(text) => Some(text),
        }
    }

    fn flag(&self) -> Option<bool> {
        match self {
            Self::Json(json) => json.as_bool(),
            Self::Text(text) => match text.as_str() {
                "true" | "1" => Some(true),
                "false" | "0" => Some(false),
                _ => None,
            },
        }
    }

    fn number(&self) -> Option<f64> {
        match self {
            Self::Json(json) => json.as_f64(),
            Self::Text(text) => text.trim().parse().ok(),
        }
    }

    fn point(&self) -> Option<[f64; 3]> {
        let numbers: Option<Vec<f64>> = match self {
            Self::Json(json) => json.as_array()?.iter().map(Json::as_f64).collect(),
            Self::Text(text) => {
                let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']')).unwrap_or(text);
                inner.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect()
            }
        };
        numbers?.try_into().ok()
    }
}

/// The values that a key allows. Error messages and the schema are made from it.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A finite number in a closed range.
    Number {
        /// The smallest, which is allowed.
        min: f64,
        /// The largest, which is allowed.
        max: f64,
    },
    /// A finite number in a closed range, or a word.
    NumberOr {
        /// The word.
        word: &'static str,
        /// The smallest, which is allowed.
        min: f64,
        /// The largest, which is allowed.
        max: f64,
    },
    /// A finite number above 0.
    Above0 {
        /// The largest, which is allowed.
        max: f64,
    },
    /// One of a few whole numbers.
    OneOf(&'static [u32]),
    /// One of a few whole numbers, or a word.
    OneOfOr {
        /// The word.
        word: &'static str,
        /// The numbers.
        values: &'static [u32],
    },
    /// A width or height: 1 to the limit in pixels.
    Pixels,
    /// `N` or `WxH`.
    Size,
    /// One of a few words.
    Words(Vec<&'static str>),
    /// A list of such words, at least one.
    WordList {
        /// The words.
        words: Vec<&'static str>,
        /// The largest number of them.
        count_max: usize,
    },
    /// A whole number in a closed range.
    Count {
        /// The smallest, which is allowed.
        min: u32,
        /// The largest, which is allowed.
        max: u32,
    },
    /// A colour.
    Color,
    /// A colour, or two with `..` between them.
    Background,
    /// Three finite numbers.
    Point,
    /// Three finite numbers, not all zero.
    Direction,
    /// True or false.
    Flag,
}

/// A value that passed its [`Kind`].
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `null`, for keys that allow it.
    Null,
    /// A number.
    Number(f64),
    /// Pixels, or one of a few whole numbers.
    Whole(u32),
    /// Width and height.
    Size(u32, u32),
    /// Index in the list of words; 0 for an only one.
    Word(usize),
    /// Indices in the list of words.
    WordList(Vec<usize>),
    /// A colour.
    Color(Rgba),
    /// A colour or a gradient.
    Background(Background),
    /// Three numbers.
    Point([f64; 3]),
    /// True or false.
    Flag(bool),
}

/// The notations for colours.
const COLOR_FORMS: &str = "a colour: #rgb, #rgba, #rrggbb, #rrggbbaa (or without #) or transparent";

/// The notations for points.
const POINT_FORMS: &str = "as [x, y, z] or, in a query or a flag, x,y,z";

/// Largest magnitude of a coordinate: squares of it still fit an f64 many times over.
pub const COORDINATE_MAX: f64 = 1e30;

impl Kind {
    /// The allowed values, in words.
    pub fn allowed(&self, image_px_max: u64) -> String {
        match self {
            Self::Number { min, max } => format!("a number from {} to {}", short(*min), short(*max)),
            Self::NumberOr { word, min, max } => format!("{word} or a number from {} to {}", short(*min), short(*max)),
            Self::Above0 { max } => format!("a number above 0, at most {}", short(*max)),
            Self::OneOf(values) => either(values),
            Self::OneOfOr { word, values } => format!("{word} or {}", either(values)),
            Self::Pixels => format!("a whole number from 1 to {image_px_max}"),
            Self::Size => format!("N or WxH, with whole numbers from 1 to {image_px_max}"),
            Self::Words(words) => format!("one of {}", words.join(", ")),
            Self::WordList { words, count_max } => {
                let forms = "as [\"A\", \"B\"] or, in a query or a flag, A,B";
                format!("a list of 1 to {count_max} of {}, {forms}", words.join(", "))
            }
            Self::Count { min, max } => format!("a whole number from {min} to {max}"),
            Self::Color => COLOR_FORMS.into(),
            Self::Background => format!("{COLOR_FORMS}; or two of them from top to bottom, such as #fff..#dde"),
            Self::Point => format!("three finite numbers of at most 1e30, {POINT_FORMS}"),
            Self::Direction => format!("three finite numbers of at most 1e30, not all zero, {POINT_FORMS}"),
            Self::Flag => "true or false".into(),
        }
    }

    /// Checks the value that is given for `key`.
    pub fn read(&self, key: &str, given: &Given, image_px_max: u64) -> Result<Value, RequestError> {
        let fault = match self.check(given, image_px_max) {
            Some(Some(value)) => return Ok(value),
            Some(None) => RequestFault::OutOfRange,
            None => RequestFault::WrongType,
        };
        let mut error = RequestError::new(fault, key, given.show(), self.allowed(image_px_max));
        if let Given::Json(Json::String(text)) = given
            && let Some(what) = self.bare()
            && self.check(&Given::Text(text.clone()), image_px_max).flatten().is_some()
        {
            error.given = format!("{}, {what} in quotes", error.given);
            error.allowed.push_str(", without quotes");
        }
        if let (Self::Words(words) | Self::WordList { words, .. }, Some(text)) = (self, given.text())
            && let Some(meant) = text.split(',').find_map(|one| misspelt(one, words))
        {
            error.allowed.push_str(&format!(" (did you mean {meant}?)"));
        }
        if let (Self::Background, Some(meant)) = (self, given.text().and_then(meant_gradient)) {
            error.allowed.push_str(&format!(" (did you mean {meant}?)"));
        }
        Err(error)
    }

    /// The name of a kind that JSON writes without quotes, for the advice about quotes.
    fn bare(&self) -> Option<&'static str> {
        match self {
            Self::Number { .. }
            | Self::NumberOr { .. }
            | Self::Above0 { .. }
            | Self::OneOf(_)
            | Self::OneOfOr { .. }
            | Self::Pixels
            | Self::Count { .. } => Some("a number"),
            Self::Flag => Some("a truth value"),
            Self::Size
            | Self::Words(_)
            | Self::WordList { .. }
            | Self::Color
            | Self::Background
            | Self::Point
            | Self::Direction => None,
        }
    }

    /// The value; None inside if it is out of range, None outside if it is of the wrong type.
    fn check(&self, given: &Given, px_max: u64) -> Option<Option<Value>> {
        Some(match self {
            // NaN and the infinities are in no range.
            Self::Number { min, max } => Some(given.number()?).filter(|n| (*min..=*max).contains(n)).map(Value::Number),
            Self::NumberOr { word, .. } if given.text() == Some(word) => Some(Value::Word(0)),
            Self::NumberOr { min, max, .. } => {
                Some(given.number()?).filter(|n| (*min..=*max).contains(n)).map(Value::Number)
            }
            Self::Above0 { max } => Some(given.number()?).filter(|n| *n > 0.0 && n <= max).map(Value::Number),
            Self::OneOfOr { word, .. } if given.text() == Some(word) => Some(Value::Word(0)),
            Self::OneOf(values) | Self::OneOfOr { values, .. } => {
                let number = given.number()?;
                values.iter().find(|&&v| f64::from(v) == number).map(|&v| Value::Whole(v))
            }
            Self::Pixels => pixels(given.number()?, px_max).map(Value::Whole),
            Self::Size => {
                let (width, height) = size(given)?;
                pixels(width, px_max).zip(pixels(height, px_max)).map(|(w, h)| Value::Size(w, h))
            }
            Self::Words(words) => {
                let word = given.text()?;
                words.iter().position(|&w| w == word).map(Value::Word)
            }
            Self::WordList { words, count_max } => word_list(given, words, *count_max)?.map(Value::WordList),
            Self::Count { min, max } => {
                let number = given.number()?;
                let in_range = (f64::from(*min)..=f64::from(*max)).contains(&number) && number.fract() == 0.0;
                in_range.then_some(Value::Whole(number as u32))
            }
            Self::Color => Rgba::parse(given.text()?).map(Value::Color),
            Self::Background => Background::parse(given.text()?).map(Value::Background),
            Self::Point => Some(given.point()?).filter(|p| largest(p) <= COORDINATE_MAX).map(Value::Point),
            Self::Direction => direction(given.point()?).map(Value::Point),
            Self::Flag => Some(Value::Flag(given.flag()?)),
        })
    }
}

/// Numbers, in words.
fn either(values: &[u32]) -> String {
    values.iter().map(u32::to_string).collect::<Vec<_>>().join(" or ")
}

/// The word that was probably meant by one that is none of `words`.
fn misspelt(text: &str, words: &[&'static str]) -> Option<&'static str> {
    if words.contains(&text.trim()) { None } else { suggest::word(text, words) }
}

/// The gradient that a text with two colours most likely means, whatever is between and around them.
fn meant_gradient(text: &str) -> Option<String> {
    const CHARS_MAX: usize = 80;
    let is_of_color = |c: char| c.is_ascii_alphanumeric() || c == '#';
    let parts = text.split(|c| !is_of_color(c)).filter(|part| Rgba::parse(part).is_some());
    let colors: Vec<&str> = parts.take(3).collect();
    match colors[..] {
        [top, bottom] if text.len() <= CHARS_MAX => Some(format!("{top}{BETWEEN}{bottom}")),
        _ => None,
    }
}

/// The places of a list's words; None inside if it is too long, or has another word.
fn word_list(given: &Given, words: &[&str], count_max: usize) -> Option<Option<Vec<usize>>> {
    let given: Vec<&str> = match given {
        Given::Json(json) => {
            let list = json.as_array()?;
            if list.len() > count_max {
                return Some(None);
            }
            list.iter().map(Json::as_str).collect::<Option<_>>()?
        }
        // One more than allowed is enough to refuse it.
        Given::Text(text) => text.split(',').map(str::trim).take(count_max + 1).collect(),
    };
    let places: Option<Vec<usize>> = given.iter().map(|one| words.iter().position(|word| word == one)).collect();
    Some(places.filter(|places| (1..=count_max).contains(&places.len())))
}

/// A direction that is not zero. Only where it points counts, so tiny ones are scaled up: squares of
/// tiny numbers are zero.
fn direction([x, y, z]: [f64; 3]) -> Option<[f64; 3]> {
    let largest = largest(&[x, y, z]);
    let unit = if largest < 1.0 / COORDINATE_MAX { largest } else { 1.0 };
    (largest > 0.0 && largest <= COORDINATE_MAX).then(|| [x / unit, y / unit, z / unit])
}

/// The largest magnitude of three coordinates.
fn largest(point: &[f64; 3]) -> f64 {
    point.iter().fold(0.0, |largest, v| v.abs().max(largest))
}

/// A number in its shorter notation: `1e30` rather than thirty zeros.
fn short(number: f64) -> String {
    let (plain, scientific) = (number.to_string(), format!("{number:e}"));
    if plain.len() > 2 * scientific.len() { scientific } else { plain }
}

/// A whole number from 1 to `max`.
fn pixels(number: f64, max: u64) -> Option<u32> {
    let in_range = number >= 1.0 && number <= max.min(u64::from(u32::MAX)) as f64;
    (in_range && number.fract() == 0.0).then_some(number as u32)
}

/// Reads `256`, `"256"` or `"640x480"`.
fn size(given: &Given) -> Option<(f64, f64)> {
    if let Some((width, height)) = given.text().and_then(|t| t.split_once(['x', 'X'])) {
        return Some((width.trim().parse().ok()?, height.trim().parse().ok()?));
    }
    let side = given.number().or_else(|| given.text().and_then(|t| t.trim().parse().ok()))?;
    Some((side, side))
}
