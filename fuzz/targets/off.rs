#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| meshsnap_fuzz::run("off", bytes));
