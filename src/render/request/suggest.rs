//! Suggestions for misspelt keys and words of a request: the nearest known ones, for the text of an error
//! ("did you mean ...?").

/// Longest key that is compared: a longer one is no typing mistake.
const KEY_CHARS_MAX: usize = 64;

/// The advice for an unknown key: the nearest keys, and all keys of the object that it is in.
pub fn allowed(key: &str, known: &[&'static str]) -> String {
    allowed_within("", key, known)
}

/// The same for a key within an object whose whole key, with its dot, is `home`.
pub fn allowed_within(home: &str, key: &str, known: &[&'static str]) -> String {
    let group = key.rsplit_once('.').map_or("", |(group, _)| group);
    let siblings: Vec<&str> = match group {
        "" => Vec::new(),
        group => known.iter().filter_map(|k| k.strip_prefix(group)?.strip_prefix('.')).collect(),
    };
    let of_object = if siblings.is_empty() {
        let top: Vec<&str> = known.iter().copied().filter(|k| !k.contains('.')).collect();
        format!("the keys are {}", top.join(", "))
    } else {
        format!("the keys of {home}{group} are {}", siblings.join(", "))
    };
    match nearest(key, known).as_slice() {
        [] => of_object,
        near => {
            let near: Vec<String> = near.iter().map(|key| format!("{home}{key}")).collect();
            format!("did you mean {}? ({of_object})", near.join(" or "))
        }
    }
}

/// The word that was probably meant by a misspelt one.
pub fn word(given: &str, words: &[&'static str]) -> Option<&'static str> {
    if given.chars().count() > KEY_CHARS_MAX {
        return None;
    }
    let given = given.trim().to_lowercase();
    let (distance, word) = words.iter().map(|&word| (strsim::damerau_levenshtein(&given, word), word)).min()?;
    // Of a short word, every other one is near.
    let longer = word.chars().count().max(given.chars().count());
    (distance <= 2 && 2 * distance < longer).then_some(word)
}

/// The known keys that were probably meant; empty if none is near.
pub fn nearest(key: &str, known: &[&'static str]) -> Vec<&'static str> {
    if key.chars().count() > KEY_CHARS_MAX {
        return Vec::new();
    }
    if let Some(same) = known.iter().find(|k| k.eq_ignore_ascii_case(key)) {
        return vec![same];
    }
    let same_end: Vec<&'static str> =
        known.iter().copied().filter(|k| k.rsplit_once('.').is_some_and(|(_, last)| last == key)).collect();
    if !same_end.is_empty() {
        return same_end;
    }
    let scored = known.iter().map(|&k| (strsim::levenshtein(key, k), k));
    let longer = |k: &str| k.len().max(key.len());
    // `wire` is no help for `wire.x`.
    let home = key.rsplit_once('.').map(|(home, _)| home);
    let best =
        scored.filter(|&(_, k)| Some(k) != home).min().filter(|&(d, k)| d <= 2.max(k.len() / 4) && 2 * d <= longer(k));
    best.map(|(_, k)| vec![k]).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_mistakes_find_their_word() {
        let words = ["wire", "wireframe", "hidden-line", "y", "-y", "auto", "gpu", "cpu"];
        let cases = [
            ("wier", Some("wire")),
            ("WIRE", Some("wire")),
            ("wirefame", Some("wireframe")),
            ("hiden-line", Some("hidden-line")),
            ("cpi", Some("cpu")),
            ("z", None),
            ("cuda", None),
            ("", None),
        ];
        for (typo, expected) in cases {
            assert_eq!(word(typo, &words), expected, "{typo}");
        }
        assert_eq!(word(&"x".repeat(1_000_000), &words), None);
    }

    #[test]
    fn keys_of_materials_are_suggested_whole() {
        let known = ["surface.opacity", "surface.color", "wire.color"];
        let said = allowed_within("materials.Glass.", "surface.opactiy", &known);
        assert!(
            said.starts_with(
                "did you mean materials.Glass.surface.opacity? (the keys of materials.Glass.surface are opacity, color)"
            ),
            "{said}"
        );
    }

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
            ("Wire.Color", "wire.color"),
            ("UP", "up"),
        ];
        for (typo, expected) in cases {
            let said = allowed(typo, &known);
            let (near, of_object) = said.split_once("? (").unwrap();
            assert!(near.starts_with("did you mean ") && near.contains(expected), "{typo}: {said}");
            assert!(of_object.starts_with("the keys"), "{typo}: {said}");
        }
        let said = allowed("zzzzzzzzzzz", &known);
        assert!(said.starts_with("the keys are") && said.contains(", wire") && !said.contains('.'), "{said}");
        let said = allowed("wire.zzzzzzzzzz", &known);
        assert!(said.starts_with("the keys of wire are color, edges") && !said.contains("camera"), "{said}");
        let said = allowed("wire.colour", &known);
        assert!(said.contains("the keys of wire are color, edges") && !said.contains("camera"), "{said}");
        let said = allowed("wire.x", &known);
        assert!(said.starts_with("the keys of wire are color, edges"), "{said}");
        // The keys of the document's own object include sections.
        let said = allowed("zzzzzzzzzzz", &known);
        for key in ["backend", "camera", "image", "light", "materials", "mesh", "scene", "size", "style", "surface"] {
            assert!(said.contains(&format!(" {key},")), "{key}: {said}");
        }
        assert!(allowed(&"x".repeat(1_000_000), &known).starts_with("the keys are"));
    }
}
