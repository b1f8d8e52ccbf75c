//! The cutting of an OBJ text into parts of about 256 KiB, which several threads can parse at the
//! same time. A cut lies at the end of a line, and never at one that a backslash continues.
//!
//! The content of a part is also estimated here, from its white space, its slashes and the
//! beginnings of its lines, so that memory can be reserved before it is parsed.

/// Bytes of a part, about: a part and what is read from it fit the second cache of a core.
pub const PART_BYTES: usize = 256 << 10;

/// Cuts `text` into parts of about `part_bytes`. A line that a backslash continues stays whole.
pub fn cut(text: &[u8], newline: u8, part_bytes: usize) -> Vec<&[u8]> {
    let mut parts = Vec::with_capacity(text.len() / part_bytes + 1);
    let mut rest = text;
    while rest.len() > part_bytes {
        let Some(end) = end_of_line(rest, part_bytes, newline) else { break };
        let (part, after) = rest.split_at(end);
        parts.push(part);
        rest = after;
    }
    if !rest.is_empty() {
        parts.push(rest);
    }
    parts
}

/// The end of the first line that ends at `from` or later and is not continued.
fn end_of_line(text: &[u8], mut from: usize, newline: u8) -> Option<usize> {
    loop {
        let end = from + text[from..].iter().position(|&b| b == newline)?;
        let line = &text[..end];
        let last = line.iter().rev().find(|b| !b.is_ascii_whitespace() || **b == newline);
        if last != Some(&b'\\') {
            return Some(end + 1);
        }
        from = end + 1;
    }
}

/// An estimate of a part's content, from a look at its white space and the begins of its lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// The most numbers and keywords that it can have: each ends with white space, a slash or the
    /// text.
    pub words: u64,
    /// Lines that begin with `v `.
    pub v: usize,
    /// Lines that begin with `vt`.
    pub vt: usize,
    /// Lines that begin with `vn`.
    pub vn: usize,
    /// Lines that begin with `f `.
    pub f: usize,
}

/// Looks at a part.
pub fn census(part: &[u8], newline: u8) -> Census {
    /// Bytes whose counts fit a byte, which a vector has many of.
    const BLOCK: usize = 255;
    let mut all = Census { words: 1, ..Census::default() };
    let first = [newline].into_iter().chain(part.iter().copied().take(2)).collect::<Vec<_>>();
    for begin in std::iter::once(None).chain((0..part.len()).step_by(BLOCK).map(Some)) {
        // The first line follows no line.
        let (block, next) = match begin {
            None => (&first[..1], &first[1..]),
            Some(begin) => (&part[begin..part.len().min(begin + BLOCK)], &part[begin + 1..]),
        };
        let [mut v, mut vt, mut vn, mut f] = [0_u8; 4];
        for ((&end, &a), &b) in block.iter().zip(next).zip(next.get(1..).unwrap_or_default()) {
            let (is_v, is_f) = ((end == newline) & (a == b'v'), (end == newline) & (a == b'f'));
            v += u8::from(is_v & (b == b' '));
            vt += u8::from(is_v & (b == b't'));
            vn += u8::from(is_v & (b == b'n'));
            f += u8::from(is_f & (b == b' '));
        }
        if begin.is_some() {
            all.words += u64::from(block.iter().fold(0_u8, |sum, &b| sum + u8::from(b <= b' ' || b == b'/')));
        }
        all.v += usize::from(v);
        all.vt += usize::from(vt);
        all.vn += usize::from(vn);
        all.f += usize::from(f);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_end_with_whole_lines() {
        let line = "v 1 2 3 \\ \r\n 4\nf 1 2\\\n\\\n3\n# c \\\n";
        let text = line.repeat(40_000);
        let parts = cut(text.as_bytes(), b'\n', PART_BYTES);
        assert!(parts.len() >= 4, "{}", parts.len());
        assert_eq!(parts.concat(), text.as_bytes());
        for part in &parts[..parts.len() - 1] {
            assert!(part.ends_with(b" 4\n") || part.ends_with(b"3\n"), "{:?}", &part[part.len() - 20..]);
        }
        assert!(cut(b"", b'\n', 1).is_empty());
        assert_eq!(cut("x".repeat(300).as_bytes(), b'\n', 100).len(), 1, "one line is one part");
        assert_eq!(cut("v 1\r".repeat(100).as_bytes(), b'\r', 99).len(), 4);
    }

    #[test]
    fn words_are_no_more_than_counted() {
        for text in ["", "v", "f 1/2/3 4//5\n", "\t\n ", "a#b"] {
            let words = text.split([' ', '/', '\n', '\t']).filter(|word| !word.is_empty()).count() as u64;
            assert!((words..=text.len() as u64 + 1).contains(&census(text.as_bytes(), b'\n').words), "{text}");
        }
        assert_eq!(census("1 ".repeat(10_000).as_bytes(), b'\n').words, 10_001);
    }

    #[test]
    fn lines_are_known_by_their_begin() {
        for count in [0, 1, 2, 100, 1000] {
            for begin in ["", "#", "\n", "v 1 2 3\n", "vn"] {
                let text = begin.to_owned() + &"v 1 2 3\nvt 1 2\nvt 1\nvn 1 2 3\nf 1 1 1\nvp 1\n f\nvf".repeat(count);
                let count = |keyword: &str| text.split('\n').filter(|line| line.starts_with(keyword)).count();
                let Census { v, vt, vn, f, .. } = census(text.as_bytes(), b'\n');
                assert_eq!([v, vt, vn, f], ["v ", "vt", "vn", "f "].map(count), "{begin:?}");
            }
        }
    }
}
