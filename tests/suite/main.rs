//! The one integration binary: a module per concern.

// Helpers outside of #[test] functions may give up as loudly as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cli;
mod examples;
mod http;
mod http_bad;
mod jobs;
mod server;
