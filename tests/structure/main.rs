//! Neither the modules of a crate nor crates depend on each other in a cycle.

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

fn repository() -> (&'static Path, Vec<Package>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("a workspace");
    let packages = packages(folder);
    assert!(packages.iter().any(|package| package.name == env!("CARGO_PKG_NAME")));
    (folder, packages)
}
