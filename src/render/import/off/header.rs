//! The keyword that begins an OFF file, such as `OFF`, `COFF` or `STCNOFF`. Its letters tell which
//! attributes vertices have, and the word `BINARY` after it tells the encoding.
//!
//! Some files join the first count to the keyword (`OFF3`). The format also allows the keyword to
//! be missing: a file that the client says is OFF may begin with its counts.

use super::words::Words;
use crate::import::{MeshError, MeshFault, text};

/// The parsed keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// `N`
    pub has_normals: bool,
    /// `C`
    pub has_colors: bool,
    /// `ST`
    pub has_uvs: bool,
    /// MeshLab's order: with `N` before `C`, colours come before normals.
    pub colors_first: bool,
    /// True if the word `BINARY` follows.
    pub is_binary: bool,
    /// Offset of the counts.
    pub body_at: usize,
}

impl Header {
    /// Numbers of a vertex before its colour.
    pub fn before_color(&self) -> usize {
        if self.has_normals && !self.colors_first { 6 } else { 3 }
    }

    /// Numbers of a vertex after its colour.
    pub fn after_color(&self) -> usize {
        let normal = if self.has_normals && self.colors_first { 3 } else { 0 };
        normal + if self.has_uvs { 2 } else { 0 }
    }

    /// The fewest numbers of a vertex. A colour may have one more.
    pub fn numbers_min(&self) -> usize {
        self.before_color() + if self.has_colors { 3 } else { 0 } + self.after_color()
    }
}

/// True if the bytes begin with a keyword of OFF that is followed by a count or `BINARY`.
pub fn is_off(bytes: &[u8]) -> bool {
    let mut words = Words::new(bytes, bytes.len() - text::trim_start(bytes).len());
    let Some(first) = words.next_word() else { return false };
    let Some((_, rest)) = keyword(first) else { return false };
    let next = if rest.is_empty() { words.next_word() } else { Some(rest) };
    next.is_none_or(|word| word == b"BINARY" || word.iter().all(u8::is_ascii_digit))
}

/// Reads the keyword. The format allows it to be missing, so a file that is said to be OFF may
/// begin with its counts.
pub fn parse(bytes: &[u8]) -> Result<Header, MeshError> {
    let begin = bytes.len() - text::trim_start(bytes).len();
    let mut words = Words::new(bytes, begin);
    let first = words.next_word().ok_or_else(|| MeshError::broken("the OFF file is empty"))?;
    let Some((prefix, rest)) = keyword(first) else {
        if first.iter().all(u8::is_ascii_digit) {
            return Ok(Header { body_at: begin, ..Header::default() });
        }
        return Err(MeshError::broken("the OFF file begins with neither its keyword nor the number of its vertices"));
    };
    let mut header = Header { body_at: words.at - rest.len(), ..Header::default() };
    for letter in prefix {
        match letter {
            b'S' => header.has_uvs = true,
            b'C' => {
                header.has_colors = true;
                header.colors_first = header.has_normals;
            }
            b'N' => header.has_normals = true,
            b'4' => return Err(unsupported("4", "homogeneous coordinates")),
            b'n' => return Err(unsupported("n", "a number of dimensions of their own")),
            _ => {}
        }
    }
    if words.next_on_line() == Some(b"BINARY") {
        header.is_binary = true;
        header.body_at = words.after_line();
    }
    Ok(header)
}

fn unsupported(letter: &str, what: &str) -> MeshError {
    let detail = format!("vertices with {what} (the {letter} of {letter}OFF) are not read: write them with x, y and z");
    MeshError::new(MeshFault::Unsupported, detail)
}

/// The prefix of a keyword, and the digits joined to its end: some files have the first count
/// there. Geomview's prefix is `[ST][C][N][4][n]`; vcglib, and so MeshLab, writes `[N][C][ST]`.
fn keyword(word: &[u8]) -> Option<(&[u8], &[u8])> {
    let mut at = 0;
    let mut left = vec![&b"ST"[..], b"C", b"N", b"4", b"n"];
    while let Some(i) = left.iter().position(|part| word[at..].starts_with(part)) {
        at += left.swap_remove(i).len();
    }
    let rest = word[at..].strip_prefix(b"OFF")?;
    rest.iter().all(u8::is_ascii_digit).then_some((&word[..at], rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keywords_and_words_that_are_none() {
        for yes in [
            "NCOFF 3",
            "CSTOFF 3",
            "NCSTOFF\n3",
            "OFF 3 1 0",
            "OFF\n# c\n\n3 1",
            "STCN4nOFF\n3",
            "OFF3 1 0",
            "\u{feff}# c\nCOFF # d\n8",
            "NOFF BINARY\n",
        ] {
            assert!(is_off(yes.as_bytes()), "{yes}");
        }
        for no in ["OFFICE", "OFF the road", "NNOFF 3", "off 3", "", "CSTCOFF 3", "3 1 0"] {
            assert!(!is_off(no.as_bytes()), "{no}");
        }
        let header = parse(b"STCNOFF\n3 1 0").unwrap();
        assert!(header.has_uvs && header.has_colors && header.has_normals && header.numbers_min() == 11);
        assert!(!header.colors_first && header.before_color() == 6);
        let other = parse(b"NCSTOFF\n3 1 0").unwrap();
        assert_eq!((other.before_color(), other.after_color(), other.numbers_min()), (3, 5, 11));
        assert_eq!(parse(b"OFF3 1 0").unwrap().body_at, 3);
        for (text, body_at) in
            [("OFF BINARY\nx", 11), ("OFF BINARY\r\nx", 12), ("OFF BINARY\rx", 11), ("OFF BINARY", 10)]
        {
            assert_eq!(parse(text.as_bytes()).unwrap().body_at, body_at, "{text:?}");
        }
        assert_eq!(parse(b"4OFF 1").unwrap_err().fault, MeshFault::Unsupported);
        assert!(parse(b"nOFF 4 1").unwrap_err().detail.contains("nOFF"));
    }
}
