#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| motorlink_fuzz::run("port_name", data));
