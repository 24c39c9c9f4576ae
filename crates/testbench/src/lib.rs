//! Simulated drives behind ports: inside the process as `sim:`, or served to other programs.
//!
//! - [`BenchConfig`] describes the drives.
//! - [`SimServer`] serves them on ports in real time. [`SimServer::obey`] executes commands that no
//!   protocol has: switch the power off, heat, load, trigger a fault.
//! - [`Bench`] has drives for the clients of this process, on virtual time.
//! - [`scenario`] plays scenarios from text files.
//! - [`register`] adds the port `sim:`.
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
