//! Every fuzz target. Cargo builds this file once per name in Cargo.toml.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| meshsnap_fuzz::run(env!("CARGO_BIN_NAME"), bytes));
