//! Command-line flags and their environment variables, made from the server's table of settings: for `serve` all
//! settings that may be flags, for the commands that read meshes only limits, without those of the service alone.

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, ValueHint};

use meshsnap_render::request::words_of;
use meshsnap_render::spec::BackendChoice;
use meshsnap_server::config::{Access, Config, SETTINGS, Setting};

/// The settings of `serve`, given by flags and environment variables.
#[derive(Clone, Debug, Default)]
pub struct AllSettings(Given);

/// The settings of `render`, `inspect`, `check` and `diff`: those whose names begin with `limit-`,
/// except the limits of the service.
#[derive(Clone, Debug, Default)]
pub struct LimitSettings(Given);

/// Keys and values, in the order of the table.
type Given = Vec<(&'static str, String)>;

impl AllSettings {
    /// Keys and values, which override those of a file.
    pub fn given(&self) -> &[(&'static str, String)] {
        &self.0
    }
}

impl LimitSettings {
    /// The defaults, overridden by the values that are given.
    pub fn config(&self) -> Config {
        let mut config = Config::default();
        for (key, value) in &self.0 {
            // Cannot fail: `collect` has applied the same value before.
            let _ = config.apply("the command line", key, value);
        }
        config
    }
}

fn is_limit(setting: &&Setting) -> bool {
    // Nothing waits here, and no request has a body: these are of the service alone.
    const OF_SERVICE: [&str; 2] = ["limit-body-bytes", "limit-job-ms"];
    setting.key.starts_with("limit-") && !OF_SERVICE.contains(&setting.key)
}

fn has_flag(setting: &&Setting) -> bool {
    setting.has_flag
}

fn augment(command: Command, settings: impl Iterator<Item = &'static Setting>) -> Command {
    let defaults = Config::default();
    command.args(settings.map(|setting| {
        let default = setting.show(&defaults);
        let shown = if default.is_empty() { String::new() } else { format!(" [default: {default}]") };
        let argument = Arg::new(setting.key)
            .long(setting.key)
            // clap needs static names; one small string per setting is leaked.
            .env(&*setting.variable().leak())
            .hide_env_values(true)
            .help_heading(heading(setting.key))
            .hide_short_help(!COMMON.contains(&setting.key))
            .help(format!("{}{shown}", setting.help));
        match setting.access {
            Access::Switch(_) => argument.num_args(0..=1).require_equals(true).default_missing_value("true"),
            Access::Number(..) => argument.value_name("N").action(ArgAction::Set).value_hint(ValueHint::Other),
            Access::Text(..) => values_of(setting.key, argument.value_name("VALUE").action(ArgAction::Set)),
        }
    }))
}

/// The settings that the short help shows.
const COMMON: &[&str] = &["listen", "workers", "queue", "backend", "no-auth", "log", "cache-dir"];

/// The heading of a setting in `--help`.
fn heading(key: &str) -> &'static str {
    match key {
        _ if key.starts_with("limit-") => "Limits",
        _ if key.starts_with("webhook") => "Webhooks",
        "log" | "log-format" => "Log",
        "workers" | "worker-threads" | "queue" | "backend" | "cache-dir" => "Drawing",
        "wait-ms" | "batch-wait-ms" | "overdue-grace-ms" | "drain-delay-ms" => "Times of jobs",
        "data-dir" | "ephemeral" | "result-ttl-ms" | "unfetched-ttl-ms" | "result-bytes" | "result-count"
        | "mesh-bytes" | "mesh-count" => "Storage",
        "memory-bytes" | "uploads-bytes" | "resident-bytes" | "picture-bytes" => "Memory",
        _ => "Connections",
    }
}

/// What a shell completes for a setting that is a text.
fn values_of(key: &str, argument: Arg) -> Arg {
    match key {
        "backend" => argument.value_parser(words_or_empty(&words_of::<BackendChoice>())),
        "log-format" => argument.value_parser(words_or_empty(&["auto", "text", "json"])),
        _ if key.ends_with("-file") => argument.value_hint(ValueHint::FilePath),
        _ if key.ends_with("-dir") => argument.value_hint(ValueHint::DirPath),
        _ => argument.value_hint(ValueHint::Other),
    }
}

/// Words, and the empty text: compose files write an empty variable for one that is not set.
fn words_or_empty(words: &[&'static str]) -> PossibleValuesParser {
    let words = words.iter().map(|&word| PossibleValue::new(word));
    PossibleValuesParser::new(words.chain([PossibleValue::new("").hide(true)]))
}

fn collect(matches: &ArgMatches, settings: impl Iterator<Item = &'static Setting>) -> Result<Given, clap::Error> {
    let mut given = Vec::new();
    for setting in settings {
        let Some(value) = matches.get_one::<String>(setting.key) else { continue };
        let from_variable = matches.value_source(setting.key) == Some(ValueSource::EnvVariable);
        if from_variable && value.is_empty() && setting.may_be_empty() {
            continue; // compose files write an empty variable for one that is not set
        }
        let source = setting.variable();
        setting.set(&mut Config::default(), value).map_err(|allowed| {
            let name = if from_variable { source } else { format!("--{}", setting.key) };
            let sentence = format!("{name} is \"{value}\", and allowed is {allowed}\n");
            clap::Error::raw(ErrorKind::ValueValidation, sentence)
        })?;
        given.push((setting.key, value.clone()));
    }
    Ok(given)
}

impl FromArgMatches for AllSettings {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        collect(matches, SETTINGS.iter().filter(has_flag)).map(Self)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for AllSettings {
    fn augment_args(command: Command) -> Command {
        augment(command, SETTINGS.iter().filter(has_flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for LimitSettings {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        collect(matches, SETTINGS.iter().filter(is_limit)).map(Self)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for LimitSettings {
    fn augment_args(command: Command) -> Command {
        augment(command, SETTINGS.iter().filter(is_limit))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}
