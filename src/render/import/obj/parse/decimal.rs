//! Decimal numbers from text, as fast as the text is read: exactly what [`str::parse`] gives.

/// Powers of ten that f64 has exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Integers up to this are exact in f64.
const EXACT_MAX: u64 = 1 << 53;
/// Digits that always fit an u64.
const DIGITS_MAX: usize = 19;
/// Powers of ten up to that of [`DIGITS_MAX`].
const WHOLE_POWERS: [u64; DIGITS_MAX + 1] = {
    let mut powers = [1; DIGITS_MAX + 1];
    let mut i = 1;
    while i <= DIGITS_MAX {
        powers[i] = 10 * powers[i - 1];
        i += 1;
    }
    powers
};

/// Parses the number at `bytes[begin..]`, up to white space or the end. Returns it, and where it
/// ends. None if the word there is no plain decimal: it may still be a number that
/// [`str::parse`] takes, such as `inf`.
#[inline(always)]
pub fn leading(bytes: &[u8], begin: usize) -> Option<(f64, usize)> {
    let sign = *bytes.get(begin)?;
    let digits_begin = begin + usize::from(sign == b'-' || sign == b'+');
    // Most numbers have one digit before the point.
    let (mut digits, mut at) = match (digit(bytes, digits_begin), bytes.get(digits_begin + 1)) {
        (Some(digit), Some(b'.')) => (digit, digits_begin + 1),
        _ => whole(bytes, digits_begin),
    };
    let mut count = at - digits_begin;
    let mut exponent = 0;
    if bytes.get(at) == Some(&b'.') {
        let (fraction, end) = whole(bytes, at + 1);
        let more = end - (at + 1);
        digits = digits.wrapping_mul(WHOLE_POWERS[more.min(DIGITS_MAX)]).wrapping_add(fraction);
        count += more;
        (exponent, at) = (-(more as i64), end);
    }
    if count == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (written, end) = exponent_at(bytes, at + 1)?;
        (exponent, at) = (exponent + written, end);
    }
    if bytes.get(at).is_some_and(|b| !b.is_ascii_whitespace()) {
        return None;
    }
    if count > DIGITS_MAX || digits > EXACT_MAX || exponent.unsigned_abs() >= POWERS.len() as u64 {
        return Some((by_std(&bytes[begin..at])?, at));
    }
    // Both operands are exact, so that the one operation rounds once (Clinger, "How to read
    // floating point numbers accurately", 1990).
    let power = POWERS[exponent.unsigned_abs() as usize];
    // From a signed integer, which takes one instruction.
    let digits = digits.cast_signed() as f64;
    let value = if exponent < 0 { digits / power } else { digits * power };
    Some((if sign == b'-' { -value } else { value }, at))
}

#[cold]
fn by_std(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The whole number that begins at `at`, modulo 2^64, and where its digits end.
#[inline(always)]
pub fn whole(bytes: &[u8], mut at: usize) -> (u64, usize) {
    let mut value = 0_u64;
    while let Some((eight, _)) = bytes.get(at..).and_then(|rest| rest.split_first_chunk::<8>()) {
        let digits = u64::from_le_bytes(*eight) ^ 0x3030_3030_3030_3030;
        // A byte that is no digit has a high bit before or after the addition. What carries into
        // the bytes after it does not matter.
        let others = (digits.wrapping_add(0x0606_0606_0606_0606) | digits) & 0xF0F0_F0F0_F0F0_F0F0;
        let count = others.trailing_zeros() as usize / 8;
        // Zeros take the place of what follows, in front.
        let number = eight_digits(digits.unbounded_shl(64 - 8 * count as u32));
        value = value.wrapping_mul(WHOLE_POWERS[count]).wrapping_add(number);
        at += count;
        if count < 8 {
            return (value, at);
        }
    }
    while let Some(digit) = digit(bytes, at) {
        value = value.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    (value, at)
}

/// The number of eight digits, one a byte, the lowest byte first: pairs, then fours, then all.
#[inline(always)]
fn eight_digits(digits: u64) -> u64 {
    const EVEN_PAIRS: u64 = 0x0000_00FF_0000_00FF;
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let first = (pairs & EVEN_PAIRS).wrapping_mul(100 + (1_000_000 << 32));
    let second = (pairs >> 16 & EVEN_PAIRS).wrapping_mul(1 + (10_000 << 32));
    first.wrapping_add(second) >> 32
}

/// Parses a whole word, as [`str::parse`] does.
pub fn parse(word: &[u8]) -> Option<f64> {
    match leading(word, 0) {
        Some((value, end)) if end == word.len() => Some(value),
        _ => by_std(word),
    }
}

#[inline(always)]
fn digit(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

/// The exponent after an `e`, if it is short, and where it ends.
fn exponent_at(bytes: &[u8], begin: usize) -> Option<(i64, usize)> {
    let sign = *bytes.get(begin)?;
    let mut at = begin + usize::from(sign == b'-' || sign == b'+');
    let digits_begin = at;
    let mut exponent = 0;
    while let Some(digit) = digit(bytes, at) {
        exponent = exponent * 10 + digit as i64;
        at += 1;
        if at - digits_begin > 6 {
            return None;
        }
    }
    (at > digits_begin).then_some((if sign == b'-' { -exponent } else { exponent }, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::test_random::Random;

    /// Compares a text with std, and counts it.
    fn check(text: &str, count: &mut u64) {
        let expected = text.parse::<f64>().ok().map(f64::to_bits);
        assert_eq!(parse(text.as_bytes()).map(f64::to_bits), expected, "{text}");
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
        assert_eq!(parse(b""), None);
        assert_eq!(leading(b"1.5 2", 4), Some((2.0, 5)));
        assert_eq!(
            (leading(b"1.5x", 0), leading(b"nan", 0), leading(b"", 0), leading(b" 1", 0)),
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
