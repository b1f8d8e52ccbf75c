//! Checks: the judgement of a mesh by rules such as `watertight` or `max-triangles:200000`, for `meshsnap check` and
//! for HTTP. [`Rule`] is a rule as a client writes it, [`check`] judges a mesh by several rules, and a [`Verdict`] is
//! the result for one file: whether it passes, and what was found for each rule.
//!
//! Verdicts are written as JSON, so the names of their fields are part of the public interface. Nothing here reads a
//! file.

mod judge;
mod meaning;
mod places;
mod polygons;
mod rule;
#[cfg(test)]
mod tests;
mod uvs;
mod volume;

pub use judge::{check, of_unreadable, unopened};
pub use meaning::meaning;
pub use rule::{Level, NAMES, Rule, RuleSet, UnknownRule};

use std::collections::BTreeMap;

use serde::Serialize;

/// The checks of one file.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// The file as it is named.
    pub path: String,
    /// Its SHA-256; null if it cannot be read.
    pub sha256: Option<String>,
    /// True unless a rule of level `error` fails in a way that is not known.
    pub ok: bool,
    /// One for each rule, in the order of the rules.
    pub checks: Vec<Check>,
    /// Sentences on the changes since a commit, if one was named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changes: Option<Vec<String>>,
    /// Files with pictures, by view, if some were written.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub pictures: BTreeMap<&'static str, String>,
}

impl Verdict {
    /// The verdict of these checks.
    pub fn new(path: String, sha256: Option<String>, checks: Vec<Check>) -> Self {
        let mut verdict = Self { path, sha256, ok: true, checks, changes: None, pictures: BTreeMap::new() };
        verdict.judge();
        verdict
    }

    /// Its JSON, on one line.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self).map(|json| json + "\n")
    }

    /// Says anew whether the file is ok, after faults became known.
    pub fn judge(&mut self) {
        self.ok = !self.checks.iter().any(Check::fails);
    }
}

/// The result of one rule.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The rule's name, without its number.
    pub rule: &'static str,
    /// `error` if breaking it fails the file.
    pub level: Level,
    /// True if the mesh obeys it.
    pub ok: bool,
    /// True if the fault is an accepted one, which fails nothing.
    pub known: bool,
    /// The number that was found: of all faults, however many `where` has. Null where nothing is counted.
    pub found: Option<Figure>,
    /// The largest number that is allowed.
    pub allowed: Option<Figure>,
    /// One sentence for a person.
    pub detail: String,
    /// The first faults, with their positions in the file's space.
    #[serde(rename = "where")]
    pub places: Vec<Place>,
}

impl Check {
    /// True if it fails its file.
    pub fn fails(&self) -> bool {
        !self.ok && !self.known && self.level == Level::Error
    }
}

/// Most places that a check lists, unless all are asked for.
pub const PLACES_MAX: usize = 20;

/// Most places in one verdict where all are asked for. The others are counted.
pub const ALL_PLACES_MAX: usize = 100_000;

/// Options of a verdict, beside its rules.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// All places are listed, up to [`ALL_PLACES_MAX`].
    pub all_places: bool,
    /// A rule that takes more memory than the job may have fails, and says so. Otherwise the whole judgement fails.
    pub fails_at_limits: bool,
}

/// A number of a rule.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Figure {
    /// A count.
    Count(u64),
    /// The sides of a box, file units.
    Size([f64; 3]),
}

/// A place on a mesh, by positions in the file's space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Place {
    /// The ends of an edge.
    Edge([[f64; 3]; 2]),
    /// The corners of a face.
    Face([[f64; 3]; 3]),
    /// A vertex.
    Vertex([f64; 3]),
}
