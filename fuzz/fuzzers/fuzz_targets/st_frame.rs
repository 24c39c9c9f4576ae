#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| motorlink_fuzz::run("st_frame", data));
