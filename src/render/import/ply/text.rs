//! The body of an ASCII PLY file. It is read word by word and not line by line, because exporters
//! do not agree on how records are split into lines.

use super::header::{Kind, word};
use super::layout::Layout;
use super::source::{Columns, Source};
use crate::import::text;

/// Reads numbers.
pub struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
    newline: u8,
}

impl<'a> Text<'a> {
    /// Reads `bytes` from `at` on.
    pub fn new(bytes: &'a [u8], at: usize, newline: u8) -> Self {
        Self { bytes, at, newline }
    }

    /// The offset and bytes of the next word, which is empty at the end of the file.
    fn next_word(&self) -> (usize, &'a [u8]) {
        let rest = &self.bytes[self.at..];
        let begin = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let rest = &rest[begin..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        (self.at + begin, &rest[..end])
    }
}

impl Source for Text<'_> {
    fn value(&mut self, _kind: Kind) -> Option<f64> {
        let (begin, word) = self.next_word();
        let value = parse(word)?;
        self.at = begin + word.len();
        Some(value)
    }

    fn values(&mut self, kind: Kind, count: usize, items: &mut Vec<f64>) -> Option<()> {
        for _ in 0..count {
            items.push(self.value(kind)?);
        }
        Some(())
    }

    /// Skipped words need not be numbers.
    fn skip(&mut self, numbers: usize, _bytes: usize) -> Option<()> {
        for _ in 0..numbers {
            let (begin, word) = self.next_word();
            if word.is_empty() {
                return None;
            }
            self.at = begin + word.len();
        }
        Some(())
    }

    fn block(&mut self, _bytes: usize) -> Option<&[u8]> {
        None
    }

    fn columns(_layout: &Layout, _stride: usize, _records: &[u8], _columns: &mut Columns) {}

    fn is_in_columns(&self) -> bool {
        false
    }

    fn numbers_left(&self, _kind: Kind) -> u64 {
        // The last word needs no space after it.
        (self.bytes.len() - self.at) as u64 / 2 + 1
    }

    fn at(&self) -> usize {
        self.at
    }

    fn place(&self, at: usize) -> String {
        // For a record that begins with white space, the line of its first word.
        let begin = self.bytes[at..].iter().position(|b| !b.is_ascii_whitespace()).map_or(at, |ahead| at + ahead);
        let line = self.bytes[..begin].iter().filter(|&&b| b == self.newline).count() + 1;
        format!("line {line} of the PLY file")
    }

    fn why(&self) -> String {
        match self.next_word().1 {
            b"" => "the file ends within".into(),
            other => format!("\"{}\" is no number, in", word(other)),
        }
    }

    fn trailing_bytes(&self) -> usize {
        self.bytes[self.at..].trim_ascii().len()
    }
}

/// A number as C prints it, NaN of any kind included. There are no comments in a body.
fn parse(word: &[u8]) -> Option<f64> {
    // Fast path: most words are indices.
    if (1..10).contains(&word.len()) && word.iter().all(u8::is_ascii_digit) {
        return Some(f64::from(word.iter().fold(0, |value: u32, digit| value * 10 + u32::from(digit - b'0'))));
    }
    if text::is_c_nan(word) {
        return Some(f64::NAN);
    }
    text::number(word)
}
