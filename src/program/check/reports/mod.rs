//! The reports of `meshsnap check` that are written to files, as JUnit XML, SARIF, Markdown, HTML
//! or JSON Lines. All are made of the same verdicts; a verdict is the result of the checks of one
//! file.
//!
//! Equal verdicts and pictures make equal bytes: no report has the time of the run, its duration or
//! the name of the machine.

mod html;
mod junit;
mod markdown;
mod sarif;
pub mod text;

use clap::{Args, ValueHint};

use super::pictures::ViewPictures;
use crate::error::CliError;
use crate::output::{Destination, Inputs};
use meshsnap_inspect::check::{Check, Level, Verdict};

/// Arguments that name files for reports.
#[derive(Args)]
pub struct ReportArgs {
    /// File for the verdicts as JUnit XML, too
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    junit: Option<String>,
    /// File for the faults as SARIF 2.1.0, by which code hosts annotate files, too
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    sarif: Option<String>,
    /// File for a table in Markdown, for a comment on a pull request, too
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    markdown: Option<String>,
    /// File for the verdicts as one page that needs no network, too
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    html: Option<String>,
    /// File for the verdicts as JSON Lines, too
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    jsonl: Option<String>,
}

impl ReportArgs {
    /// True if a page is asked for, which shows pictures.
    pub fn has_page(&self) -> bool {
        self.html.is_some()
    }
}

/// All that a run has found.
#[derive(Clone, Copy, Debug)]
pub struct Findings<'a> {
    /// The verdicts, in the order of their paths.
    pub verdicts: &'a [Verdict],
    /// The pictures of each verdict; none where no report shows them.
    pub pictures: &'a [Vec<ViewPictures>],
    /// Files without a verdict, by a fault of ours.
    pub lost: usize,
}

impl Findings<'_> {
    /// The number of files.
    fn files(&self) -> usize {
        self.verdicts.len() + self.lost
    }

    /// The number of accepted faults.
    pub fn known(&self) -> usize {
        self.verdicts.iter().flat_map(|verdict| &verdict.checks).filter(|check| check.known).count()
    }

    /// The number of files that are not ok.
    pub fn failed(&self) -> usize {
        self.verdicts.iter().filter(|verdict| !verdict.ok).count() + self.lost
    }
}

/// A function that writes a report.
type Write = fn(&Findings<'_>) -> Result<String, CliError>;

/// The reports of a run, with their places.
pub struct Reports(Vec<Report>);

struct Report {
    name: String,
    destination: Destination,
    write: Write,
}

impl Reports {
    /// The reports that are asked for. None of them may be a file that is read, nor another report.
    pub fn new(arguments: &ReportArgs, inputs: &Inputs) -> Result<Self, CliError> {
        let ReportArgs { junit, sarif, markdown, html, jsonl } = arguments;
        let kinds: [(&str, &Option<String>, Write); 5] = [
            ("--junit", junit, |findings| Ok(junit::junit(findings.verdicts))),
            ("--sarif", sarif, sarif::sarif),
            ("--markdown", markdown, |findings| Ok(markdown::markdown(findings))),
            ("--html", html, |findings| Ok(html::html(findings))),
            ("--jsonl", jsonl, |findings| findings.verdicts.iter().map(json_line).collect()),
        ];
        let mut reports: Vec<Report> = Vec::new();
        for (flag, name, write) in kinds {
            let Some(name) = name else { continue };
            if name == "-" {
                return Err(CliError::usage(format!("{flag} -: standard output has the verdicts; name a file")));
            }
            let destination = Destination::new(name, inputs)?;
            if reports.iter().any(|other| other.destination.is_same_file(&destination)) {
                return Err(CliError::usage(format!("{flag} {name}: another report goes to this file")));
            }
            reports.push(Report { name: name.clone(), destination, write });
        }
        Ok(Self(reports))
    }

    /// Writes all.
    pub fn write(&self, findings: &Findings<'_>) -> Result<(), CliError> {
        self.0.iter().try_for_each(|report| {
            let text = (report.write)(findings)?;
            report.destination.write(&report.name, text.as_bytes())
        })
    }
}

/// A verdict as a line of JSON.
pub fn json_line(verdict: &Verdict) -> Result<String, CliError> {
    verdict.json().map_err(|error| CliError::ours(error.to_string()))
}

/// The weight of a fault, in a word.
fn word(check: &Check) -> &'static str {
    match check.level {
        _ if check.known => "known",
        Level::Error => "error",
        Level::Warn => "warning",
    }
}

/// The faults of a file.
fn faults(verdict: &Verdict) -> impl Iterator<Item = &Check> {
    verdict.checks.iter().filter(|check| !check.ok)
}

/// Characters that take no place or change the direction of the text: they could make a name look like another.
fn is_invisible(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{ad}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}
