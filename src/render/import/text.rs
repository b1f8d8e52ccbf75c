//! Text from files: UTF-16 is decoded, numbers are parsed, and names and other libraries' error texts
//! are cut to a length before they are kept or shown.

use crate::limits::{Budget, LimitExceeded};
use std::borrow::Cow;
use std::fmt::{Display, Write};

/// Longest name that is kept, in characters.
const NAME_CHARS_MAX: usize = 200;
/// Longest error text of another library, in characters. Some repeat whole strings of the file.
const FOREIGN_CHARS_MAX: usize = 200;

/// A name, cut to the length that is kept.
pub fn name(name: &str) -> String {
    cut(name, NAME_CHARS_MAX)
}

/// The error of another library, cut to the length that is shown.
pub fn foreign(error: impl Display) -> String {
    cut(error, FOREIGN_CHARS_MAX)
}

/// The first characters of a text. The rest is never formatted.
pub fn cut(text: impl Display, chars_max: usize) -> String {
    struct Cut {
        text: String,
        left: usize,
    }
    impl Write for Cut {
        fn write_str(&mut self, more: &str) -> std::fmt::Result {
            for c in more.chars() {
                self.left = self.left.checked_sub(1).ok_or(std::fmt::Error)?;
                self.text.push(c);
            }
            Ok(())
        }
    }
    let mut cut = Cut { text: String::new(), left: chars_max };
    // The error only says that the text was cut.
    let _ = write!(cut, "{text}");
    cut.text
}

/// True if a word is a NaN as C libraries print it: `1.#IND` of Microsoft's, also for infinity, or
/// `-nan(ind)`.
pub fn is_c_nan(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
    let is_hashed = word.first().is_some_and(u8::is_ascii_digit) && word[1..].starts_with(b".#");
    is_hashed || word.get(..4).is_some_and(|head| head.eq_ignore_ascii_case(b"nan("))
}

/// A word up to the comment in it. The `#` of a NaN such as `1.#IND` begins no comment.
pub fn before_comment(word: &[u8]) -> &[u8] {
    match word.iter().position(|b| *b == b'#') {
        Some(at) if !is_c_nan(word) => &word[..at],
        _ => word,
    }
}

/// A name as text: UTF-8, or Latin-1 if it is not valid UTF-8.
pub fn utf8_or_latin1(name: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(name) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(name.iter().map(|&b| char::from(b)).collect()),
    }
}

/// A number: exactly what [`str::parse`] gives.
pub fn number(word: &[u8]) -> Option<f64> {
    fast_float2::parse(word).ok()
}

/// The bytes without a UTF-8 byte order mark and leading white space.
pub fn trim_start(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start()
}

/// True if the bytes begin with a byte order mark of UTF-16.
pub fn is_utf16(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF")
}

/// UTF-16 is converted to UTF-8 without its mark, other bytes are returned as they are. Invalid
/// units become replacement characters.
pub fn to_utf8<'b>(bytes: &'b [u8], budget: &mut Budget) -> Result<Cow<'b, [u8]>, LimitExceeded> {
    if !is_utf16(bytes) {
        return Ok(Cow::Borrowed(bytes));
    }
    // Two bytes become three at most.
    budget.spend("UTF-16 text", bytes.len() as u64 * 3 / 2, 1)?;
    Ok(Cow::Owned(decode(bytes).into_bytes()))
}

/// The first `length` bytes of a text, decoded if they are UTF-16.
pub fn head(bytes: &[u8], length: usize) -> Cow<'_, [u8]> {
    let head = &bytes[..bytes.len().min(length)];
    if is_utf16(bytes) { Cow::Owned(decode(head).into_bytes()) } else { Cow::Borrowed(head) }
}

fn decode(bytes: &[u8]) -> String {
    let is_little = bytes.starts_with(b"\xFF\xFE");
    let units = bytes[2..].chunks_exact(2).map(|pair| {
        let pair = [pair[0], pair[1]];
        if is_little { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) }
    });
    let mut text = String::with_capacity(bytes.len() / 2);
    text.extend(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_end_words_and_nan_begins_none() {
        for nan in [&b"1.#IND"[..], b"-1.#QNAN", b"1.#INF000", b"nan(ind)", b"-NaN(snan)"] {
            assert!(is_c_nan(nan) && before_comment(nan) == nan, "{nan:?}");
        }
        for word in [&b"1"[..], b"", b"-", b"#", b"1#", b"1.5#c", b"3#1.#IND", b"nan", b"(1)", b"x.#"] {
            assert!(!is_c_nan(word), "{word:?}");
        }
        assert_eq!([before_comment(b"3#c"), before_comment(b"#"), before_comment(b"3")], [&b"3"[..], b"", b"3"]);
    }

    #[test]
    fn texts_are_cut_at_characters() {
        assert_eq!(cut("äöü", 2), "äö");
        assert_eq!(cut("äöü", 3), "äöü");
        assert_eq!(cut(format_args!("{}{}", "ab", "cd"), 3), "abc");
        assert_eq!((name(&"x".repeat(5000)).len(), foreign("y".repeat(5000)).len()), (200, 200));
    }

    #[test]
    fn both_orders_are_read() {
        let text = "v 1 2 3 # é 中 \u{1F600}\n";
        let little: Vec<u8> = [0xFEFF].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = [0xFEFF].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
        for bytes in [&little, &big] {
            assert!(is_utf16(bytes));
            assert_eq!(decode(bytes), text);
            assert_eq!(decode(&[bytes, &b"x"[..]].concat()), text, "half a unit at the end");
            assert_eq!(*head(bytes, 8), *b"v 1");
        }
        assert_eq!(decode(b"\xFF\xFE\x00\xD8v\x00"), "\u{FFFD}v", "half a pair");
        assert!(!is_utf16(text.as_bytes()) && *head(b"abc", 2) == *b"ab");
    }
}
