//! Signals of motor drives at their rates, commands in between, stops before all.
#![forbid(unsafe_code)]

pub mod acquisition;
pub mod event;
pub mod line;
pub mod plan;
pub mod runner;
pub mod sample;
pub mod schedule;
pub mod signal;
pub mod subscription;
