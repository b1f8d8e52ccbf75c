//! The pages at `/` and `/status`: what the server sends, and what people meet in a browser. The scripts of
//! `tests/node/page` drive Chromium by playwright-core, which `tests/run` installs into `target/node`.

mod browser;
mod built;
mod served;

pub use browser::browser_and;
