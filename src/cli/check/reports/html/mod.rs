//! The verdicts as one page, which needs no network: a table of the files with a filter, and the faults of each.

use std::fmt::Write as _;

use quick_xml::escape::escape;

use super::text::{at, place};
use super::{Findings, faults, word};
use crate::check::{Check, Figure, Verdict, meaning};
use crate::pluralise::pluralise;

const CSS: &str = include_str!("page.css");
const JS: &str = include_str!("page.js");

/// Nothing is loaded, and no other page can frame or change this one.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; \
                      base-uri 'none'; form-action 'none'";

/// The page.
pub fn html(findings: &Findings<'_>) -> String {
    let (files, failed) = (findings.files(), findings.failed());
    let all = pluralise(files as u64, "file", "files");
    let title = match failed {
        0 => format!("meshsnap check: {all} ok"),
        failed => format!("meshsnap check: {failed} of {all} failed"),
    };
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <title>{title}</title>\n<style>\n{CSS}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n<p>{}</p>\n",
        counts(findings)
    );
    page += "<form hidden role=\"search\">\n\
             <label>Filter <input name=\"text\" type=\"search\" autocomplete=\"off\"></label>\n\
             <label>Files <select name=\"state\">\n";
    for (value, label) in [
        ("all", "all"),
        ("error", "failed"),
        ("warning", "with warnings"),
        ("known", "with known faults"),
        ("ok", "ok"),
    ] {
        let _ = writeln!(page, "<option value=\"{value}\">{label}</option>");
    }
    page += "</select></label>\n<span id=\"shown\" role=\"status\"></span>\n</form>\n";
    page += "<div class=\"table\" role=\"region\" aria-label=\"Files\" tabindex=\"0\">\n<table>\n<thead>\n<tr>\
             <th scope=\"col\">File</th><th scope=\"col\">Verdict</th><th scope=\"col\">Faults</th></tr>\n</thead>\n<tbody>\n";
    findings.verdicts.iter().for_each(|verdict| row(&mut page, verdict));
    let _ = write!(page, "</tbody>\n</table>\n</div>\n</main>\n<script>\n{JS}</script>\n</body>\n</html>\n");
    page
}

/// A sentence with the numbers of faults.
fn counts(findings: &Findings<'_>) -> String {
    let all = || findings.verdicts.iter().flat_map(faults);
    let of = |meant: &str| all().filter(|check| word(check) == meant).count() as u64;
    let mut said = vec![
        pluralise(of("error"), "fault", "faults"),
        pluralise(of("warning"), "warning", "warnings"),
        pluralise(findings.known() as u64, "known fault", "known faults"),
    ];
    if findings.lost > 0 {
        said.push(format!(
            "{} without a verdict, by a fault of meshsnap",
            pluralise(findings.lost as u64, "file", "files")
        ));
    }
    said.join(", ")
}

fn row(page: &mut String, verdict: &Verdict) {
    let met = |meant: &str| faults(verdict).any(|check| word(check) == meant);
    let (state, label) = match () {
        () if !verdict.ok => ("error", "failed"),
        () if met("warning") => ("warning", "ok, with warnings"),
        () if met("known") => ("known", "ok, with known faults"),
        () => ("ok", "ok"),
    };
    let _ = write!(
        page,
        "<tr data-state=\"{state}\"><th scope=\"row\">{}</th><td class=\"{state}\">{label}</td><td>",
        text(&verdict.path)
    );
    if faults(verdict).next().is_some() {
        page.push_str("<ul>");
        faults(verdict).for_each(|check| fault(page, check));
        page.push_str("</ul>");
    }
    page.push_str("</td></tr>\n");
}

fn fault(page: &mut String, check: &Check) {
    let _ = write!(
        page,
        "<li><span class=\"{0}\">{0}</span> <code title=\"{1}\">{2}</code> {3}",
        word(check),
        text(meaning(check.rule)),
        check.rule,
        text(&check.detail)
    );
    if !check.places.is_empty() {
        let shown = check.places.len() as u64;
        let all = match check.found {
            Some(Figure::Count(count)) => count.max(shown),
            _ => shown,
        };
        let first = if all > shown {
            format!("the first {shown} of {all} places")
        } else {
            pluralise(shown, "place", "places")
        };
        let _ = write!(page, "<details><summary>{first}</summary><ol>");
        for one in &check.places {
            let _ = write!(page, "<li>{}</li>", text(&place(one)));
        }
        page.push_str("</ol></details>");
    } else {
        page.push_str(&text(&at(check)));
    }
    page.push_str("</li>");
}

/// A text without characters that take no place or turn the line around, escaped.
fn text(text: &str) -> String {
    let plain: String = text.chars().map(|c| if super::is_invisible(c) { '\u{fffd}' } else { c }).collect();
    escape(plain.as_str()).into_owned()
}
