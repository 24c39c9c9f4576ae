//! The packages of the repository, as Cargo reads their manifests.

use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::process::Command;

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
pub struct Package {
    pub name: String,
    pub manifest_path: PathBuf,
    pub targets: Vec<Target>,
    pub dependencies: Vec<Dependency>,
}

/// A crate of a package.
#[derive(Deserialize)]
pub struct Target {
    pub src_path: PathBuf,
}

/// For normal, build and test code.
#[derive(Deserialize)]
pub struct Dependency {
    /// The folder, if the package is in the repository.
    pub path: Option<PathBuf>,
}

impl Package {
    pub fn folder(&self) -> &Path {
        self.manifest_path.parent().expect("a manifest is in a folder")
    }

    /// The root files of its crates, except those in the folder `tests`.
    pub fn roots(&self) -> impl Iterator<Item = &Path> {
        let tests = self.folder().join("tests");
        let roots = self.targets.iter().map(|target| target.src_path.as_path());
        roots.filter(move |root| !root.starts_with(&tests))
    }
}

/// The packages of the workspace in a folder, and of the workspaces in the folders in it.
pub fn packages(folder: &Path) -> Vec<Package> {
    let mut packages = members(&folder.join("Cargo.toml"));
    for entry in folder.read_dir().expect("the workspace is in a folder") {
        let manifest = entry.expect("the folder can be listed").path().join("Cargo.toml");
        if manifest.exists() && packages.iter().all(|known| known.manifest_path != manifest) {
            packages.extend(members(&manifest));
        }
    }
    packages
}

/// Pairs of packages of which the first depends on the second.
pub fn dependencies(packages: &[Package]) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (from, package) in packages.iter().enumerate() {
        for path in package.dependencies.iter().filter_map(|dependency| dependency.path.as_ref()) {
            pairs.extend(packages.iter().position(|to| to.folder() == path).map(|to| (from, to)));
        }
    }
    pairs
}

fn members(manifest: &Path) -> Vec<Package> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--no-deps", "--format-version=1", "--manifest-path"]).arg(manifest);
    let output = cargo.output().expect("Cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Metadata = serde_json::from_slice(&output.stdout).expect("Cargo writes JSON");
    metadata.packages
}
