//! Motorlink's protocols on the peripherals of real boards.
//!
//! | to | use |
//! |---|---|
//! | answer as an ST drive on a UART | [`st::SlavePort`] |
//! | command an ST drive through a UART | [`st::MasterPort`] |
//! | answer as RMD motors on a CAN controller | [`rmd::DrivePort`] |
//! | command RMD motors through a CAN controller | [`rmd::HostPort`] |
//! | use a UART as a CAN controller, with the slcan protocol | [`slcan::Adapter`] |
//!
//! A UART needs the traits of [`embedded_io`], a CAN controller those of [`embedded_can::nb`].
//!
//! A port moves bytes or frames between a peripheral and a state machine of [`motorlink_proto`]. It
//! has no clock, no interrupt, no allocation, no `unsafe` and no panic. `poll` gets the time, does
//! a bounded amount of work even on a line full of garbage, and returns when to call it again if
//! nothing is received before. A board calls it from its main loop, after an interrupt that wakes
//! it for each byte or frame:
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
//!         // The NACK for an overrun was sent already, so the error needs no handling.
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
