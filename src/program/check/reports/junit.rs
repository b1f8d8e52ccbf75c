//! The report of `meshsnap check` as JUnit XML, which CI systems read: a suite for each file, a case for each rule.

use std::fmt::Write as _;

use quick_xml::escape::escape;

use super::text::at;
use super::word;
use meshsnap_inspect::check::{Check, Verdict};

/// The report of all verdicts. Its times are 0, so that equal verdicts make equal bytes.
pub fn junit(verdicts: &[Verdict]) -> String {
    let cases: usize = verdicts.iter().map(|verdict| verdict.checks.len()).sum();
    let failures: usize = verdicts.iter().map(failures_of).sum();
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let _ = writeln!(text, "<testsuites name=\"meshsnap check\" tests=\"{cases}\" failures=\"{failures}\" time=\"0\">");
    for verdict in verdicts {
        let (name, cases, failures) = (attribute(&verdict.path), verdict.checks.len(), failures_of(verdict));
        let counts = format!("tests=\"{cases}\" failures=\"{failures}\" errors=\"0\" skipped=\"0\" time=\"0\"");
        let _ = writeln!(text, "  <testsuite name=\"{name}\" {counts}>");
        verdict.checks.iter().for_each(|check| case(&mut text, &name, check));
        text.push_str("  </testsuite>\n");
    }
    text + "</testsuites>\n"
}

/// A case. A broken rule that only warns, or is known, is a success with an output.
fn case(text: &mut String, class: &str, check: &Check) {
    let _ = write!(text, "    <testcase name=\"{}\" classname=\"{class}\" time=\"0\"", check.rule);
    let detail = attribute(&check.detail);
    let whole = attribute(&format!("{}{}", check.detail, at(check)));
    let _ = match (check.ok, check.fails()) {
        (true, _) => writeln!(text, "/>"),
        (false, true) => writeln!(
            text,
            ">\n      <failure message=\"{detail}\" type=\"{}\">{whole}</failure>\n    </testcase>",
            check.rule
        ),
        (false, false) => {
            writeln!(text, ">\n      <system-out>{}: {whole}</system-out>\n    </testcase>", word(check))
        }
    };
}

fn failures_of(verdict: &Verdict) -> usize {
    verdict.checks.iter().filter(|check| check.fails()).count()
}

/// A text without the characters that XML 1.0 cannot have, escaped.
fn attribute(text: &str) -> String {
    let is_allowed = |c: char| !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'));
    let plain: String = text.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect();
    escape(plain.as_str()).into_owned()
}
