//! Checks that docs/CONFORMANCE.md has the tables of the kit and names existing tests. `make docs`
//! writes the tables.

use std::fs;
use std::path::{Path, PathBuf};

use motorlink_conformance::{Clause, READINGS, Reading, rmd, st};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The text with the block between its markers replaced.
fn with_block(text: &str, name: &str, table: &str) -> String {
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let (head, rest) = text.split_once(&begin).expect("the block begins");
    let (_, tail) = rest.split_once(&end).expect("the block ends");
    format!("{head}{begin}{table}{end}{tail}")
}

#[test]
fn the_document_has_every_clause_and_its_tests() {
    let path = root().join("docs/CONFORMANCE.md");
    let text = fs::read_to_string(&path).expect("docs/CONFORMANCE.md");
    let wanted = with_block(&with_block(&text, "st", &st::table()), "rmd", &rmd::table());
    if std::env::var_os("MOTORLINK_UPDATE_DOCS").is_some() {
        fs::write(&path, &wanted).expect("docs/CONFORMANCE.md is written");
    } else {
        assert!(text == wanted, "docs/CONFORMANCE.md is behind: run `make docs`");
    }
}

/// The functions in Rust and Python files below a folder.
fn functions(folder: &Path, found: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("a folder of the project").flatten() {
        let path = entry.path();
        if path.is_dir() {
            functions(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs" || kind == "py") {
            let text = fs::read_to_string(&path).expect("a file of the project");
            let named = text.lines().filter_map(|line| {
                let line = line.trim_start();
                let rest = line.strip_prefix("fn ").or_else(|| line.strip_prefix("def "))?;
                rest.split(['(', '<']).next()
            });
            found.extend(named.map(str::to_owned));
        }
    }
}

#[test]
fn every_named_test_of_a_host_exists() {
    let mut known = Vec::new();
    for folder in ["crates", "tests/e2e"] {
        functions(&root().join(folder), &mut known);
    }
    let missing = |clause: &'static Clause| {
        let unknown = clause.host.iter().filter(|test| !known.iter().any(|name| name == *test));
        unknown.map(|test| format!("{}: {test}", clause.id)).collect::<Vec<_>>()
    };
    let missing: Vec<String> = st::CLAUSES.iter().chain(rmd::CLAUSES).flat_map(missing).collect();
    assert!(missing.is_empty(), "no such tests:\n{}", missing.join("\n"));
}

#[test]
fn every_reading_is_a_row_of_the_spec_notes() {
    let notes = fs::read_to_string(root().join("docs/SPEC-NOTES.md")).expect("docs/SPEC-NOTES.md");
    let rows: Vec<&str> = notes.lines().filter_map(|line| line.split('|').nth(1)).collect();
    for Reading { row, text } in READINGS {
        assert!(rows.iter().any(|known| known.trim() == *row), "{row} ({text}) is no row");
    }
}
