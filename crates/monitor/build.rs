//! The page is a part of the program: a new page makes a new program.

fn main() {
    // A folder that is missing would make every build a new one. `make web` touches this file.
    let page = std::path::Path::new("../../web/dist");
    let watched = if page.exists() { "../../web/dist" } else { "build.rs" };
    println!("cargo::rerun-if-changed={watched}");
    println!("cargo::rerun-if-changed=build.rs");
}
