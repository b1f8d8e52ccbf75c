//! The fast parsing of one number in an OBJ text, a decimal or an index. From the byte where the
//! number begins, its value and the byte where it ends are found in one pass, because nearly all of
//! an OBJ file is numbers.

/// Parses the number at `bytes[begin..]`, up to white space or the end. Returns it, and where it ends.
#[inline]
pub fn leading(bytes: &[u8], begin: usize) -> Option<(f64, usize)> {
    let (value, count) = fast_float2::parse_partial(bytes.get(begin..)?).ok()?;
    let end = begin + count;
    bytes.get(end).is_none_or(u8::is_ascii_whitespace).then_some((value, end))
}

/// The whole number that begins at `at`, modulo 2^64, and where its digits end.
#[inline(always)]
pub fn whole(bytes: &[u8], mut at: usize) -> (u64, usize) {
    let mut value = 0_u64;
    while let Some(digit @ 0..=9) = bytes.get(at).map(|byte| byte.wrapping_sub(b'0')) {
        value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    (value, at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::test_random::Random;
    use crate::import::text::number;

    /// Compares a text with std, and counts it.
    fn check(text: &str, count: &mut u64) {
        let expected = text.parse::<f64>().ok().map(f64::to_bits);
        assert_eq!(number(text.as_bytes()).map(f64::to_bits), expected, "{text}");
        for after in [" ", "\n", "\r\n", "\t1"] {
            let given = leading(format!("{text}{after}").as_bytes(), 0);
            if let Some((value, end)) = given {
                assert_eq!((Some(value.to_bits()), end), (expected, text.len()), "{text}");
            }
        }
        *count += 1;
    }

    #[test]
    fn odd_texts_are_as_std_has_them() {
        let mut count = 0;
        let words = "0 -0 +0 00 1. .5 -.5 +.5 . - + e5 1e 1e+ 1e- 1e5 1E-5 1e+5 .e1 1.e1 inf -inf nan NaN infinity 1_0 0x1 1..2 --1 \
                     1e22 1e23 1e-22 1e-23 9007199254740992 9007199254740993 9007199254740992e22 9007199254740993e-22 \
                     18446744073709551615 18446744073709551616 9999999999999999999 99999999999999999999 1e999999 1e-999999 \
                     1e9999999 0e9999999 00000000000000000000001 0.00000000000000000000001 2.2250738585072014e-308 5e-324 \
                     1.7976931348623157e308 1.7976931348623159e308 123456.789e3 1,5 1#2";
        for word in words.split(' ') {
            check(word, &mut count);
        }
        assert_eq!(count, words.split(' ').count() as u64);
        assert_eq!(number(b""), None);
        assert_eq!(leading(b"1.5 2", 4), Some((2.0, 5)));
        assert_eq!(
            (leading(b"1.5x", 0), leading(b"nano", 0), leading(b"", 0), leading(b" 1", 0)),
            (None, None, None, None)
        );
    }

    #[test]
    fn digits_end_where_they_end() {
        let mut count = 0;
        // Every byte after every number of digits, near the text's end and far from it.
        for (digits, byte, more) in
            (0..=20).flat_map(|n| (0..=255_u8).flat_map(move |byte| [0, 1, 20].map(|more| (n, byte, more))))
        {
            let mut text = b"98765432109876543210"[..digits].to_vec();
            text.push(byte);
            text.resize(text.len() + more, b'7');
            let end = text.iter().position(|b| !b.is_ascii_digit()).unwrap_or(text.len());
            let fold = |value: u64, b: &u8| value.wrapping_mul(10).wrapping_add(u64::from(b - b'0'));
            assert_eq!(whole(&text, 0), (text[..end].iter().fold(0, fold), end), "{text:?}");
            count += 1;
        }
        assert_eq!(count, 21 * 256 * 3);
    }

    #[test]
    fn random_texts_are_as_std_has_them() {
        let (mut random, mut count) = (Random(0x9E37_79B9_7F4A_7C15), 0);
        for _ in 0..200_000 {
            // Digits, with a point and an exponent somewhere.
            let digits = random.below(22) + 1;
            let point = random.below(digits + 4);
            let mut text = ["", "-", "+"][random.below(3) as usize].to_owned();
            for i in 0..digits {
                if i == point {
                    text.push('.');
                }
                text.push(char::from(b'0' + random.below(10) as u8));
            }
            if random.below(3) == 0 {
                text += &format!("e{}", random.below(60) as i64 - 30);
            }
            check(&text, &mut count);
            // Every f64, in three forms.
            let value = f64::from_bits(random.below(1 << 53) << 11 ^ random.below(1 << 40));
            check(&format!("{value}"), &mut count);
            check(&format!("{value:e}"), &mut count);
            let near = (random.below(2_000_000_000) as f64 - 1e9) / 1e6;
            check(&format!("{near:.*}", random.below(10) as usize), &mut count);
        }
        assert_eq!(count, 800_000);
    }
}
