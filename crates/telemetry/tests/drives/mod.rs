//! Simulated drives on ptys.
#![allow(dead_code, reason = "each test uses a part")]

use std::path::PathBuf;

use motorlink_testbench::{Bench, BenchConfig, Serving};

/// A path of the test's own.
pub fn path(name: &str, kind: &str) -> PathBuf {
    let folder: PathBuf = env!("CARGO_TARGET_TMPDIR").into();
    folder.join(format!("{name}-{kind}-{}", std::process::id()))
}

/// A bench, and its drives on ports: the paths of the ST line and of the RMD bus.
pub fn served(name: &str) -> (Bench, Serving, String, String) {
    served_by(name, &BenchConfig::default())
}

pub fn served_by(name: &str, config: &BenchConfig) -> (Bench, Serving, String, String) {
    let [st, rmd] = ["st", "rmd"].map(|kind| path(name, kind).display().to_string());
    let bench = Bench::new(config).unwrap();
    let port = |name: String| Some(name.parse().unwrap());
    let serving = bench.serve(port(format!("pty:{st}")), port(format!("slcan-pty:{rmd}"))).unwrap();
    (bench, serving, st, rmd)
}
