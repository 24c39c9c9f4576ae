//! What every parser and state machine of Motorlink has to stand: functions that take any bytes and
//! panic when something is not as it should be. The fuzzers in `fuzz_targets` feed them for hours
//! (`make fuzz`), `tests/replay.rs` feeds them seeds and regressions in `make test`.
#![deny(unsafe_code)]

mod ffi;
mod host;
mod input;
#[path = "../../crates/proto/tests/model/mod.rs"]
mod model;
mod rmd;
pub mod seeds;
mod st;

/// A target: its name, and what it does with bytes.
pub type Target = (&'static str, fn(&[u8]));

/// Every target, the cheapest executions first.
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
    ("port_name", host::port_name),
    ("st_value", host::st_value),
    ("sim_config", host::sim_config),
    ("sim_command", host::sim_command),
];

/// Feeds `data` to a target.
///
/// # Panics
/// When there is no such target, and when the target finds something.
pub fn run(name: &str, data: &[u8]) {
    let target = TARGETS.iter().find(|(known, _)| *known == name);
    let (_, target) = target.unwrap_or_else(|| panic!("there is no target {name}"));
    target(data);
}
