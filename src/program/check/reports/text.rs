//! Verdicts of `meshsnap check` as text for a person: a line for a file, then a line for each rule that it breaks,
//! with the first places of the fault, and with `--since` a line for each change of the mesh since that commit.

use std::fmt::Write as _;

use super::{faults, word};
use meshsnap_inspect::check::{Check, Figure, Place, Verdict};

/// Places that a line names; the JSON has more.
const PLACES_MAX: usize = 3;

/// A line for the file, and one for each rule that it breaks and each change.
pub fn text(verdict: &Verdict) -> String {
    let mut text = format!("{}: {}\n", verdict.path, if verdict.ok { "ok" } else { "FAILED" });
    for check in faults(verdict) {
        let _ = writeln!(text, "  {}: {}: {}{}", word(check), check.rule, check.detail, at(check));
    }
    for change in verdict.changes.iter().flatten() {
        let _ = writeln!(text, "  changed: {change}");
    }
    text
}

/// The first places of a fault: `; at (0, 0, 1) to (0, 1, 1), and 2 more`
pub fn at(check: &Check) -> String {
    let named: Vec<String> = check.places.iter().take(PLACES_MAX).map(place).collect();
    if named.is_empty() {
        return String::new();
    }
    let all = match check.found {
        Some(Figure::Count(count)) => count,
        _ => named.len() as u64,
    };
    let more = match all.saturating_sub(named.len() as u64) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    format!("; at {}{more}", named.join(", "))
}

/// A place in words.
pub fn place(place: &Place) -> String {
    let point = |[x, y, z]: &[f64; 3]| format!("({x}, {y}, {z})");
    match place {
        Place::Edge(ends) => ends.iter().map(point).collect::<Vec<_>>().join(" to "),
        Place::Face(corners) => corners.iter().map(point).collect::<Vec<_>>().join(" - "),
        Place::Vertex(vertex) => point(vertex),
    }
}
