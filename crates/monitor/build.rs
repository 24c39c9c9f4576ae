//! The page is a part of the program: a new page makes a new program.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

const PAGE: &str = "../../web/dist";

fn main() -> io::Result<()> {
    let page = Path::new(PAGE);
    let mut rows = String::new();
    if page.exists() {
        let page = page.canonicalize()?;
        for file in files(&page)? {
            let name = file.strip_prefix(&page).map_err(io::Error::other)?;
            rows += &format!("({name:?}, include_bytes!({file:?}).as_slice()),\n");
        }
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::write(out.join("page.rs"), format!("&[{rows}]"))?;
    // A folder that is missing would make every build a new one. `make web` touches this file.
    println!("cargo::rerun-if-changed={}", if page.exists() { PAGE } else { "build.rs" });
    println!("cargo::rerun-if-changed=build.rs");
    Ok(())
}

/// All files in a folder and its folders.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        found.extend(if path.is_dir() { files(&path)? } else { vec![path] });
    }
    Ok(found)
}
