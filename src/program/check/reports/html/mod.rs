//! The report of `meshsnap check` as one HTML page, which needs no network: a table of the files with a filter, and
//! for each file its faults, its changes and its pictures. Pictures that would make the page too large are left out.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use quick_xml::escape::escape;

use super::text::{at, place};
use super::{Findings, ViewPictures, faults, word};
use crate::check::pictures::Changed;
use meshsnap_inspect::check::{Check, Figure, PLACES_MAX, Verdict, meaning};
use meshsnap_inspect::report::significant;
use meshsnap_render::pluralise::pluralise;

const CSS: &str = include_str!("page.css");
const JS: &str = include_str!("page.js");

/// Nothing is loaded, and no other page can frame or change this one.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; \
                      base-uri 'none'; form-action 'none'";

/// Most bytes of pictures: a page that is larger opens slowly.
const PICTURES_BYTES_MAX: usize = 32 << 20;

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
        ("changed", "with changed pictures"),
    ] {
        let _ = writeln!(page, "<option value=\"{value}\">{label}</option>");
    }
    page += "</select></label>\n<span id=\"shown\" role=\"status\"></span>\n</form>\n";
    page += "<div class=\"table\" role=\"region\" aria-label=\"Files\" tabindex=\"0\">\n<table role=\"table\">\n\
             <thead role=\"rowgroup\">\n<tr role=\"row\">";
    let has_changes = findings.verdicts.iter().any(|verdict| verdict.changes.is_some());
    for name in ["File", "Verdict", if has_changes { "Faults and changes" } else { "Faults" }] {
        let _ = write!(page, "<th scope=\"col\" role=\"columnheader\">{name}</th>");
    }
    page += "</tr>\n</thead>\n<tbody role=\"rowgroup\">\n";
    let mut room = PICTURES_BYTES_MAX;
    let mut rows: Vec<(usize, &Verdict)> = findings.verdicts.iter().enumerate().collect();
    // Faults first, and otherwise in the order of the paths: sorting keeps it.
    rows.sort_by_key(|(_, verdict)| STATES.iter().position(|(state, _)| *state == state_of(verdict)));
    for (index, verdict) in rows {
        let pictures = findings.pictures.get(index).map(Vec::as_slice).unwrap_or_default();
        row(&mut page, verdict, pictures, &mut room);
    }
    let _ = write!(page, "</tbody>\n</table>\n</div>\n</main>\n<script>\n{JS}</script>\n</body>\n</html>\n");
    page
}

/// States of files with their labels, in the order of the rows.
const STATES: [(&str, &str); 4] =
    [("error", "failed"), ("warning", "ok, with warnings"), ("known", "ok, with known faults"), ("ok", "ok")];

fn state_of(verdict: &Verdict) -> &'static str {
    let met = |meant: &str| faults(verdict).any(|check| word(check) == meant);
    match () {
        () if !verdict.ok => "error",
        () if met("warning") => "warning",
        () if met("known") => "known",
        () => "ok",
    }
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

fn row(page: &mut String, verdict: &Verdict, pictures: &[ViewPictures], room: &mut usize) {
    let state = state_of(verdict);
    let label = STATES.iter().find(|(one, _)| *one == state).map_or("", |(_, label)| label);
    let _ = write!(
        page,
        "<tr data-state=\"{state}\" role=\"row\"><th scope=\"row\" role=\"rowheader\">{}</th>\
         <td class=\"{state}\" role=\"cell\">{label}</td><td class=\"faults\" role=\"cell\">",
        text(&verdict.path)
    );
    if faults(verdict).next().is_some() {
        page.push_str("<ul>");
        faults(verdict).for_each(|check| fault(page, check));
        page.push_str("</ul>");
    }
    if verdict.changes.is_some() {
        page.push_str("<ul class=\"changes\">");
        for change in verdict.changes.iter().flatten() {
            let _ = write!(page, "<li><span>changed</span> {}</li>", text(change));
        }
        page.push_str("</ul>");
    }
    views(page, &verdict.path, pictures, room);
    page.push_str("</td></tr>\n");
}

/// The pictures of a file, as far as there is room.
fn views(page: &mut String, path: &str, pictures: &[ViewPictures], room: &mut usize) {
    let bytes = |one: &ViewPictures| {
        let of_change = |changed: &Changed| changed.before.len() + changed.difference.as_ref().map_or(0, Vec::len);
        (one.after.len() + one.changed.as_ref().map_or(0, of_change)).div_ceil(3) * 4
    };
    if pictures.is_empty() {
        return;
    }
    if pictures.iter().map(bytes).sum::<usize>() > *room {
        page.push_str("<p class=\"left-out\">The pictures are left out, for the size of the page.</p>");
        return;
    }
    *room -= pictures.iter().map(bytes).sum::<usize>();
    page.push_str("<div class=\"views\">");
    for ViewPictures { view, after, changed } in pictures {
        if changed.is_some() {
            page.push_str("<div class=\"changed\">");
        }
        let mut figure = |kind: &str, png: &[u8]| {
            let data = STANDARD.encode(png);
            let caption = if kind.is_empty() { (*view).to_owned() } else { format!("{view}, {kind}") };
            let class = if kind.is_empty() { "after" } else { kind };
            let _ = write!(
                page,
                "<figure class=\"{class}\"><img src=\"data:image/png;base64,{data}\" width=\"160\" height=\"160\" \
                 alt=\"{caption}: {}\"><figcaption>{caption}</figcaption></figure>",
                text(path)
            );
        };
        let Some(Changed { before, difference, flip }) = changed else {
            figure("", after);
            continue;
        };
        figure("before", before);
        figure("after", after);
        if let Some(difference) = difference {
            figure("difference", difference);
        }
        let _ = write!(
            page,
            "<p class=\"change\">{view} changed by {} (FLIP, 0 to 1) <button type=\"button\" hidden \
             aria-pressed=\"false\" aria-label=\"Blink {view} of {}\">Blink</button></p></div>",
            significant(*flip, 2),
            text(path)
        );
    }
    page.push_str("</div>");
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
        let shown = check.places.len().min(PLACES_MAX) as u64;
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
        for one in check.places.iter().take(PLACES_MAX) {
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
