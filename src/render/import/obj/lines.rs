//! The lines of an OBJ or MTL file. A line that ends with a backslash is joined with the next,
//! unless it is a comment. Line ends may be line feeds, with or without a carriage return, or
//! carriage returns alone in a file without line feeds.

use std::borrow::Cow;

/// An iterator over lines that knows its line number.
pub struct Lines<'a> {
    rest: &'a [u8],
    newline: u8,
    /// Number of the line last returned, from 1. For a continued line, that of its end.
    pub number: u64,
}

/// The byte that ends lines. Only very old files end them with a carriage return alone.
pub fn newline(bytes: &[u8]) -> u8 {
    if bytes.contains(&b'\n') { b'\n' } else { b'\r' }
}

/// A text without the byte order mark of UTF-8.
pub fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// A name without the comment after it. Names may have a `#` of their own (`Material #25`): a
/// comment's stands alone.
pub fn uncommented(name: &[u8]) -> &[u8] {
    let is_space = |at: Option<usize>| at.and_then(|at| name.get(at)).is_none_or(u8::is_ascii_whitespace);
    let mark = |&at: &usize| name[at] == b'#' && is_space(at.checked_sub(1)) && is_space(Some(at + 1));
    let end = (0..name.len()).find(mark).unwrap_or(name.len());
    name[..end].trim_ascii_end()
}

impl<'a> Lines<'a> {
    /// The lines of a file.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: without_mark(bytes), newline: newline(bytes), number: 0 }
    }

    /// The lines of a part of a text whose lines end with `newline`.
    pub fn of_part(bytes: &'a [u8], newline: u8) -> Self {
        Self { rest: bytes, newline, number: 0 }
    }

    /// Bytes after the line last returned.
    pub fn rest_bytes(&self) -> usize {
        self.rest.len()
    }

    fn physical(&mut self) -> &'a [u8] {
        self.number += 1;
        let end = self.rest.iter().position(|&b| b == self.newline).unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        self.rest = self.rest.get(end + 1..).unwrap_or_default();
        line.trim_ascii_end()
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Cow<'a, [u8]>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let first = self.physical();
        // A comment cannot be continued: some end in the backslash of a Windows path.
        if !first.ends_with(b"\\") || first.trim_ascii_start().starts_with(b"#") {
            return Some(Cow::Borrowed(first));
        }
        let mut joined = first.to_vec();
        while joined.ends_with(b"\\") {
            joined.pop();
            joined.push(b' ');
            if self.rest.is_empty() {
                break;
            }
            joined.extend_from_slice(self.physical());
        }
        Some(Cow::Owned(joined))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_own_marks() {
        let cases = [
            ("red # c", "red"),
            ("red #", "red"),
            ("# red", ""),
            ("Material #25", "Material #25"),
            ("a#b # c # d", "a#b"),
        ];
        for (given, expected) in cases {
            assert_eq!(uncommented(given.as_bytes()), expected.as_bytes(), "{given}");
        }
        assert_eq!(cases.len(), 5);
    }
}
