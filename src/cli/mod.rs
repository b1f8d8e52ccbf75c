//! The command line.
//!
//! Exit codes: 0 success; 1 a fault of the mesh or the request; 2 a fault of the command line or
//! the configuration; 3 a fault of meshsnap or the machine. Every error is one sentence on standard
//! error.

mod bundle;
pub(crate) mod error;
mod files;
mod health;
mod inspect;
mod progress;
mod render;
mod serve;
mod settings;
mod sign;

use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

use error::CliError;

/// Turns 3D meshes into images, here or as an HTTP service.
#[derive(Parser)]
#[command(name = "meshsnap", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Draw a mesh into an image file
    Render(Box<render::RenderArgs>),
    /// Report the content of a mesh file
    Inspect(inspect::InspectArgs),
    /// Serve renders over HTTP
    Serve(serve::ServeArgs),
    /// Ask a running server whether it is healthy, for container health checks
    Health(health::HealthArgs),
    /// Sign the address of a picture, so that it can be seen without an API key
    Sign(sign::SignArgs),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Runs the program with these arguments.
pub fn run(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version come here too; clap prints them to standard output.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let command = || match cli.command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Health(arguments) => health::run(&arguments),
        Command::Sign(arguments) => sign::run(&arguments),
        Command::Completions { shell } => completions(shell),
    };
    // The panic hook has printed the message already.
    let bug = |_| Err(CliError::ours("this is a bug in meshsnap; please report it with the mesh and the request"));
    match catch_unwind(AssertUnwindSafe(command)).unwrap_or_else(bug) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("meshsnap: {}", error.sentence);
            ExitCode::from(error.exit_code)
        }
    }
}

fn completions(shell: clap_complete::Shell) -> Result<(), CliError> {
    // The generator panics on a closed pipe, so it writes to memory.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "meshsnap", &mut script);
    files::print(&script)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
