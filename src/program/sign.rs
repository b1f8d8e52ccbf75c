//! `meshsnap sign`: makes the address of a picture that can be seen without an API key for a while.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::Args;

use super::files;
use crate::error::CliError;
use meshsnap_server::config::Config;
use meshsnap_server::digest::Digest;
use meshsnap_server::signature;

/// Arguments of `sign`.
#[derive(Args)]
pub struct SignArgs {
    /// Address of a stored mesh's picture, such as http://HOST/v1/meshes/SHA256/render.png?style=wire
    url: String,
    /// Time after which it expires: 30s, 10m, 12h, 1d
    #[arg(long, value_name = "TIME", default_value = "1d", value_parser = humantime::parse_duration)]
    expires: Duration,
}

/// Prints the address with `exp` and `sig`. The key is the first of `MESHSNAP_API_KEYS`.
pub fn run(arguments: &SignArgs) -> Result<(), CliError> {
    let keys = std::env::var("MESHSNAP_API_KEYS").unwrap_or_default();
    let mut config = Config::default();
    config.apply("MESHSNAP_API_KEYS", "api-keys", &keys).map_err(|error| CliError::usage(error.to_string()))?;
    let key = config.api_keys.first().ok_or_else(|| CliError::usage("there is no key in MESHSNAP_API_KEYS"))?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let expires_unix_s = now.saturating_add(arguments.expires).as_secs();
    let url = arguments.url.as_str();
    // The host is no part of what is signed: a proxy may have another name.
    let path_at = url.find("://").map_or(Some(0), |at| url[at + 3..].find('/').map(|slash| at + 3 + slash));
    let path_at = path_at.filter(|&at| url[at..].starts_with("/v1/meshes/") && !url.contains(['#', ' ']));
    let Some(path_at) = path_at else {
        let sentence =
            format!("{url} is no address of a stored mesh's picture: [http://HOST]/v1/meshes/SHA256/render.png?...");
        return Err(CliError::usage(sentence));
    };
    let signed = signature::sign(&Digest::of(key.as_bytes()).to_string(), &url[path_at..], expires_unix_s);
    files::print(format!("{}{signed}\n", &url[..path_at]).as_bytes())
}
