//! `meshsnap check`: judges mesh files by rules.

mod baseline;
mod changes;
mod config;
mod pictures;
mod reports;
mod run;
mod since;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum, ValueHint};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC};

use super::format_arg::FormatArg;
use super::settings::LimitSettings;
use super::{isolation, render};
use crate::error::CliError;
use baseline::Baseline;
use config::{Config, unknown_view};
use meshsnap_inspect::check::{NAMES, RuleSet};
use meshsnap_render::import::Format;
use pictures::view_of;
use reports::ReportArgs;
use run::Run;

/// Bytes that are escaped in a segment of a URI: all but unreserved ones (RFC 3986, 2.3).
const SEGMENT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Examples at the end of `--help`.
pub const EXAMPLES: &str = "\
Examples:
  meshsnap check parts/
  meshsnap check 'parts/*.stl' --rules opens,watertight,max-triangles:200000 --warn has-normals
  meshsnap check model.obj --rules uv-no-overlap,bounds:100,100,50 --format jsonl
  meshsnap check parts/ --baseline .meshsnap --update
  meshsnap check parts/ --views iso,front --html page.html
  meshsnap check parts/ --since origin/main --sarif faults.sarif --markdown comment.md

A file that cannot be read fails, whatever the rules. Exit codes: 0 every file obeys its rules of level
error, 1 one does not, 2 the command line is at fault, 3 meshsnap or the machine is.";

/// Arguments of `check`.
#[derive(Args)]
pub struct CheckArgs {
    #[arg(
        required = true,
        value_name = "PATH",
        value_hint = ValueHint::AnyPath,
        help = format!("Mesh files ({}, or a .zip of one with what it refers to), folders and patterns", Format::list())
    )]
    paths: Vec<String>,
    #[arg(
        long,
        value_name = "RULE,...",
        value_hint = ValueHint::Other,
        help = "Rules that fail a file [default: opens, and no-warnings as a warning]",
        long_help = format!(
            "Rules that fail a file. {}, which take a number: max-triangles:200000, bounds:10,10,2.5 (x, y and z in \
             the file's units). `no-warnings` warns in either list [default: opens, and no-warnings as a warning]",
            NAMES.join(", ").replace("max-triangles", "and max-triangles")
        )
    )]
    rules: Vec<String>,
    /// Rules that are told when broken, and fail nothing
    #[arg(long, value_name = "RULE,...", value_hint = ValueHint::Other)]
    warn: Vec<String>,
    /// File with the rules [default: meshsnap.toml in this folder or above]
    ///
    /// File with the rules; --rules and --warn override all that it says [default: meshsnap.toml in this folder
    /// or the nearest above it]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    config: Option<PathBuf>,
    /// text for people, jsonl: a verdict on each line
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t = Output::Text)]
    format: Output,
    /// Folder of accepted faults, which do not fail again [default: that of meshsnap.toml]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    baseline: Option<PathBuf>,
    /// Accept the faults that there are now: write them into the baseline
    #[arg(long)]
    update: bool,
    /// Check only the meshes that changed since a commit, by the program `git`, and say what changed in each
    #[arg(long, value_name = "REF", value_hint = ValueHint::Other)]
    since: Option<String>,
    /// Views of pictures in reports and baselines: iso, front, ... [default: those of meshsnap.toml]
    #[arg(long, value_name = "VIEW,...", value_delimiter = ',', value_hint = ValueHint::Other)]
    views: Vec<String>,
    /// Folder for the pictures as files, which --markdown shows
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    reports: ReportArgs,
    /// List all places of faults, not the first 20 of each rule
    ///
    /// List all places of faults in JSON and in the baseline, not the first 20 of each rule: at most 100,000 for a file
    #[arg(long)]
    all_places: bool,
    /// Files that are read at once [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), value_hint = ValueHint::Other)]
    jobs: Option<u16>,
    /// Read the files that a mesh refers to from its own folder, though they are not named
    #[arg(long)]
    siblings: bool,
    #[command(flatten)]
    format_in: FormatArg,
    #[command(flatten)]
    limits: LimitSettings,
}

/// The form of the verdicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Output {
    /// Lines for people.
    Text,
    /// JSON Lines.
    Jsonl,
}

/// Judges all files and prints the verdicts, in the order of their paths.
pub fn run(arguments: &CheckArgs) -> Result<(), CliError> {
    isolation::on_demand();
    let config = config(arguments)?;
    if arguments.paths.iter().any(|path| path == "-") {
        return Err(CliError::usage("`-`, standard input, is no file that can be checked: name files and folders"));
    }
    let mut tasks = render::find(&arguments.paths, "png")?;
    tasks.all.sort_by(|a, b| a.mesh.cmp(&b.mesh));
    let commit = match &arguments.since {
        Some(reference) => Some(since::keep_changed(&mut tasks, reference)?),
        None => None,
    };
    let folder = arguments.baseline.clone().or_else(|| config.baseline().map(Path::to_owned));
    if arguments.update && folder.is_none() {
        let sentence = "--update needs a baseline: give --baseline DIR, or [check.baseline] in meshsnap.toml";
        return Err(CliError::usage(sentence));
    }
    let named = arguments
        .views
        .iter()
        .map(|name| view_of(name.trim()).ok_or_else(|| CliError::usage(format!("--views: {}", unknown_view(name)))));
    let named = named.collect::<Result<Vec<_>, _>>()?;
    let views = if named.is_empty() { config.views().to_vec() } else { named };
    if arguments.pictures.is_some() && views.is_empty() {
        let sentence = "--pictures needs views: give --views iso,front, or `views` in meshsnap.toml";
        return Err(CliError::usage(sentence));
    }
    let baseline = folder.map(|folder| Baseline::new(folder, config.root()));
    Run::new(arguments, config, tasks, baseline).since(commit).with_pictures(&views)?.all()
}

/// The rules of the command line, or else of a file.
fn config(arguments: &CheckArgs) -> Result<Config, CliError> {
    if arguments.rules.is_empty() && arguments.warn.is_empty() {
        return Config::find(arguments.config.as_deref());
    }
    let split = |lists: &[String]| lists.iter().flat_map(|list| RuleSet::split(list)).collect::<Vec<_>>();
    let (errors, warnings) = (split(&arguments.rules), split(&arguments.warn));
    RuleSet::parse(errors.iter().map(String::as_str), warnings.iter().map(String::as_str))
        .map(Config::of)
        .map_err(|error| CliError::usage(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use percent_encoding::{percent_decode_str, utf8_percent_encode};

    #[test]
    fn a_segment_keeps_unreserved_characters_alone() {
        for byte in 0..=0x7f_u8 {
            let text = char::from(byte).to_string();
            let escaped = utf8_percent_encode(&text, SEGMENT).to_string();
            let is_kept = byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
            assert_eq!(escaped, if is_kept { text } else { format!("%{byte:02X}") });
        }
        let text = "a b/c:d é.stl";
        let escaped = utf8_percent_encode(text, SEGMENT).to_string();
        assert_eq!(escaped, "a%20b%2Fc%3Ad%20%C3%A9.stl");
        assert_eq!(percent_decode_str(&escaped).decode_utf8().unwrap(), text);
    }
}
