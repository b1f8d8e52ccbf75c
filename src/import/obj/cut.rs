//! Cuts a text into parts that can be read on their own, at ends of logical lines.

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

/// The most numbers and keywords that a text can have: each ends with white space, a slash or the
/// text.
pub fn words_max(text: &[u8]) -> u64 {
    // Sums in bytes, which a vector has many of.
    let of_block = |block: &[u8]| block.iter().fold(0_u8, |sum, &b| sum + u8::from(b <= b' ' || b == b'/'));
    text.chunks(255).map(|block| u64::from(of_block(block))).sum::<u64>() + 1
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
            assert!((words..=text.len() as u64 + 1).contains(&words_max(text.as_bytes())), "{text}");
        }
        assert_eq!(words_max("1 ".repeat(10_000).as_bytes()), 10_001);
    }
}
