//! The recognition of OBJ, which has no signature. A file that no stronger test recognises is taken
//! for OBJ if a line in its first MiB is a vertex with three numbers, or a face with an index.

use crate::import::text;

/// Bytes of a text that are searched for a statement. Exporters write long comment headers.
const TEXT_SNIFF_BYTES: usize = 1 << 20;

/// True if a line of the text is a vertex or a face. UTF-16 is read too: people edit OBJ files by
/// hand, and editors call that "Unicode".
pub fn is_obj(bytes: &[u8]) -> bool {
    let is_utf16_obj = text::is_utf16(bytes) && has_statement(&text::head(bytes, TEXT_SNIFF_BYTES));
    is_utf16_obj || has_statement(text::trim_start(bytes))
}

/// True if there is a vertex with three numbers or a face with an index. The keywords alone prove
/// nothing: lines of prose and of noise begin with them too.
fn has_statement(text: &[u8]) -> bool {
    let head = &text[..text.len().min(TEXT_SNIFF_BYTES)];
    head.split(|&b| b == b'\n' || b == b'\r').any(|line| {
        let Ok(line) = std::str::from_utf8(line) else { return false };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => words.by_ref().take(3).filter(|w| w.parse::<f64>().is_ok()).count() == 3,
            Some("f") => words.next().is_some_and(is_corner),
            _ => false,
        }
    })
}

fn is_corner(word: &str) -> bool {
    word.split('/').next().is_some_and(|index| index.parse::<i64>().is_ok())
}
