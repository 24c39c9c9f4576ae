//! Neither the modules of a crate nor crates depend on each other in a cycle, and all tests are compiled.

mod cycles;
mod expand;
mod load;
mod modules;
mod names;
mod resolve;
#[cfg(test)]
mod tests;
mod workspace;

use std::fs;
use std::path::Path;
use workspace::{Package, dependencies, packages};

#[test]
fn modules_have_no_cycles() {
    let (folder, packages) = repository();
    let read = |path: &Path| fs::read_to_string(path).ok();
    let mut reports = String::new();
    for package in &packages {
        for root in package.roots() {
            let mut modules = load::load(root, &read);
            let names = names::names(&mut modules);
            for cycle in cycles::of_modules(&modules, &names) {
                reports += &format!("\n{}: {}", package.name, cycle.report(folder));
            }
        }
    }
    assert!(reports.is_empty(), "{reports}");
}

/// Cargo allows a cycle that a dev-dependency closes.
#[test]
fn crates_have_no_cycles() {
    let (_, packages) = repository();
    let dependencies = dependencies(&packages);
    let mut reports = String::new();
    for cycle in cycles::cycles(dependencies.iter().copied()) {
        reports += "\nThese crates depend on each other:\n";
        for (from, to) in
            dependencies.iter().filter(|(from, to)| cycle.contains(from) && cycle.contains(to))
        {
            reports += &format!("  {} on {}\n", packages[*from].name, packages[*to].name);
        }
    }
    assert!(reports.is_empty(), "{reports}");
}

/// With `autotests = false` Cargo leaves out what nothing names.
#[test]
fn no_file_of_tests_is_left_out() {
    let (_, packages) = repository();
    for package in &packages {
        let folder = package.folder().join("tests");
        let all = fs::read_to_string(folder.join("all.rs")).unwrap_or_default();
        for entry in folder.read_dir().into_iter().flatten() {
            let path = entry.expect("the folder can be listed").path();
            let is_target = package.targets.iter().any(|target| target.src_path == path);
            let name = path.file_stem().expect("it has a name").to_string_lossy();
            let is_left_out = path.extension().is_some_and(|it| it == "rs")
                && !is_target
                && !all.contains(&format!("\nmod {name};\n"));
            assert!(!is_left_out, "{} is in no program of the tests", path.display());
        }
    }
}

fn repository() -> (&'static Path, Vec<Package>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("a workspace");
    let packages = packages(folder);
    assert!(packages.iter().any(|package| package.name == env!("CARGO_PKG_NAME")));
    (folder, packages)
}
