//! Simulated drives behind ports: inside the process as `sim:`, or served to other programs.
//!
//! [`BenchConfig`] says what there is; [`SimServer`] serves the drives, which [`SimServer::obey`]
//! lets a person or a test do things to that no protocol can: take power away, heat, load, break.
//! [`Bench`] is drives for the clients of this process, on virtual time. [`scenario`] plays
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
mod server;
mod signals;
mod world;

pub use bench::{Bench, Serving};
pub use command::Command;
pub use config::{BenchConfig, ConfigError, RmdConfigs, StConfigs};
pub use drives::Recording;
pub use motorlink_sim::preset;
pub use rom::{RomError, RomFolder};
pub use scheme::register;
pub use server::{ServeError, SimServer};
