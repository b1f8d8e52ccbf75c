//! What a key is: its name, what it allows, what it means, and where its value goes.

use serde_json::Value as Json;

use super::value::{Kind, Value};
use super::words::{Words, words_of};
use crate::request::draft::Draft;
use crate::request::layer_draft::Look;
use crate::spec::color::Rgba;

/// A key of the document.
pub struct Field {
    /// Dotted, such as `wire.color`.
    pub key: &'static str,
    /// One line on what it does.
    pub about: &'static str,
    /// What may be given.
    pub kind: Kind,
    /// Whether `null` may be given.
    pub nullable: bool,
    /// What a key that is not given means; None where that depends on other keys.
    pub default: Option<Json>,
    set: Setter,
}

/// Puts a value in its place: in what a material has too, or in what only the document has.
enum Setter {
    Look(Put<Look>),
    Document(Put<Draft>),
}

type Put<T> = Box<dyn Fn(&mut T, Value) + Send + Sync>;

/// A layer: `null` turns it off, `{}` turns it on with its defaults.
pub struct Layer {
    /// As in the document.
    pub name: &'static str,
    /// One line on what it draws.
    pub about: &'static str,
    turn: Turn,
}

/// Turns a layer on or off.
enum Turn {
    Look(fn(&mut Look, bool)),
    Document(fn(&mut Draft, bool)),
}

/// An object of the document that holds keys but is no layer.
pub struct Group {
    /// As in the document.
    pub name: &'static str,
    /// One line on what it holds.
    pub about: &'static str,
}

/// Where values go.
pub enum Target<'d> {
    /// The document itself.
    Document(&'d mut Draft),
    /// One of its materials.
    Material(&'d mut Look),
}

impl Target<'_> {
    /// Whether it is a material.
    pub fn is_material(&self) -> bool {
        matches!(self, Self::Material(_))
    }

    fn look(&mut self) -> &mut Look {
        match self {
            Self::Document(draft) => &mut draft.look,
            Self::Material(look) => look,
        }
    }
}

impl Field {
    /// Whether a material may have it.
    pub fn is_for_materials(&self) -> bool {
        matches!(self.set, Setter::Look(_))
    }

    /// Puts a value that passed [`Field::kind`] in its place.
    pub fn set(&self, target: &mut Target<'_>, value: Value) {
        match (&self.set, target) {
            (Setter::Look(set), target) => set(target.look(), value),
            (Setter::Document(set), Target::Document(draft)) => set(draft, value),
            (Setter::Document(_), Target::Material(_)) => {}
        }
    }

    /// Says what a key that is not given means.
    pub fn default(mut self, default: impl Into<Json>) -> Self {
        self.default = Some(default.into());
        self
    }

    /// Lets `null` be given.
    pub fn nullable(mut self) -> Self {
        self.nullable = true;
        self
    }
}

impl Layer {
    /// A layer that a material may have too.
    pub const fn of_looks(name: &'static str, about: &'static str, turn: fn(&mut Look, bool)) -> Self {
        Self { name, about, turn: Turn::Look(turn) }
    }

    /// A layer that only the document has.
    pub const fn of_document(name: &'static str, about: &'static str, turn: fn(&mut Draft, bool)) -> Self {
        Self { name, about, turn: Turn::Document(turn) }
    }

    /// Whether a material may have it.
    pub fn is_for_materials(&self) -> bool {
        matches!(self.turn, Turn::Look(_))
    }

    /// Turns it on or off.
    pub fn turn(&self, target: &mut Target<'_>, on: bool) {
        match (&self.turn, target) {
            (Turn::Look(turn), target) => turn(target.look(), on),
            (Turn::Document(turn), Target::Document(draft)) => turn(draft, on),
            (Turn::Document(_), Target::Material(_)) => {}
        }
    }
}

/// [`Draft`] or [`Look`]: what a field's setter writes to.
pub trait Receiver: Sized {
    #[doc(hidden)]
    fn field(
        key: &'static str,
        about: &'static str,
        kind: Kind,
        set: impl Fn(&mut Self, Value) + Send + Sync + 'static,
    ) -> Field;
}

impl Receiver for Look {
    fn field(
        key: &'static str,
        about: &'static str,
        kind: Kind,
        set: impl Fn(&mut Self, Value) + Send + Sync + 'static,
    ) -> Field {
        Field { key, about, kind, nullable: false, default: None, set: Setter::Look(Box::new(set)) }
    }
}

impl Receiver for Draft {
    fn field(
        key: &'static str,
        about: &'static str,
        kind: Kind,
        set: impl Fn(&mut Self, Value) + Send + Sync + 'static,
    ) -> Field {
        Field { key, about, kind, nullable: false, default: None, set: Setter::Document(Box::new(set)) }
    }
}

/// What a setter takes, out of a value.
pub trait FromValue: Sized {
    #[doc(hidden)]
    fn from_value(value: Value) -> Option<Self>;
}

macro_rules! from_value {
    ($($type:ty: $pattern:pat => $result:expr),* $(,)?) => {
        $(impl FromValue for $type {
            fn from_value(value: Value) -> Option<Self> {
                match value {
                    $pattern => Some($result),
                    _ => None,
                }
            }
        })*
    };
}

from_value! {
    f64: Value::Number(v) => v,
    f32: Value::Number(v) => v as f32,
    u32: Value::Whole(v) => v,
    [u32; 2]: Value::Size(width, height) => [width, height],
    [f64; 3]: Value::Point(v) => v,
    Rgba: Value::Color(v) => v,
    bool: Value::Flag(v) => v,
}

/// A key that always has a value.
pub fn value<T: Receiver + 'static, V: FromValue + 'static>(
    key: &'static str,
    kind: Kind,
    set: fn(&mut T, V),
    about: &'static str,
) -> Field {
    T::field(key, about, kind, move |target, value| {
        if let Some(value) = V::from_value(value) {
            set(target, value);
        }
    })
}

/// A key whose value may be `null`.
pub fn optional<T: Receiver + 'static, V: FromValue + 'static>(
    key: &'static str,
    kind: Kind,
    set: fn(&mut T, Option<V>),
    about: &'static str,
) -> Field {
    T::field(key, about, kind, move |target, value| set(target, V::from_value(value))).nullable()
}

/// A key whose value is one of a few words.
pub fn words<T: Receiver + 'static, W: Words>(key: &'static str, set: fn(&mut T, W), about: &'static str) -> Field {
    T::field(key, about, Kind::Words(words_of::<W>()), move |target, value| {
        if let Value::Word(place) = value {
            set(target, W::ALL[place].1);
        }
    })
}

/// A key whose value is one of a few words, or `null`.
pub fn optional_words<T: Receiver + 'static, W: Words>(
    key: &'static str,
    set: fn(&mut T, Option<W>),
    about: &'static str,
) -> Field {
    let word = |value| if let Value::Word(place) = value { Some(W::ALL[place].1) } else { None };
    T::field(key, about, Kind::Words(words_of::<W>()), move |target, value| set(target, word(value))).nullable()
}
