//! Two motor-drive protocols, both ends of each, without I/O.
//!
//! * [`st`]: ST's serial Motor Control Protocol as MCSDK 5.x drives speak it, master and slave.
//! * [`rmd`]: the RMD motor control protocol over CAN, V1.62, host and drive, on frames of [`can`].
//!
//! Nothing here reads a clock or touches a port. A caller hands in received bytes or frames together
//! with the [`time::Instant`] at which they came, and takes out what is to be sent and how long to
//! wait. The crate is `no_std`, allocates nothing, contains no `unsafe` and does not panic.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

#[cfg(feature = "std")]
extern crate std;

#[macro_use]
mod table;
pub mod can;
mod hex;
pub mod rmd;
pub mod st;
pub mod time;
pub mod units;

pub use hex::Hex;
