//! Simulated drives behind ports: inside the process as `sim:`, or served to other programs.
//!
//! [`BenchConfig`] says what there is; [`Bench`] is the drives themselves, which [`Bench::obey`]
//! lets a person or a test do things to that no protocol can: take power away, heat, load, break.
//! [`VirtualBench`] is drives for the clients of this process, on virtual time. [`scenario`] plays
//! what is written down. After [`register`], `sim:` is a port like others.
#![forbid(unsafe_code)]

mod bench;
mod cast;
mod command;
mod config;
mod drives;
mod line;
mod places;
mod rom;
pub mod scenario;
mod scheme;
mod signals;
mod virtual_bench;
mod world;

pub use bench::{Bench, ServeError};
pub use command::Command;
pub use config::{BenchConfig, ConfigError, RmdConfigs, StConfigs};
pub use drives::Recording;
pub use motorlink_sim::preset;
pub use rom::{RomError, RomFolder};
pub use scheme::register;
pub use virtual_bench::{Serving, VirtualBench};
