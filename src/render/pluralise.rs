//! Counts with their nouns in the singular or the plural, for messages: `1 face`, `2 faces`.

use std::fmt::Display;

/// A count and its noun, in the singular or the plural: `1 face`, `2 faces`.
pub fn pluralise(count: impl Copy + Display + TryInto<u64>, one: &str, more: &str) -> String {
    let is_one = count.try_into().is_ok_and(|count| count == 1);
    format!("{count} {}", if is_one { one } else { more })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_takes_the_singular() {
        let said = [0_usize, 1, 2].map(|n| pluralise(n, "vertex", "vertices"));
        assert_eq!(said, ["0 vertices", "1 vertex", "2 vertices"]);
        assert_eq!(pluralise(u64::MAX, "face", "faces"), format!("{} faces", u64::MAX));
    }
}
