//! The machine of the measurements.

use std::env::args;
use std::fs::read_to_string;
use std::process::Command;

use crate::report::Style;

/// The first lines of docs/BENCHMARKS.md.
const HEAD: &str = "\
# Benchmarks

This page is for users who need to know the cost of an exchange or of a simulated drive, and for
contributors who make them faster. It has figures of one machine. Measure yours with `make bench`.
The goals of the project are in the last table.
";

/// Prints the head of the report.
pub fn describe(style: Style) {
    let options: Vec<String> = args().skip(1).collect();
    let command = format!("cargo run --release -p motorlink-bench -- {}", options.join(" "));
    let rows = [
        ("command", command),
        ("processor", processor()),
        ("kernel", kernel()),
        ("compiler", compiler()),
    ];
    match style {
        Style::Plain => rows.iter().for_each(|(name, value)| println!("{name:<9}  {value}")),
        Style::Markdown => {
            println!("{HEAD}");
            rows.iter().for_each(|(name, value)| println!("- {name}: `{value}`"));
        }
    }
}

fn processor() -> String {
    let info = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|line| line.starts_with("model name"));
    let model = model.and_then(|line| line.split_once(": ")).map_or("unknown", |(_, name)| name);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{model}, {cores} cores")
}

fn kernel() -> String {
    let release = read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    format!("Linux {}", release.trim())
}

fn compiler() -> String {
    let output = Command::new("rustc").arg("--version").output();
    let version = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    version.unwrap_or_else(|_| "unknown".to_owned())
}
