//! The types of the table of keys: a `Field` is a key that holds a value (`wire.color`), a `Section` is
//! an object that holds keys (`wire`). For each type of value it is defined here which values a key
//! allows, unless its entry in the table says otherwise.

use serde_json::Value as Json;

use super::dependent::Dependent;
use super::value::{COORDINATE_MAX, Kind, Value};
use crate::request::draft::Draft;
use crate::spec::color::Rgba;
use crate::spec::words::{Words, words_of};
use crate::spec::{ADAPTIVE, Background, NamedView, SHEET_VIEWS_MAX, Samples, WireThickness};

/// A key that holds a value.
pub struct Field {
    /// Dotted, such as `wire.color`.
    pub key: &'static str,
    /// Another name for it, outside its section.
    pub short: Option<&'static str>,
    /// One line on what it does.
    pub about: String,
    /// The values that are allowed.
    pub kind: Kind,
    /// True if `null` is a value, and not the absence of one.
    pub nullable: bool,
    /// The meaning of a document without the key; None where that depends on other keys.
    pub default: Option<Json>,
    /// Puts a value that passed `kind` in its place.
    pub set: Setter,
}

/// Puts a value in its place in a draft.
type Setter = Box<dyn Fn(&mut Draft, Value) + Send + Sync>;

/// An object of the document that holds keys.
pub struct Section {
    /// As in the document.
    pub name: &'static str,
    /// One line on what it holds.
    pub about: &'static str,
    /// Turns a layer on or off; None: the section is no layer.
    pub turn: Option<fn(&mut Draft, bool)>,
    /// True if materials have it too.
    pub is_for_materials: bool,
}

/// A type of [`Draft`]'s fields that a key can set.
pub trait FieldValue: Sized + 'static {
    /// True if `null` is a value.
    const NULLABLE: bool = false;

    /// The values that are allowed, unless the key says otherwise.
    fn kind() -> Kind;

    /// The content of a value of that kind.
    fn of(value: Value) -> Option<Self>;
}

impl Field {
    /// A key and the place in a draft that it sets.
    pub fn new<T: FieldValue>(key: &'static str, place: fn(&mut Draft) -> &mut T, about: impl Into<String>) -> Self {
        let set = move |draft: &mut Draft, value| {
            if let Some(value) = T::of(value) {
                *place(draft) = value;
            }
        };
        let (kind, set) = (T::kind(), Box::new(set));
        Self { key, short: None, about: about.into(), kind, nullable: T::NULLABLE, default: None, set }
    }

    /// True if materials have it too.
    pub fn is_for_materials(&self) -> bool {
        self.section().is_some_and(|section| section.is_for_materials)
    }

    /// The section that it stands in.
    pub fn section(&self) -> Option<&'static Section> {
        super::section(self.key.split_once('.')?.0)
    }
}

macro_rules! places {
    ($($type:ty: $kind:expr, $pattern:pat => $result:expr;)*) => {
        $(impl FieldValue for $type {
            fn kind() -> Kind {
                $kind
            }

            fn of(value: Value) -> Option<Self> {
                if let $pattern = value { Some($result) } else { None }
            }
        })*
    };
}

places! {
    f64: Kind::Number { min: -COORDINATE_MAX, max: COORDINATE_MAX }, Value::Number(v) => v;
    f32: Kind::Number { min: -COORDINATE_MAX, max: COORDINATE_MAX }, Value::Number(v) => v as f32;
    u32: Kind::Pixels, Value::Whole(v) => v;
    [u32; 2]: Kind::Size, Value::Size(width, height) => [width, height];
    [f64; 3]: Kind::Point, Value::Point(v) => v;
    Rgba: Kind::Color, Value::Color(v) => v;
    Background: Kind::Background, Value::Background(v) => v;
    bool: Kind::Flag, Value::Flag(v) => v;
}

impl FieldValue for WireThickness {
    fn kind() -> Kind {
        Kind::NumberOr { word: "auto", min: 0.0, max: 100.0 }
    }

    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Word(_) => Some(Self::Auto),
            Value::Number(v) => Some(Self::Given(v as f32)),
            _ => None,
        }
    }
}

impl FieldValue for Samples {
    fn kind() -> Kind {
        Kind::OneOfOr { word: ADAPTIVE, values: Self::FIXED }
    }

    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Word(_) => Some(Self::Adaptive),
            Value::Whole(samples) => Some(Self::Fixed(samples)),
            _ => None,
        }
    }
}

impl<W: Words> FieldValue for W {
    fn kind() -> Kind {
        Kind::Words(words_of::<W>())
    }

    fn of(value: Value) -> Option<Self> {
        if let Value::Word(place) = value { W::ALL.get(place).map(|&(_, word)| word) } else { None }
    }
}

impl FieldValue for Vec<NamedView> {
    fn kind() -> Kind {
        Kind::WordList { words: words_of::<NamedView>(), count_max: SHEET_VIEWS_MAX }
    }

    fn of(value: Value) -> Option<Self> {
        let Value::WordList(places) = value else { return None };
        places.into_iter().map(|place| NamedView::ALL.get(place).map(|&(_, view)| view)).collect()
    }
}

impl<T: FieldValue> FieldValue for Option<T> {
    const NULLABLE: bool = true;

    fn kind() -> Kind {
        T::kind()
    }

    fn of(value: Value) -> Option<Self> {
        if value == Value::Null { Some(None) } else { T::of(value).map(Some) }
    }
}

impl<T: FieldValue> FieldValue for Dependent<T> {
    fn kind() -> Kind {
        T::kind()
    }

    fn of(value: Value) -> Option<Self> {
        T::of(value).map(Self::given)
    }
}

/// Writes a list of [`Field`]s. An entry is the key and the place in a draft that it sets; then, as
/// needed, the allowed values (`in`) if they differ from [`FieldValue::kind`], a short name and the
/// default; then the description.
macro_rules! fields {
    ($(
        $key:literal |$draft:ident| $place:expr
            $(, in $kind:expr)? $(, short $short:literal)? $(, default $default:expr)?;
            $about:expr;
    )*) => {
        vec![$(Field {
            $(kind: $kind,)?
            $(short: Some($short),)?
            $(default: Some($default.into()),)?
            ..Field::new($key, |$draft| &mut $place, $about)
        }),*]
    };
}
pub(super) use fields;
