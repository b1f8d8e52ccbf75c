//! The `meshsnap` binary: arguments to configuration to `serve`, `render`, `inspect` or `health`.

fn main() {}
