//! Makes command-line arguments of the table of settings.

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

use crate::config::{Access, Config, SETTINGS, Setting};

/// The settings of `serve`, given by flags and environment variables.
#[derive(Clone, Debug, Default)]
pub struct AllSettings(Given);

/// The settings of `render` and `inspect`: those whose names begin with `limit-`, except the limits
/// of jobs.
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
    setting.key.starts_with("limit-") && !setting.key.starts_with("limit-queue") && setting.key != "limit-job-ms"
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
            .help(format!("{}{shown}", setting.help));
        match setting.access {
            Access::Switch(_) => argument.num_args(0..=1).require_equals(true).default_missing_value("true"),
            Access::Number(..) => argument.value_name("N").action(ArgAction::Set),
            Access::Text(..) => argument.value_name("VALUE").action(ArgAction::Set),
        }
    }))
}

fn collect(matches: &ArgMatches, settings: impl Iterator<Item = &'static Setting>) -> Result<Given, clap::Error> {
    let mut given = Vec::new();
    for setting in settings {
        let Some(value) = matches.get_one::<String>(setting.key) else { continue };
        let from_variable = matches.value_source(setting.key) == Some(ValueSource::EnvVariable);
        if from_variable && value.is_empty() {
            continue; // compose files write an empty variable for one that is not set
        }
        let source = if from_variable { setting.variable() } else { "the command line".to_owned() };
        let checked = Config::default().apply(&source, setting.key, value);
        checked.map_err(|error| clap::Error::raw(ErrorKind::ValueValidation, format!("{error}\n")))?;
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
