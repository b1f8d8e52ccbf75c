//! The words by which requests name the values of enumerations, such as `perspective` for
//! `ProjectionKind::Perspective`: the trait [`Words`], and the macro by which other files
//! define an enumeration with its words. The reader of requests, its error messages and the schema use
//! these lists.

use crate::image::ImageFormat;
use crate::mesh::UpAxis;

/// An enumeration that a request document names by words.
pub trait Words: Copy + Send + Sync + 'static {
    /// Each word and its meaning. Several words may mean the same; the first is the one we write.
    const ALL: &'static [(&'static str, Self)];
}

/// All words of an enumeration.
pub fn words_of<T: Words>() -> Vec<&'static str> {
    T::ALL.iter().map(|&(word, _)| word).collect()
}

/// The word for a value.
pub fn word_for<T: Words + PartialEq>(value: T) -> &'static str {
    T::ALL.iter().find(|(_, v)| *v == value).map_or("", |&(word, _)| word)
}

/// Defines enumerations with the word of each value beside it.
macro_rules! word_enums {
    ($(
        $(#[$about:meta])*
        pub enum $name:ident {
            $($(#[$doc:meta])* $value:ident = $word:literal,)*
        }
    )*) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$doc])* $value,)*
        }

        impl $crate::spec::words::Words for $name {
            const ALL: &'static [(&'static str, Self)] = &[$(($word, Self::$value)),*];
        }
    )*};
}
pub(crate) use word_enums;

impl Words for UpAxis {
    const ALL: &'static [(&'static str, Self)] =
        &[("y", Self::Y), ("z", Self::Z), ("-y", Self::NegY), ("-z", Self::NegZ), ("x", Self::X), ("-x", Self::NegX)];
}

impl Words for ImageFormat {
    // `jpg` is the usual file extension, so people write it in requests too.
    const ALL: &'static [(&'static str, Self)] =
        &[("png", Self::Png), ("webp", Self::Webp), ("jpeg", Self::Jpeg), ("jpg", Self::Jpeg)];
}
