//! The `meshsnap` binary: arguments to `serve`, `render`, `inspect` or `health`.

fn main() -> std::process::ExitCode {
    meshsnap::cli::run(std::env::args_os())
}
