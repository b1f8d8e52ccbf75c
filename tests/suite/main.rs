//! The one binary of all integration tests: a folder per concern, and helpers in `support`.

// Helpers outside of #[test] functions may give up as loudly as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod accuracy;
mod cli;
mod formats;
mod hostile;
mod house;
mod http;
#[path = "../bench/accuracy/measure/mod.rs"]
mod measure;
#[path = "../oracle/mod.rs"]
mod oracle;
mod render;
mod stress;
mod support;
