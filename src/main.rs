//! The `meshsnap` binary. [`meshsnap::cli`] does everything.

fn main() -> std::process::ExitCode {
    meshsnap::cli::run(std::env::args_os())
}
