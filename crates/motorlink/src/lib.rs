//! Clients for motor drives: ST's Motor Control Protocol on a serial line, and RMD over CAN.
//!
//! | to | use |
//! |---|---|
//! | command ST motors | [`st::Client`], [`st::Motor`] |
//! | command RMD motors | [`rmd::Client`], [`rmd::Motor`] |
//! | command drives from an event loop | [`st::EventClient`], [`rmd::EventClient`] |
//! | open a port by name | [`port::PortName`] |
//! | list the ports of this machine | [`list::ports`] |
//! | stop motors at the end of a scope, on errors and panics | [`st::StopOnDrop`], [`rmd::StopOnDrop`] |
//! | limit speeds and currents | [`st::Limits`], [`rmd::Limits`] |
//! | find the baud rate of an ST drive | [`st::scan`] |
//! | write settings to a file, compare and restore them | [`settings`] |
//! | stop the motors of another program when it ends | [`relay::Relay`] |
//! | say who owns a motor in motion, between several programs | [`ownership`] |
#![forbid(unsafe_code)]

pub mod arrival;
mod client;
mod held;
mod overdue;
pub mod ownership;
pub mod relay;
pub mod rmd;
pub mod settings;
pub mod st;
mod stopping;
mod turn;
mod way;

pub use motorlink_link::reopening::{BackOff, LinkState, Opener};
pub use motorlink_link::{Clock, can, list, port, slcan, time};
pub use motorlink_proto::Hex;
pub use stopping::{STOP_ATTEMPTS, STOP_PATIENCE, STOP_PAUSE, STOP_TIME};
pub use turn::LOOK;
