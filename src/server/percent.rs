//! Percent-encoding (RFC 3986, 2.1).

/// A text in which all bytes are escaped but letters, digits, `-._~` and those of `plain`.
pub fn encoded(text: &str, plain: &[u8]) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) || plain.contains(&byte);
    text.bytes().map(|byte| if is_plain(byte) { char::from(byte).into() } else { format!("%{byte:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_a_meaning_in_addresses_is_escaped() {
        assert_eq!(encoded("a b/ü:~%", b""), "a%20b%2F%C3%BC%3A~%25");
        assert_eq!(encoded("a b/c", b"/"), "a%20b/c");
    }
}
