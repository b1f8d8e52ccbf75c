//! `meshsnap.toml`, the configuration of `meshsnap check` in a repository: the rules for all meshes, other rules for
//! files that fit a glob, the folder of accepted faults, and the views of pictures.

use std::ops::Range;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::pictures::view_of;
use crate::bundle::comparable;
use crate::error::CliError;
use crate::files;
use meshsnap_inspect::check::{RuleSet, UnknownRule};
use meshsnap_render::request::words_of;
use meshsnap_render::spec::NamedView;

/// The name that is looked for.
const NAME: &str = "meshsnap.toml";

/// The largest file that is read, bytes.
const BYTES_MAX: u64 = 1 << 20;

/// The keys of `[check]`, of `[[check.files]]` and of `[check.baseline]`.
const KEYS: [&str; 5] = ["rules", "warn", "views", "files", "baseline"];
const FILE_KEYS: [&str; 3] = ["glob", "rules", "warn"];
const BASELINE_KEYS: [&str; 1] = ["dir"];

/// Rules for all files.
#[derive(Debug)]
pub struct Config {
    /// The file; none for rules of a command.
    path: Option<PathBuf>,
    /// The folder that globs begin at.
    folder: PathBuf,
    rules: RuleSet,
    /// Rules of the files that a glob fits; of several, the last counts.
    of_files: Vec<(Pattern, RuleSet)>,
    /// The folder of accepted faults.
    baseline: Option<PathBuf>,
    /// The views of pictures in reports.
    views: Vec<NamedView>,
}

impl Config {
    /// The same rules for every file.
    pub fn of(rules: RuleSet) -> Self {
        Self { path: None, folder: PathBuf::new(), rules, of_files: Vec::new(), baseline: None, views: Vec::new() }
    }

    /// Reads the file that is named, or else the one in the current folder or the nearest above it, or else
    /// gives the default rules.
    pub fn find(named: Option<&Path>) -> Result<Self, CliError> {
        let path = match named {
            Some(path) => path.to_owned(),
            None => {
                let current = std::env::current_dir().unwrap_or_default();
                let mut all = current.ancestors().map(|folder| folder.join(NAME));
                let Some(path) = all.find(|path| path.is_file()) else { return Ok(Self::of(RuleSet::default())) };
                path
            }
        };
        let name = path.display().to_string();
        let of_command = |error: CliError| CliError { exit_code: 2, ..error };
        let bytes = files::read(&name, BYTES_MAX).map_err(of_command)?;
        let text = std::str::from_utf8(&bytes).map_err(|_| CliError::usage(format!("{name}: is not UTF-8")))?;
        let folder = comparable(&path).parent().unwrap_or(Path::new("")).to_owned();
        let config = read(text, folder).map_err(|Mistake { at, detail }| {
            let before = &text.as_bytes()[..at.min(text.len())];
            let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
            let start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |newline| newline + 1);
            let column = String::from_utf8_lossy(&before[start..]).chars().count() + 1;
            CliError::usage(format!("{name}, line {line}, column {column}: {detail}"))
        })?;
        Ok(Self { path: Some(path), ..config })
    }

    /// The file that the rules come from.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The folder of accepted faults.
    pub fn baseline(&self) -> Option<&Path> {
        self.baseline.as_deref()
    }

    /// The views of pictures in reports.
    pub fn views(&self) -> &[NamedView] {
        &self.views
    }

    /// The folder to which accepted faults belong: that of the file, or the current one.
    pub fn root(&self) -> &Path {
        if self.folder.as_os_str().is_empty() { Path::new(".") } else { &self.folder }
    }

    /// The rules of a file.
    pub fn rules_of(&self, path: &Path) -> &RuleSet {
        let absolute = comparable(path);
        let relative = absolute.strip_prefix(&self.folder).unwrap_or(&absolute);
        let options = MatchOptions { require_literal_separator: true, ..MatchOptions::default() };
        let last = self.of_files.iter().rev().find(|(glob, _)| glob.matches_path_with(relative, options));
        last.map_or(&self.rules, |(_, rules)| rules)
    }
}

/// A mistake in the file, and where it is, in bytes.
struct Mistake {
    at: usize,
    detail: String,
}

fn mistake(span: Range<usize>, detail: impl Into<String>) -> Mistake {
    Mistake { at: span.start, detail: detail.into() }
}

type Value<'t> = Spanned<DeValue<'t>>;

/// Texts with their places.
type Texts = Vec<(String, Range<usize>)>;

fn read(text: &str, folder: PathBuf) -> Result<Config, Mistake> {
    let root =
        DeTable::parse(text).map_err(|error| mistake(error.span().unwrap_or_default(), error.message().to_owned()))?;
    check_keys(root.get_ref(), &["check"])?;
    let mut config = Config::of(RuleSet::default());
    config.folder = folder;
    let Some(check) = root.get_ref().get("check") else { return Ok(config) };
    let DeValue::Table(table) = check.get_ref() else {
        return Err(mistake(check.span(), "`check` is a table: [check]"));
    };
    check_keys(table, &KEYS)?;
    let rules = table.get("rules").map(texts).transpose()?;
    let warn = table.get("warn").map(texts).transpose()?;
    if rules.is_some() || warn.is_some() {
        config.rules = rule_set(rules.as_ref(), warn.as_ref())?;
    }
    config.baseline = table.get("baseline").map(baseline).transpose()?.map(|dir| config.folder.join(dir));
    for (name, span) in table.get("views").map(texts).transpose()?.unwrap_or_default() {
        config.views.push(view_of(&name).ok_or_else(|| mistake(span, unknown_view(&name)))?);
    }
    for file in table.get("files").map(list).transpose()?.unwrap_or_default() {
        let DeValue::Table(table) = file.get_ref() else {
            return Err(mistake(file.span(), "`files` has tables: [[check.files]]"));
        };
        check_keys(table, &FILE_KEYS)?;
        let Some(glob) = table.get("glob") else { return Err(mistake(file.span(), "[[check.files]] needs a `glob`")) };
        let pattern = Pattern::new(&word(glob)?.0).map_err(|e| mistake(glob.span(), format!("is no pattern: {e}")))?;
        let own = |key: &str| table.get(key).map(texts).transpose();
        let set = rule_set(own("rules")?.as_ref().or(rules.as_ref()), own("warn")?.as_ref().or(warn.as_ref()))?;
        config.of_files.push((pattern, set));
    }
    Ok(config)
}

/// The sentence about a word that is no view.
pub fn unknown_view(name: &str) -> String {
    let given: String = name.chars().take(60).collect();
    format!("there is no view `{given}`; the views are {}", words_of::<NamedView>().join(", "))
}

/// The folder of `[check.baseline]`.
fn baseline(value: &Value<'_>) -> Result<String, Mistake> {
    let DeValue::Table(table) = value.get_ref() else {
        return Err(mistake(value.span(), "`baseline` is a table: [check.baseline]"));
    };
    check_keys(table, &BASELINE_KEYS)?;
    let Some(dir) = table.get("dir") else { return Err(mistake(value.span(), "[check.baseline] needs a `dir`")) };
    Ok(word(dir)?.0)
}

/// Refuses keys that are not known.
fn check_keys(table: &DeTable<'_>, known: &[&'static str]) -> Result<(), Mistake> {
    let is_known = |key: &&Spanned<DeString<'_>>| known.contains(&key.get_ref().as_ref());
    let Some(key) = table.keys().find(|key| !is_known(key)) else { return Ok(()) };
    let given: String = key.get_ref().chars().take(60).collect();
    let distance = |known: &&'static str| strsim::damerau_levenshtein(&given, known);
    let near = known.iter().copied().min_by_key(distance).filter(|near| distance(near) <= 2);
    let near = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
    let detail = format!("there is no key `{given}`{near} (the keys here are {})", known.join(", "));
    Err(mistake(key.span(), detail))
}

fn list<'v, 't>(value: &'v Value<'t>) -> Result<Vec<&'v Value<'t>>, Mistake> {
    match value.get_ref() {
        DeValue::Array(list) => Ok(list.iter().collect()),
        _ => Err(mistake(value.span(), "a list is needed: [\"watertight\"]")),
    }
}

fn word(value: &Value<'_>) -> Result<(String, Range<usize>), Mistake> {
    match value.get_ref() {
        DeValue::String(text) => Ok((text.to_string(), value.span())),
        _ => Err(mistake(value.span(), "a text in quotes is needed")),
    }
}

fn texts(value: &Value<'_>) -> Result<Texts, Mistake> {
    list(value)?.into_iter().map(word).collect()
}

/// The rules of two lists. A mistake is told at the rule that makes it.
fn rule_set(rules: Option<&Texts>, warn: Option<&Texts>) -> Result<RuleSet, Mistake> {
    fn of(list: Option<&Texts>) -> &[(String, Range<usize>)] {
        list.map_or(&[], Vec::as_slice)
    }
    let parse = |rules: &[(String, Range<usize>)], warn: &[(String, Range<usize>)]| -> Result<RuleSet, UnknownRule> {
        RuleSet::parse(rules.iter().map(|(text, _)| text.as_str()), warn.iter().map(|(text, _)| text.as_str()))
    };
    let (rules, warn) = (of(rules), of(warn));
    parse(rules, warn).map_err(|error| {
        // The first list that fails ends with the rule that is wrong.
        let in_rules = (1..=rules.len()).find(|&n| parse(&rules[..n], &[]).is_err()).map(|n| &rules[n - 1]);
        let in_warn = || (1..=warn.len()).find(|&n| parse(rules, &warn[..n]).is_err()).map(|n| &warn[n - 1]);
        let span = in_rules.or_else(in_warn).map(|(_, span)| span.clone()).unwrap_or_default();
        mistake(span, error.to_string())
    })
}
