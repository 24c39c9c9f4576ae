//! `include/motorlink.h` and `tests/c/rmd_commands.h` are what the sources and the protocols' tables say.
//!
//! `MOTORLINK_UPDATE_HEADER=1 cargo test -p motorlink-ffi --test header` writes them anew.

#![cfg(not(miri))]

#[path = "../build/rows.rs"]
mod rows;
mod tables;

use std::path::Path;
use std::{env, fs};

/// In the order in which a reader wants them. None declares another: that would be read twice.
const SOURCES: [&str; 15] = [
    "version.rs",
    "error.rs",
    "bytes.rs",
    "storage.rs",
    "st/message.rs",
    "st/master.rs",
    "st/request.rs",
    "st/slave.rs",
    "st/names.rs",
    "frame.rs",
    "rmd/message.rs",
    concat!(env!("OUT_DIR"), "/rmd_commands.rs"),
    "rmd/host.rs",
    "rmd/drive.rs",
    "slcan.rs",
];

fn generated(root: &Path) -> String {
    let mut config =
        cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("cbindgen.toml");
    config.after_includes = Some(format!("\n{}", tables::text()));
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root.join("src").join(source));
    }
    let mut header = Vec::new();
    builder.generate().expect("cbindgen understands the sources").write(&mut header);
    String::from_utf8(header)
        .expect("UTF-8")
        // cbindgen writes a negative constant without parentheses.
        .replace("NO_LIMIT -1\n", "NO_LIMIT (-1)\n")
        // The page is installed without its folder.
        .replace("docs/SPEC-NOTES.md", "SPEC-NOTES.md")
}

#[test]
fn the_header_is_what_the_sources_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (path, generated) in [
        ("include/motorlink.h", generated(root)),
        ("tests/c/rmd_commands.h", tables::commands::text()),
    ] {
        if env::var_os("MOTORLINK_UPDATE_HEADER").is_some() {
            fs::write(root.join(path), &generated).expect("the header can be written");
        }
        let committed = fs::read_to_string(root.join(path)).unwrap_or_default();
        assert!(committed == generated, "{path} is old: `make header` writes it anew");
    }
}

/// The names behind which there is a bracket.
fn functions(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.trim_start().starts_with('*')).filter_map(|line| {
        let (before, _) = line.split_once('(')?;
        before.rsplit([' ', '*']).next().filter(|name| name.starts_with("motorlink_"))
    })
}

#[test]
fn every_function_is_declared_once() {
    let header = generated(Path::new(env!("CARGO_MANIFEST_DIR")));
    let mut names: Vec<&str> = functions(&header).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}

/// The compiler can forbid `unsafe` only for the whole crate.
#[test]
fn only_pointer_rs_has_unsafe_blocks() {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut with_blocks = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("it can be listed") {
            let path = entry.expect("it can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if fs::read_to_string(&path).expect("it can be read").contains("unsafe {") {
                with_blocks.push(path);
            }
        }
    }
    assert_eq!(with_blocks.len(), 1, "{with_blocks:?}");
    assert!(with_blocks[0].ends_with("pointer.rs"), "{with_blocks:?}");
}
