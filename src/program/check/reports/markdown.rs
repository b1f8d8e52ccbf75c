//! The report of `meshsnap check` in Markdown, for a comment on a pull request: tables of the faults, of the changes
//! since a commit, and of the pictures of files that fail. Rows that would make the comment too long are left out.

use std::fmt::Write as _;

use percent_encoding::{AsciiSet, utf8_percent_encode};

use super::text::at;
use super::{Findings, faults, is_invisible, word};
use crate::check::SEGMENT;
use meshsnap_inspect::check::{Check, Verdict};
use meshsnap_render::pluralise::pluralise;

/// Most bytes of the report: a comment on GitHub has at most 65,536 characters.
const BYTES_MAX: usize = 60_000;

/// Bytes that are escaped in the path of a picture.
const PATH: &AsciiSet = &SEGMENT.remove(b'/');

/// The width of a picture in the table, pixels.
const THUMBNAIL_PX: u32 = 160;

/// Most characters of a text in a cell, before they are escaped.
const CELL_CHARS_MAX: usize = 300;

/// The report: a heading with the counts, and a row for each broken rule. Files that fail come first.
pub fn markdown(findings: &Findings<'_>) -> String {
    let (files, failed) = (findings.files(), findings.failed());
    let all = pluralise(files as u64, "file", "files");
    let mut text = match failed {
        0 => format!("### meshsnap check: {all} ok\n"),
        failed => format!("### meshsnap check: {failed} of {all} failed\n"),
    };
    if findings.known() > 0 {
        let known = pluralise(findings.known() as u64, "known fault fails", "known faults fail");
        let _ = writeln!(text, "\n{known} nothing.");
    }
    let is_failed = |verdict: &&Verdict| !verdict.ok;
    let (bad, good): (Vec<_>, Vec<_>) = findings.verdicts.iter().partition(is_failed);
    let rows: Vec<(&Verdict, &Check)> =
        bad.into_iter().chain(good).flat_map(|verdict| faults(verdict).map(move |check| (verdict, check))).collect();
    if !rows.is_empty() {
        text += "\n| file | level | rule | fault |\n|---|---|---|---|\n";
    }
    let mut left = rows.as_slice();
    while let Some(((verdict, check), rest)) = left.split_first() {
        let fault = prose(&format!("{}{}", check.detail, at(check)));
        let row = format!("| {} | {} | `{}` | {fault} |\n", name(&verdict.path), word(check), check.rule);
        if text.len() + row.len() > BYTES_MAX {
            break;
        }
        text += &row;
        left = rest;
    }
    if !left.is_empty() {
        let more = pluralise(left.len() as u64, "fault is", "faults are");
        let _ = writeln!(text, "\n{more} left out here, for the size of a comment.");
    }
    changes(findings, &mut text);
    thumbnails(findings, &mut text);
    if findings.lost > 0 {
        let lost = pluralise(findings.lost as u64, "file has", "files have");
        let _ = writeln!(text, "\n{lost} no verdict, by a fault of meshsnap.");
    }
    text
}

/// A table of the changes since a commit, as far as there is room.
fn changes(findings: &Findings<'_>, text: &mut String) {
    let said = |verdict: &Verdict| verdict.changes.as_ref().is_some_and(|changes| !changes.is_empty());
    let mut left = findings.verdicts.iter().filter(|verdict| said(verdict)).peekable();
    if left.peek().is_none() {
        return;
    }
    *text += "\n| file | changed |\n|---|---|\n";
    let mut left_out = 0;
    for verdict in left {
        let sentences: Vec<String> = verdict.changes.iter().flatten().map(|change| prose(change)).collect();
        let row = format!("| {} | {} |\n", name(&verdict.path), sentences.join("<br>"));
        match text.len() + row.len() > BYTES_MAX {
            true => left_out += 1,
            false => *text += &row,
        }
    }
    if left_out > 0 {
        let more = pluralise(left_out, "changed file is", "changed files are");
        let _ = writeln!(text, "\n{more} left out here, for the size of a comment.");
    }
}

/// A table of the pictures that were written of files that fail, as far as there is room.
fn thumbnails(findings: &Findings<'_>, text: &mut String) {
    let shown = || findings.verdicts.iter().filter(|verdict| !verdict.ok && !verdict.pictures.is_empty());
    let Some(first) = shown().next() else { return };
    let views: Vec<&str> = first.pictures.keys().copied().collect();
    let head = format!("\n| file | {} |\n|---|{}\n", views.join(" | "), "---|".repeat(views.len()));
    if text.len() + head.len() > BYTES_MAX {
        return;
    }
    *text += &head;
    let mut left = 0;
    for verdict in shown() {
        let cells = verdict.pictures.iter().map(|(view, path)| {
            format!(
                " <img src=\"{}\" width=\"{THUMBNAIL_PX}\" alt=\"{view} of {}\"> |",
                utf8_percent_encode(path, PATH),
                prose(&verdict.path)
            )
        });
        let row = format!("| {} |{}\n", name(&verdict.path), cells.collect::<String>());
        match text.len() + row.len() > BYTES_MAX {
            true => left += 1,
            false => *text += &row,
        }
    }
    if left > 0 {
        let more = pluralise(left, "file has pictures", "files have pictures");
        let _ = writeln!(text, "\n{more} that are left out here, for the size of a comment.");
    }
}

/// A name as code, where nothing is a link, a mention or a column.
fn name(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+ ".contains(c);
    let text = cut(text);
    match text.chars().all(is_plain) && text == text.trim() && !text.is_empty() {
        true => format!("`{text}`"),
        false => format!("<code>{}</code>", escaped(&text)),
    }
}

/// A sentence, in which nothing is markup, a link or a mention.
fn prose(text: &str) -> String {
    escaped(&cut(text))
}

fn cut(text: &str) -> String {
    let mut cut: String = text.chars().take(CELL_CHARS_MAX).collect();
    if cut.len() < text.len() {
        cut.push('…');
    }
    cut
}

/// A text with character references for all that Markdown, HTML or a code host gives a meaning.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            c if c.is_whitespace() => out.push(' '),
            c if is_invisible(c) => out.push('\u{fffd}'),
            c if !c.is_ascii() || c.is_ascii_alphanumeric() => out.push(c),
            ' ' | ',' | ';' | '(' | ')' | '\'' | '/' | '-' => out.push(c),
            // `www.` and `://` would begin a link.
            '.' if !out.to_ascii_lowercase().ends_with("www") => out.push(c),
            ':' if chars.peek() != Some(&'/') => out.push(c),
            // An empty character keeps `@name` and `#1` from being a mention.
            '@' | '#' => {
                let _ = write!(out, "&#{};&#8203;", u32::from(c));
            }
            c => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshsnap_inspect::check::unopened;
    use percent_encoding::percent_decode_str;

    #[test]
    fn names_and_sentences_are_no_markup() {
        assert_eq!(name("parts/a b-1.obj"), "`parts/a b-1.obj`");
        let cases = [
            ("a|b", "a&#124;b"),
            ("`x`\n# y", "&#96;x&#96; &#35;&#8203; y"),
            ("<img src=x>", "&#60;img src&#61;x&#62;"),
            ("[a](b)", "&#91;a&#93;(b)"),
            ("@all see #12", "&#64;&#8203;all see &#35;&#8203;12"),
            ("https://x.y WWW.x", "https&#58;//x.y WWW&#46;x"),
            ("a\u{202e}b", "a\u{fffd}b"),
            ("4 open edges in 1 loop; at (0, -1.5, 0)", "4 open edges in 1 loop; at (0, -1.5, 0)"),
        ];
        for (text, expected) in cases {
            assert_eq!(prose(text), expected, "{text}");
        }
        assert_eq!(name("a|b"), "<code>a&#124;b</code>");
        assert!(prose(&"é".repeat(1000)).ends_with("é…"));
    }

    #[test]
    fn a_path_of_a_picture_keeps_slashes_and_unreserved_characters() {
        for byte in 0..=0x7f_u8 {
            let text = char::from(byte).to_string();
            let escaped = utf8_percent_encode(&text, PATH).to_string();
            let is_kept = byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte);
            assert_eq!(escaped, if is_kept { text } else { format!("%{byte:02X}") });
        }
        let text = "pictures/a b\"<é>.png";
        let escaped = utf8_percent_encode(text, PATH).to_string();
        assert_eq!(escaped, "pictures/a%20b%22%3C%C3%A9%3E.png");
        assert_eq!(percent_decode_str(&escaped).decode_utf8().unwrap(), text);
    }

    #[test]
    fn the_size_is_bounded_and_the_rest_counted() {
        let of = |n: usize| {
            let path = format!("{n}{}", "|".repeat(100));
            Verdict::new(path, None, vec![unopened("x".repeat(500))])
        };
        let verdicts: Vec<_> = (0..2000).map(of).collect();
        let text = markdown(&Findings { verdicts: &verdicts, pictures: &[], lost: 1 });
        assert!(text.starts_with("### meshsnap check: 2001 of 2001 files failed\n"), "{}", &text[..200]);
        assert!(text.len() < 65_536, "{}", text.len());
        let rows = text.lines().filter(|line| line.starts_with("| <code>")).count();
        assert!(rows > 40 && text.contains(&format!("\n{} faults are left out", 2000 - rows)), "{rows}");
        assert!(text.ends_with("1 file has no verdict, by a fault of meshsnap.\n"));
    }
}
