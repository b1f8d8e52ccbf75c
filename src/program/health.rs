//! `meshsnap health`: asks a running server whether it is healthy.

use std::time::Duration;

use clap::Args;

use crate::error::CliError;

/// Arguments of `health`.
#[derive(Args)]
pub struct HealthArgs {
    /// URL to ask [default: /healthz at the port of MESHSNAP_LISTEN, or
    /// http://127.0.0.1:8080/healthz]
    url: Option<String>,
}

/// Succeeds if the server answers 200 within three seconds.
pub fn run(arguments: &HealthArgs) -> Result<(), CliError> {
    let url = full_url(arguments.url.as_deref(), std::env::var("MESHSNAP_LISTEN").ok().as_deref());
    let agent = ureq::Agent::config_builder().timeout_global(Some(Duration::from_secs(3))).build().new_agent();
    match agent.get(&url).call() {
        Ok(_) => Ok(()),
        Err(error) => Err(CliError::input(format!("{url}: not healthy: {error}"))),
    }
}

fn full_url(given: Option<&str>, listen: Option<&str>) -> String {
    let port = listen.and_then(|l| l.rsplit_once(':')).map_or("8080", |(_, port)| port);
    let base = given.map_or_else(|| format!("http://127.0.0.1:{port}"), str::to_owned);
    let base = if base.contains("://") { base } else { format!("http://{base}") };
    let has_path = base.split_once("://").is_some_and(|(_, rest)| rest.trim_end_matches('/').contains('/'));
    if has_path { base } else { format!("{}/healthz", base.trim_end_matches('/')) }
}

#[cfg(test)]
mod tests {
    use super::full_url;

    #[test]
    fn a_path_is_added_where_there_is_none() {
        let cases = [
            (None, None, "http://127.0.0.1:8080/healthz"),
            (None, Some("0.0.0.0:9000"), "http://127.0.0.1:9000/healthz"),
            (Some("http://h:1"), Some("0.0.0.0:9000"), "http://h:1/healthz"),
            (Some("http://h:1/"), None, "http://h:1/healthz"),
            (Some("h:1"), None, "http://h:1/healthz"),
            (Some("http://h:1/readyz"), None, "http://h:1/readyz"),
        ];
        for (given, listen, expected) in cases {
            assert_eq!(full_url(given, listen), expected);
        }
    }
}
