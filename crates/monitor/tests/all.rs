//! One program of the tests that need none of their own: each more has to be linked.

mod drive_lines;
mod drive_reads;
mod drive_runs;
mod drive_writes;
#[path = "../../telemetry/tests/drives/mod.rs"]
mod drives;
mod leaving;
mod link;
mod recordings;
mod run_losses;
#[path = "../../telemetry/tests/shared/mod.rs"]
mod shared;
mod types;
mod world;
