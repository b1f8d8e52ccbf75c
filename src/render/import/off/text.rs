//! The body of an OFF file that is text. The numbers that a vertex or a face must have may be
//! spread over several lines. Further numbers on the last of these lines belong to the same vertex
//! or face, such as a face's colour.

use super::header::Header;
use super::words::Words;
use super::{Counts, Number, Source};
use crate::import::context::Context;
use crate::import::{MeshError, text};

/// Corners of one face between two payments.
const CORNERS_PER_POLL: usize = 65_536;
/// Most numbers on a line beside a face's vertices.
const NUMBERS_MAX: usize = 16;

/// Reads records from the words of a text.
pub struct Text<'a> {
    bytes: &'a [u8],
    words: Words<'a>,
    /// Offset of the record last read.
    record: usize,
}

impl<'a> Text<'a> {
    /// The records from `at` on.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, words: Words::new(bytes, at), record: at }
    }

    /// Moves to the next word, and begins a record there.
    fn begin(&mut self) {
        if let Some(word) = self.words.next_word() {
            self.words.at -= word.len();
        }
        self.record = self.words.at;
    }

    fn number(&mut self) -> Result<Number, MeshError> {
        let word = self.words.next_word().ok_or_else(|| self.broken("the file ends here"))?;
        parse(word).ok_or_else(|| self.not_a_number(word))
    }

    /// Reads the numbers that are left on the line.
    fn rest_of_line(&mut self, out: &mut Vec<Number>) -> Result<(), MeshError> {
        while let Some(word) = self.words.next_on_line() {
            out.push(parse(word).ok_or_else(|| self.not_a_number(word))?);
            if out.len() > NUMBERS_MAX {
                return Err(self.broken("there are too many numbers on the line"));
            }
        }
        Ok(())
    }

    fn not_a_number(&self, word: &[u8]) -> MeshError {
        let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
        let shown: String = shown.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
        self.broken(&format!("\"{shown}\" is no number"))
    }

    fn count(&mut self) -> Result<u64, MeshError> {
        let word =
            self.words.next_word().ok_or_else(|| self.broken("the numbers of vertices and faces are missing"))?;
        let count = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        count.ok_or_else(|| self.not_a_number(word))
    }
}

impl Source for Text<'_> {
    fn counts(&mut self) -> Result<Counts, MeshError> {
        self.begin();
        let (vertices, faces) = (self.count()?, self.count()?);
        // The number of edges is often wrong or missing, and is ignored.
        self.rest_of_line(&mut Vec::new())?;
        let vertices = u32::try_from(vertices).ok().filter(|&count| count < u32::MAX);
        let vertices = vertices.ok_or_else(|| self.broken("there are more than 4 billion vertices"))?;
        Ok(Counts { vertices, faces })
    }

    fn bytes_min(&self, numbers: u64) -> [u64; 2] {
        [2 * numbers, 2]
    }

    fn left(&self) -> u64 {
        // No space needs to follow the last number.
        (self.bytes.len() - self.words.at) as u64 + 1
    }

    fn vertex(&mut self, header: &Header, out: &mut Vec<Number>) -> Result<(), MeshError> {
        self.begin();
        for _ in 0..header.numbers_min() {
            out.push(self.number()?);
        }
        self.rest_of_line(out)
    }

    fn face(&mut self, corners: &mut Vec<f64>, color: &mut Vec<Number>, cx: &mut Context<'_>) -> Result<(), MeshError> {
        self.begin();
        let count = self.count()?;
        if count > self.left() / 2 {
            return Err(self.broken(&format!("a face of {count} corners is more than the file has left")));
        }
        for i in 0..count as usize {
            if i.is_multiple_of(CORNERS_PER_POLL) && i > 0 {
                cx.deadline.check()?;
                cx.budget.spend("a face of very many corners", CORNERS_PER_POLL as u64, 16)?;
            }
            corners.push(self.number()?.value);
        }
        self.rest_of_line(color)
    }

    fn broken(&self, what: &str) -> MeshError {
        let before = &self.bytes[..self.record];
        let newline = if before.contains(&b'\n') { b'\n' } else { b'\r' };
        let line = before.iter().filter(|&&b| b == newline).count() + 1;
        MeshError::broken(format!("line {line} of the OFF file: {what}"))
    }

    fn trailing_bytes(&mut self) -> usize {
        self.begin();
        if self.words.next_word().is_none() { 0 } else { self.bytes[self.record..].trim_ascii().len() }
    }
}

/// A number as C prints it, NaN of any kind included.
fn parse(word: &[u8]) -> Option<Number> {
    let value = if text::is_c_nan(word) { f64::NAN } else { text::number(word)? };
    Some(Number { value, is_whole: word.iter().all(u8::is_ascii_digit) })
}
