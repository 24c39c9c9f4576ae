//! The functions of `motorlink.h`, for a program that links them all.

use std::path::Path;
use std::{env, fs};

fn main() {
    let header = "../crates/ffi/include/motorlink.h";
    println!("cargo::rerun-if-changed={header}");
    let header = fs::read_to_string(header).expect("the header is there");
    let code = header.lines().filter(|line| !line.trim_start().starts_with('*'));
    let names: Vec<String> = code
        .filter_map(|line| line.split_once('(')?.0.rsplit([' ', '*']).next())
        .filter(|name| name.starts_with("motorlink_"))
        .map(|name| format!("{name} as *const ()"))
        .collect();
    assert!(names.len() > 80, "the header has functions");
    let list = format!("[{}]", names.join(", "));
    let folder = env::var("OUT_DIR").expect("cargo sets it");
    fs::write(Path::new(&folder).join("functions.rs"), list).expect("the folder can be written");
}
