//! The `meshsnap` binary: arguments to `serve`, `render`, `inspect` or `health`.

use std::net::SocketAddr;
use std::process::ExitCode;

use meshsnap::cli::{self, Complaint, Edges};
use meshsnap::config::Config;
use meshsnap::http::{self, ServeError};
use meshsnap::telemetry;

fn main() -> ExitCode {
    cli::run(std::env::args_os(), &Edges { log: telemetry::init, serve })
}

fn serve(config: &Config, ready: &mut dyn FnMut(SocketAddr)) -> Result<(), Complaint> {
    http::serve(config, ready).map_err(|error| match error {
        ServeError::Unprotected(_) => Complaint::usage(error.to_string()),
        ServeError::Listen { .. } | ServeError::Start(_) => Complaint::ours(error.to_string()),
    })
}
