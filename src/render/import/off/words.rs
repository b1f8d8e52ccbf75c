//! The words of an OFF text, one by one, on one line or across lines. Comments, from `#` to the end
//! of the line, are passed over. The `#` of a NaN such as `1.#IND` begins none.

use crate::import::text;

/// Walks through the words of a text.
pub struct Words<'a> {
    bytes: &'a [u8],
    /// The end of the word last read.
    pub at: usize,
}

impl<'a> Words<'a> {
    /// The words from `at` on.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// The next word of this line.
    pub fn next_on_line(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let begin = rest.iter().position(|&b| !b.is_ascii_whitespace() || is_end(b)).unwrap_or(rest.len());
        let rest = &rest[begin..];
        if rest.first().is_none_or(|&b| is_end(b) || b == b'#') {
            return None;
        }
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        // A comment that begins within the word is left for the next call.
        let word = text::before_comment(&rest[..end]);
        self.at += begin + word.len();
        Some(word)
    }

    /// The next word, whatever line it is on.
    pub fn next_word(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = self.next_on_line() {
                return Some(word);
            }
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().position(|&b| is_end(b))? + 1;
        }
    }

    /// Offset of the next line.
    pub fn after_line(&self) -> usize {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| is_end(b)).unwrap_or(rest.len());
        let marks = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.at + (end + marks).min(rest.len())
    }
}

fn is_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}
