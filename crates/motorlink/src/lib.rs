//! Motor drives from a program: the clients of both protocols, and what keeps a motor safe.
//!
//! [`st`] speaks ST's Motor Control Protocol, [`rmd`] the RMD protocol over CAN; both over ports
//! of [`port`], which [`list`] finds. [`relay`] stands between another program and its motors.
#![forbid(unsafe_code)]

pub mod relay;
pub mod rmd;
pub mod st;
mod stopping;
mod turn;

pub use motorlink_link::reopening::{BackOff, LinkState, Opener};
pub use motorlink_link::{Clock, can, list, port, slcan, time};
pub use motorlink_proto::Hex;
pub use turn::LOOK;
