//! Rules as users write them, on the command line, in `meshsnap.toml` or over HTTP: a name, and for some rules a
//! limit, as in `watertight`, `max-triangles:200000`, `bounds:10,10,2.5`. They are read here, and mistakes in them
//! are named.

use serde::Serialize;

/// A rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// The file can be read, and has something to draw.
    Opens,
    /// Reading it gives no warnings.
    NoWarnings,
    /// Every edge has two faces, which run along it in opposite directions.
    Watertight,
    /// No edge has more than two faces, and surfaces do not touch in a single vertex.
    Manifold,
    /// Neighbouring faces look to the same side.
    ConsistentWinding,
    /// No face is without area.
    NoDegenerate,
    /// No two faces have the same three corners.
    NoDuplicateFaces,
    /// No two faces have a point in common beside their common corners and edges.
    NoSelfIntersection,
    /// No closed part is inside out.
    NoInvertedVolume,
    /// Every vertex of the file belongs to a face, a line or a point.
    NoLooseVertices,
    /// No polygon has more than four corners.
    NoNgons,
    /// All faces are connected.
    SingleComponent,
    /// The file has vertex normals.
    HasNormals,
    /// The file has texture coordinates.
    HasUv,
    /// Texture coordinates lie in the texture.
    UvInRange,
    /// No two faces share a place in the texture.
    UvNoOverlap,
    /// Most triangles.
    MaxTriangles(u64),
    /// Most vertices, as the file counts them.
    MaxVertices(u64),
    /// Most materials.
    MaxMaterials(u64),
    /// The longest side of a texture, pixels.
    MaxTexturePx(u64),
    /// The largest file, with the files that it refers to.
    MaxFileBytes(u64),
    /// The largest extent along x, y and z, file units.
    Bounds([f64; 3]),
}

/// All names of rules.
pub const NAMES: [&str; 22] = [
    "opens",
    "no-warnings",
    "watertight",
    "manifold",
    "consistent-winding",
    "no-degenerate",
    "no-duplicate-faces",
    "no-self-intersection",
    "no-inverted-volume",
    "no-loose-vertices",
    "no-ngons",
    "single-component",
    "has-normals",
    "has-uv",
    "uv-in-range",
    "uv-no-overlap",
    "max-triangles",
    "max-vertices",
    "max-materials",
    "max-texture-px",
    "max-file-bytes",
    "bounds",
];

/// The weight of a broken rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// The file fails.
    Error,
    /// It is told, no more.
    Warn,
}

/// A text that is no rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownRule {
    /// No rule has this name.
    #[error("there is no rule `{given}`{}; the rules are {}", did_you_mean(.near), NAMES.join(", "))]
    Name {
        /// The name.
        given: String,
        /// The one that was probably meant.
        near: Option<&'static str>,
    },
    /// The rule exists, and what follows its name is wrong.
    #[error("`{given}`: {detail}")]
    Value {
        /// The whole rule.
        given: String,
        /// The value that the rule takes.
        detail: String,
    },
    /// The same rule twice.
    #[error("the rule `{0}` is given twice")]
    Twice(&'static str),
}

fn did_you_mean(near: &Option<&str>) -> String {
    near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()
}

impl Rule {
    /// Reads a rule.
    pub fn parse(text: &str) -> Result<Self, UnknownRule> {
        let text = text.trim();
        let (name, value) = match text.split_once(':') {
            Some((name, value)) => (name.trim(), Some(value.trim())),
            None => (text, None),
        };
        let wrong = |detail: String| UnknownRule::Value { given: cut(text), detail };
        let plain = |rule| match value {
            None => Ok(rule),
            Some(_) => Err(wrong(format!("`{name}` takes no number"))),
        };
        let count = |rule: fn(u64) -> Self| match value.and_then(|value| value.parse().ok()) {
            Some(count) => Ok(rule(count)),
            None => Err(wrong(format!("`{name}` takes a whole number: {name}:1000"))),
        };
        match name {
            "opens" => plain(Self::Opens),
            "no-warnings" => plain(Self::NoWarnings),
            "watertight" => plain(Self::Watertight),
            "manifold" => plain(Self::Manifold),
            "consistent-winding" => plain(Self::ConsistentWinding),
            "no-degenerate" => plain(Self::NoDegenerate),
            "no-duplicate-faces" => plain(Self::NoDuplicateFaces),
            "no-self-intersection" => plain(Self::NoSelfIntersection),
            "no-inverted-volume" => plain(Self::NoInvertedVolume),
            "no-loose-vertices" => plain(Self::NoLooseVertices),
            "no-ngons" => plain(Self::NoNgons),
            "single-component" => plain(Self::SingleComponent),
            "has-normals" => plain(Self::HasNormals),
            "has-uv" => plain(Self::HasUv),
            "uv-in-range" => plain(Self::UvInRange),
            "uv-no-overlap" => plain(Self::UvNoOverlap),
            "max-triangles" => count(Self::MaxTriangles),
            "max-vertices" => count(Self::MaxVertices),
            "max-materials" => count(Self::MaxMaterials),
            "max-texture-px" => count(Self::MaxTexturePx),
            "max-file-bytes" => count(Self::MaxFileBytes),
            "bounds" => match value.and_then(sides) {
                Some(sides) => Ok(Self::Bounds(sides)),
                None => Err(wrong("`bounds` takes three lengths in the file's units: bounds:10,10,2.5".to_owned())),
            },
            _ => Err(UnknownRule::Name { given: cut(name), near: nearest(name) }),
        }
    }

    /// Its name, without a number.
    pub fn name(&self) -> &'static str {
        let index = match self {
            Self::Opens => 0,
            Self::NoWarnings => 1,
            Self::Watertight => 2,
            Self::Manifold => 3,
            Self::ConsistentWinding => 4,
            Self::NoDegenerate => 5,
            Self::NoDuplicateFaces => 6,
            Self::NoSelfIntersection => 7,
            Self::NoInvertedVolume => 8,
            Self::NoLooseVertices => 9,
            Self::NoNgons => 10,
            Self::SingleComponent => 11,
            Self::HasNormals => 12,
            Self::HasUv => 13,
            Self::UvInRange => 14,
            Self::UvNoOverlap => 15,
            Self::MaxTriangles(_) => 16,
            Self::MaxVertices(_) => 17,
            Self::MaxMaterials(_) => 18,
            Self::MaxTexturePx(_) => 19,
            Self::MaxFileBytes(_) => 20,
            Self::Bounds(_) => 21,
        };
        NAMES[index]
    }
}

/// Rules with their levels, each rule once.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleSet(pub Vec<(Rule, Level)>);

impl Default for RuleSet {
    /// The rules of a command that names none: the file opens, and warnings are told.
    fn default() -> Self {
        Self(vec![(Rule::Opens, Level::Error), (Rule::NoWarnings, Level::Warn)])
    }
}

impl RuleSet {
    /// Reads the rules that fail a file and those that warn. `no-warnings` warns in either list.
    pub fn parse<'t>(
        errors: impl IntoIterator<Item = &'t str>,
        warnings: impl IntoIterator<Item = &'t str>,
    ) -> Result<Self, UnknownRule> {
        let mut set = Self(Vec::new());
        let errors = errors.into_iter().map(|text| (text, Level::Error));
        for (text, level) in errors.chain(warnings.into_iter().map(|text| (text, Level::Warn))) {
            let rule = Rule::parse(text)?;
            if set.0.iter().any(|(other, _)| other.name() == rule.name()) {
                return Err(UnknownRule::Twice(rule.name()));
            }
            set.0.push((rule, if rule == Rule::NoWarnings { Level::Warn } else { level }));
        }
        Ok(set)
    }

    /// The rules of a list with commas, as texts. The commas of `bounds:X,Y,Z` are part of the rule.
    pub fn split(list: &str) -> Vec<String> {
        let mut rules: Vec<String> = Vec::new();
        for piece in list.split(',').map(str::trim).filter(|piece| !piece.is_empty()) {
            match rules.last_mut() {
                Some(last) if last.starts_with("bounds:") && piece.parse::<f64>().is_ok() => {
                    last.push(',');
                    last.push_str(piece);
                }
                _ => rules.push(piece.to_owned()),
            }
        }
        rules
    }
}

/// Three lengths.
fn sides(text: &str) -> Option<[f64; 3]> {
    let sides: Vec<f64> = text.split(',').map(|side| side.trim().parse().ok()).collect::<Option<_>>()?;
    let sides: [f64; 3] = sides.try_into().ok()?;
    sides.iter().all(|side| side.is_finite() && *side >= 0.0).then_some(sides)
}

/// Most characters of a wrong rule that a message repeats; a longer name is no typing mistake either.
const CHARS_MAX: usize = 60;

fn cut(text: &str) -> String {
    text.chars().take(CHARS_MAX).collect()
}

fn nearest(name: &str) -> Option<&'static str> {
    if name.chars().count() > CHARS_MAX {
        return None;
    }
    let name = name.to_lowercase().replace('_', "-");
    let (distance, near) = NAMES.iter().map(|&known| (strsim::damerau_levenshtein(&name, known), known)).min()?;
    (distance <= 3 && 2 * distance < near.len()).then_some(near)
}
