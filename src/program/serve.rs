//! `meshsnap serve`: serves renders over HTTP.

use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs as _};
use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::settings::AllSettings;
use super::{files, isolation};
use crate::error::CliError;
use meshsnap_server::config::{self, Config, SETTINGS};
use meshsnap_server::durable::OpenError;
use meshsnap_server::http;
use meshsnap_server::http::ServeError;
use meshsnap_server::shared_store;
use meshsnap_server::telemetry;

/// Arguments of `serve`.
#[derive(Args)]
pub struct ServeArgs {
    /// TOML file with settings under the names of the flags
    #[arg(long, value_name = "FILE", env = "MESHSNAP_CONFIG", value_hint = ValueHint::FilePath)]
    config: Option<PathBuf>,
    #[command(flatten)]
    settings: AllSettings,
}

/// The end of `serve --help`: settings without a flag, and examples.
pub fn after_help() -> String {
    let mut text = String::from("Settings without a flag, because every user of the machine can read command lines:\n");
    for setting in SETTINGS.iter().filter(|setting| !setting.has_flag) {
        text += &format!(
            "  {}\n          {}, or `{}` in the file of --config\n",
            setting.variable(),
            setting.help,
            setting.key
        );
    }
    text + EXAMPLES
}

const EXAMPLES: &str = "
Every flag is also a variable (MESHSNAP_WORKERS for --workers) and a key of the file.

Examples:
  meshsnap serve
  meshsnap serve --listen 127.0.0.1:9000 --workers 4 --limit-body-bytes 16MiB
  MESHSNAP_API_KEYS=choose-one meshsnap serve --listen 0.0.0.0:8080";

/// Serves until a signal stops the process.
pub fn run(arguments: &ServeArgs) -> Result<(), CliError> {
    let config = resolve(arguments)?;
    telemetry::init(&config.log, config.log_json).map_err(|error| CliError::usage(format!("`log` {error}")))?;
    config.listen.to_socket_addrs().map_err(|error| {
        CliError::usage(format!("--listen {}: there is no such address on this machine ({error})", config.listen))
    })?;
    isolation::ahead(config.workers);
    let served = http::serve(&config, |address| announce(address, &config));
    telemetry::traces::finish();
    served.map_err(|error| match error {
        ServeError::Unprotected(_)
        | ServeError::Keys(_)
        | ServeError::WebhookSecret
        | ServeError::WebhooksCa(_)
        | ServeError::SharedQueue(_) => CliError::usage(error.to_string()),
        ServeError::Listen { error: ref cause, .. } if cause.kind() == ErrorKind::InvalidInput => {
            CliError::usage(error.to_string())
        }
        ServeError::Data(OpenError::InUse(_)) => CliError::usage(error.to_string()),
        ServeError::Shared(ref shared)
            if !matches!(shared, shared_store::OpenError::HandOver(_) | shared_store::OpenError::DataFolder(_)) =>
        {
            CliError::usage(error.to_string())
        }
        ServeError::Listen { .. } | ServeError::Data(_) | ServeError::Shared(_) | ServeError::Start(_) => {
            CliError::ours(error.to_string())
        }
    })
}

/// The configuration: flags override variables, these the file, and this the defaults.
fn resolve(arguments: &ServeArgs) -> Result<Config, CliError> {
    let mut config = Config::default();
    if let Some(path) = &arguments.config {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|error| CliError::usage(format!("{name}: the configuration cannot be read: {error}")))?;
        config.apply_toml(&name, &text).map_err(|error| CliError::usage(error.to_string()))?;
    }
    for setting in SETTINGS.iter().filter(|s| !s.has_flag) {
        let variable = setting.variable();
        if let Some(value) = std::env::var(&variable).ok().filter(|v| !v.is_empty() || !setting.may_be_empty()) {
            config.apply(&variable, setting.key, &value).map_err(|error| CliError::usage(error.to_string()))?;
        }
    }
    for (key, value) in arguments.settings.given() {
        config.apply("the command line", key, value).map_err(|error| CliError::usage(error.to_string()))?;
    }
    if config.data_dir.is_none() && !config.ephemeral {
        let sentence = "there is no home folder to keep jobs in: say --data-dir DIR, or --ephemeral to store nothing";
        config.data_dir = Some(config::default_data_dir().ok_or_else(|| CliError::usage(sentence))?);
    }
    Ok(config)
}

/// Prints two lines for the user: the address, and a command to try it with.
fn announce(address: SocketAddr, config: &Config) {
    let host = match address {
        // The address that stands for all interfaces cannot be connected to everywhere.
        _ if address.ip().is_unspecified() => format!("127.0.0.1:{}", address.port()),
        _ => address.to_string(),
    };
    let key = if config.api_keys.is_empty() && config.api_keys_file.is_none() {
        ""
    } else {
        " -H \"Authorization: Bearer $KEY\""
    };
    let lines = format!(
        "listening on http://{address}\n\
         curl{key} --data-binary @api/examples/knot.obj 'http://{host}/v1/render?style=wire' -o out.png\n"
    );
    // Serve even if standard output is closed.
    let _ = files::print(lines.as_bytes());
}
