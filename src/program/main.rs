//! The program `meshsnap`: its command line, with a module for most of the commands.
//!
//! Exit codes: 0 success; 1 a fault of the mesh or the request, or an answer that is no (a check failed, two files
//! differ, a server is not healthy); 2 a fault of the command line or the configuration; 3 a fault of meshsnap or the
//! machine. Errors are one sentence each on standard error; only those of the parser of arguments, clap, and of
//! panics may be longer.

/// Prints a line to standard error. `eprintln!` panics where nobody reads on, as after `2>&1 | head`.
macro_rules! say {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}

mod bundle;
mod check;
mod diff;
pub(crate) mod error;
mod files;
mod format_arg;
mod health;
mod inspect;
mod isolation;
mod jobs;
mod manual;
mod output;
mod progress;
mod render;
#[cfg(target_os = "linux")]
mod sandbox;
mod serve;
mod settings;
mod siblings;
mod sign;

use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory as _, Parser, Subcommand};

use error::CliError;

/// Turns 3D meshes into images, here or as an HTTP service.
#[derive(Parser)]
#[command(
    name = "meshsnap",
    version,
    about,
    propagate_version = true,
    max_term_width = HELP_COLUMNS,
    after_help = "`meshsnap COMMAND -h` is short, and `--help` has every option and examples."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Draw a mesh into an image file
    #[command(after_help = SEE_HELP, after_long_help = render::EXAMPLES)]
    Render(Box<render::RenderArgs>),
    /// Report the content of a mesh file
    #[command(after_help = SEE_HELP, after_long_help = inspect::EXAMPLES)]
    Inspect(inspect::InspectArgs),
    /// Judge mesh files by rules, for CI
    #[command(after_help = SEE_HELP, after_long_help = check::EXAMPLES)]
    Check(check::CheckArgs),
    /// Say what differs between two meshes
    #[command(after_help = SEE_HELP, after_long_help = diff::EXAMPLES)]
    Diff(diff::DiffArgs),
    /// Serve renders over HTTP
    #[command(after_help = SEE_HELP, after_long_help = serve::after_help())]
    Serve(serve::ServeArgs),
    /// List the jobs in the data folder of a server
    #[command(after_long_help = jobs::EXAMPLES)]
    Jobs(jobs::JobsArgs),
    /// Ask a running server whether it is healthy, for container health checks
    Health(health::HealthArgs),
    /// Sign the address of a picture, so that it can be seen without an API key
    Sign(sign::SignArgs),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a manual page, for `man -l -`
    Man {
        /// The command that it is about [default: meshsnap itself]
        #[arg(value_parser = manual::COMMANDS)]
        command: Option<String>,
    },
}

/// Widest line of a help text.
const HELP_COLUMNS: usize = 100;

/// The end of a short help text.
const SEE_HELP: &str = "`--help` has every option and examples.";

fn main() -> ExitCode {
    // Tests make decoders fail.
    #[cfg(debug_assertions)]
    if let Ok(decoder) = std::env::var("MESHSNAP_TEST_PANIC_IN") {
        meshsnap_render::guard::hook::panic_in(decoder);
    }
    let words: Vec<OsString> = std::env::args_os().collect();
    if let Some(code) = isolation::run_if_asked(&words) {
        return code;
    }
    #[cfg(feature = "gpu")]
    meshsnap_render::backend::gpu::ignore_displays();
    let cli = match Cli::try_parse_from(&words) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version come here too; clap prints them to standard output.
            let _ = error.print();
            advise(&error);
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let command = || match cli.command {
        Command::Render(arguments) => render::run(&arguments, &words),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Diff(arguments) => diff::run(&arguments),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Jobs(arguments) => jobs::run(&arguments),
        Command::Health(arguments) => health::run(&arguments),
        Command::Sign(arguments) => sign::run(&arguments),
        Command::Completions { shell } => completions(shell),
        Command::Man { command } => manual::print(Cli::command(), command.as_deref()),
    };
    // The panic hook has printed the message already.
    let bug = |_| Err(CliError::ours("this is a bug in meshsnap; please report it with the mesh and the request"));
    match catch_unwind(AssertUnwindSafe(command)).unwrap_or_else(bug) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if !error.sentence.is_empty() {
                say!("meshsnap: {}", error.sentence);
            }
            ExitCode::from(error.exit_code)
        }
    }
}

/// Says what a newcomer may have meant who names a file and no command.
fn advise(error: &clap::Error) {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return };
    if error.kind() == ErrorKind::InvalidSubcommand && std::path::Path::new(word).is_file() {
        say!("{word} is a file. To draw it: meshsnap render {word} -o out.png");
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
