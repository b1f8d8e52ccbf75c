//! Text that is not UTF-8: UTF-16 with a byte order mark, in either order.

use super::MeshError;
use super::import::Context;
use std::borrow::Cow;

/// Whether the bytes begin with a mark of UTF-16.
pub fn is_utf16(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF")
}

/// The same text in UTF-8, without its mark, if it is UTF-16, and the bytes as they are if not. What is no character becomes
/// a replacement character, as for any reader that goes on.
pub fn to_utf8<'b>(bytes: &'b [u8], cx: &mut Context<'_>) -> Result<Cow<'b, [u8]>, MeshError> {
    if !is_utf16(bytes) {
        return Ok(Cow::Borrowed(bytes));
    }
    // Two bytes become three at most.
    cx.budget.spend("UTF-16 text", bytes.len() as u64 * 3 / 2, 1)?;
    Ok(Cow::Owned(decode(bytes).into_bytes()))
}

/// The beginning of a text, for whoever looks at its first lines: `length` bytes at most.
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
