#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| skylit_fuzz::run("pfm", data));
