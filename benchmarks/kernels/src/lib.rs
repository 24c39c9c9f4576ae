//! Exchanges and simulated drives as kernels, which repeat one piece of work and whose instructions
//! can be counted. With few dependencies, so that `make cost` compiles little.

pub mod drives;
pub mod exchange;
pub mod kernel;
pub mod result;

use kernel::Kernel;

/// The names of all kernels.
pub fn names() -> impl Iterator<Item = String> {
    let exchanges = exchange::kernels().into_iter().map(|kernel| kernel.name);
    exchanges.chain(drives::RIGS.iter().map(|rig| rig.name.to_owned()))
}

/// The kernel with this name. A drive is built on demand, because it must reach its speed first.
pub fn named(name: &str) -> Option<Kernel> {
    let found = exchange::kernels().into_iter().find(|kernel| kernel.name == name);
    let rig = || drives::RIGS.iter().find(|rig| rig.name == name);
    found.or_else(|| rig().map(drives::Rig::kernel))
}

/// The compiler of this folder.
pub fn compiler() -> String {
    let output = std::process::Command::new("rustc").arg("--version").output();
    let version = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    version.unwrap_or_else(|_| "unknown".to_owned())
}
