//! Motorlink's protocols on the ports of real boards.
//!
//! * [`st`]: ST's Motor Control Protocol on a UART that has the traits of [`embedded_io`].
//! * [`rmd`]: RMD on a CAN controller that has those of [`embedded_can::nb`].
//! * [`slcan`]: such a controller made of a UART that speaks slcan.
//!
//! A port moves bytes or frames between a peripheral and a machine of [`motorlink_proto`], and
//! nothing else: no clock, no interrupt, no allocation, no `unsafe`, no panic. Its `poll` takes the
//! time, does a bounded amount of work (so that a line full of garbage does not keep a board from
//! its other duties), and says when to be called again if nothing is received before. A board calls
//! it from its main loop, behind an interrupt that wakes it for each byte or frame:
//!
//! ```
//! use motorlink_embedded::st::SlavePort;
//! use motorlink_proto::st::{MotorControl, MotorNumber, Profile, Slave};
//! use motorlink_proto::time::Instant;
//!
//! fn serve<U>(uart: U, drive: &mut impl MotorControl, now: impl Fn() -> Instant, sleep: impl Fn(Option<Instant>))
//! where
//!     U: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
//! {
//!     let mut port = SlavePort::new(uart, Slave::new(Profile::Spec, MotorNumber::FIRST));
//!     loop {
//!         // A receiver that overran has been answered for; there is nothing more to do.
//!         let next = port.poll(now(), drive).unwrap_or_default();
//!         sleep(next);
//!     }
//! }
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod rmd;
pub mod slcan;
pub mod st;
