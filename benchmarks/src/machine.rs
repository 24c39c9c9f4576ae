//! The machine of the measurements.

use std::env::args;
use std::fs::read_to_string;

use motorlink_kernels::compiler;

/// The command and the machine, as in the head of docs/BENCHMARKS.md.
pub fn lines() -> [(&'static str, String); 4] {
    let options: Vec<String> = args().skip(1).collect();
    let command = format!("motorlink-bench {}", options.join(" "));
    [
        ("command", command),
        ("processor", processor()),
        ("kernel", kernel()),
        ("compiler", compiler()),
    ]
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
