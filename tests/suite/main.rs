//! The one integration binary: a module per concern.

mod cli;
mod examples;
mod http;
mod jobs;
mod server;
