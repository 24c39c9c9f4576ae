//! One program of the tests of recordings: each more has to be linked.

mod client;
#[path = "../../../telemetry/tests/engine/mod.rs"]
mod engine;
mod read;
mod replay;
mod track;
mod write;
