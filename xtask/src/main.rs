//! `cargo xtask`: one entry for what developers run.
//!
//! Most commands only call what exists: scripts, cargo commands, and the environment variables that tests read. These
//! also work without it. [`tasks`] has the functions behind the commands.

mod tasks;

use std::process::ExitCode;

const HELP: &str = "\
cargo xtask COMMAND

  test                       all tests, as tests/run
  test quick                 the quick tier: under a minute after the build
  test long                  all tests the long way; minutes to hours
  test FILTER...             tests of the suite whose names contain a filter
  bless pictures|schema|tables|examples|library
                             store what tests compare with anew, then test against it
  bench [accuracy|load|cached|browse|gpu|crashes|stages] [OPTIONS]
                             measure error and time (accuracy), a server, a GPU, jobs beside crashes, or stages
  goals                      measure the goals of docs/accuracy.md that tests hold
  gallery [cpu|gpu]          draw docs/gallery anew
  fuzz SECONDS [TARGET...]   fuzz all targets, or the named ones
  lint                       formatting, clippy, documentation, and cargo-deny where it is installed
  features                   check the crate without features, with each alone, and with all
  cross                      check the program for Windows and macOS, as far as their targets are installed
  package [OPTIONS]          make and build the crate's archive, and look at what is in it
  help                       this text

CONTRIBUTING.md says when to use which.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words.as_slice() {
        [] | ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            Ok(())
        }
        ["test", rest @ ..] => tasks::test(rest),
        ["bless", what] => tasks::bless(what),
        ["bench", rest @ ..] => tasks::bench(rest),
        ["goals"] => tasks::script("docs/goals.sh", &[]),
        ["gallery", rest @ ..] => tasks::script("docs/gallery.sh", rest),
        ["fuzz", rest @ ..] => tasks::script("fuzz/run", rest),
        ["lint"] => tasks::lint(),
        ["features"] => tasks::features(),
        ["cross"] => tasks::cross(),
        ["package", rest @ ..] => tasks::package(rest),
        _ => Err(format!("there is no command `{}`\n\n{HELP}", words.join(" "))),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("xtask: {reason}");
            ExitCode::FAILURE
        }
    }
}
