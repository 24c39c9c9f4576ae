//! Functions that test every parser and state machine of Motorlink with any bytes. They panic on a
//! failure. The programs in `fuzzers` run them for hours (`make fuzz`); `tests/replay.rs` runs
//! them with seeds and earlier findings in `make test`.

mod capture;
mod ffi;
mod host;
mod input;
#[path = "../../crates/proto/tests/model/mod.rs"]
mod model;
mod recording;
mod rmd;
pub mod seeds;
mod st;

/// A target: its name, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target. The first ones have the fastest executions.
pub const TARGETS: &[Target] = &[
    ("st_frame", st::frame),
    ("st_master", st::master),
    ("st_model", st::model),
    ("st_slave", st::slave),
    ("rmd_frame", rmd::frame),
    ("rmd_host", rmd::host),
    ("rmd_drive", rmd::drive),
    ("ffi", ffi::ffi),
    ("slcan", host::slcan),
    ("decode", capture::decode),
    ("port_name", host::port_name),
    ("st_value", host::st_value),
    ("settings_file", host::settings_file),
    ("recording", recording::recording),
    ("sim_config", host::sim_config),
    ("sim_command", host::sim_command),
];

/// Passes `data` to a target.
///
/// # Panics
/// If there is no such target, or if the target finds a failure.
pub fn run(name: &str, data: &[u8]) {
    let target = TARGETS.iter().find(|(known, _)| *known == name);
    let (_, target) = target.unwrap_or_else(|| panic!("there is no target {name}"));
    target(data);
}
