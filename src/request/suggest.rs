//! "Did you mean": the nearest known keys to a misspelt one.

/// Longer keys are not compared: whoever sends them made no typing mistake.
const KEY_CHARS_MAX: usize = 64;

/// What to do about an unknown key, in words.
pub fn allowed(key: &str, known: &[&'static str]) -> String {
    let near = nearest(key, known);
    if !near.is_empty() {
        return format!("did you mean {}?", near.join(" or "));
    }
    let group = key.split_once('.').map(|(group, _)| format!("{group}."));
    let siblings: Vec<&str> = match &group {
        Some(group) => known.iter().copied().filter(|k| k.starts_with(group.as_str())).collect(),
        None => Vec::new(),
    };
    if siblings.is_empty() {
        return format!("the keys are {}", known.join(", "));
    }
    format!("its neighbours are {}", siblings.join(", "))
}

/// The known keys that were most likely meant; none where nothing is near.
pub fn nearest(key: &str, known: &[&'static str]) -> Vec<&'static str> {
    if key.chars().count() > KEY_CHARS_MAX {
        return Vec::new();
    }
    let same_end: Vec<&'static str> =
        known.iter().copied().filter(|k| k.rsplit_once('.').is_some_and(|(_, last)| last == key)).collect();
    if !same_end.is_empty() {
        return same_end;
    }
    let scored = known.iter().map(|&k| (distance(key, k), k));
    let longer = |k: &str| k.len().max(key.len());
    let best = scored.min().filter(|&(d, k)| d <= 2.max(k.len() / 4) && 2 * d <= longer(k));
    best.map(|(_, k)| vec![k]).unwrap_or_default()
}

/// Levenshtein.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_mistakes_find_their_key() {
        let known = super::super::keys();
        let cases = [
            ("wire.colour", "wire.color"),
            ("wire.thicknes", "wire.thickness"),
            ("outline.thikness", "outline.thickness"),
            ("sise", "size"),
            ("camera.azimuth", "camera.azimuth_deg"),
            ("thickness", "wire.thickness"),
            ("fov_deg", "camera.fov_deg"),
        ];
        for (typo, expected) in cases {
            assert!(allowed(typo, &known).contains(expected), "{typo}: {}", allowed(typo, &known));
        }
        assert!(allowed("zzzzzzzzzzz", &known).starts_with("the keys are"));
        assert!(allowed("wire.zzzzzzzzzz", &known).starts_with("its neighbours are"));
        assert!(allowed(&"x".repeat(1_000_000), &known).starts_with("the keys are"));
    }
}
