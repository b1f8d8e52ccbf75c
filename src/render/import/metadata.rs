//! Texts that a mesh file says about itself (such as generator, first comment, names of glTF
//! extensions), each made one line of at most 200 characters without control characters, which
//! could move a terminal's cursor.

/// Most characters of a text in a report.
const TEXT_CHARS_MAX: usize = 200;
/// Bytes of a text file that are searched for its first comment.
const HEAD_BYTES: usize = 4096;

/// A text in a form that is safe to print: one short line. None if nothing is left.
pub fn tidy(text: &[u8]) -> Option<String> {
    // A character has at most four bytes, so this cuts none that would be shown.
    let text = String::from_utf8_lossy(&text[..text.len().min(TEXT_CHARS_MAX * 4 + 4)]);
    let text: String =
        text.trim_matches(|c: char| c.is_whitespace() || c == '\0').chars().take(TEXT_CHARS_MAX).collect();
    let text: String = text.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
    (!text.is_empty()).then_some(text)
}

/// The first comment with a letter in it, so that rules of dashes do not count. `mark` begins
/// comments; those that `skip` accepts are passed over.
pub fn first_comment(bytes: &[u8], mark: &[u8], skip: impl Fn(&[u8]) -> bool) -> Option<String> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
    let mut comments =
        head.split(|b| matches!(b, b'\n' | b'\r')).filter_map(|line| line.trim_ascii().strip_prefix(mark));
    let says = |comment: &&[u8]| comment.iter().any(u8::is_ascii_alphabetic) && !skip(comment.trim_ascii());
    let comment = comments.find(says)?;
    let start = comment.iter().position(|b| *b != b'#').unwrap_or(0);
    tidy(&comment[start..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_found_and_made_safe() {
        let cases: &[(&[u8], Option<&str>)] = &[
            (b"# Blender 5.0\nv 0 0 0\n", Some("Blender 5.0")),
            (b"\xEF\xBB\xBF####\r\n#\r\n## \tmade by hand \r\nv 0 0 0", Some("made by hand")),
            (b"v 0 0 0\n# later\n", Some("later")),
            (b"v 0 0 0 # not at the start\n", None),
            (b"#\x1b[31mred\n", Some("\u{FFFD}[31mred")),
            (b"# data x\n# words\n", Some("words")),
            (b"", None),
        ];
        for (bytes, expected) in cases {
            assert_eq!(first_comment(bytes, b"#", |c| c.starts_with(b"data")).as_deref(), *expected);
        }
        assert_eq!(tidy(&[b'x'; 5000]).map(|t| t.len()), Some(200));
        assert_eq!(tidy("\u{1F600}".repeat(300).as_bytes()).map(|t| t.chars().count()), Some(200));
        assert_eq!(tidy(b" \0\0 \n"), None);
    }
}
