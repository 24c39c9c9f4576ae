//! Two motor-drive protocols, both ends of each, without I/O.
//!
//! Use this crate to write firmware, or a host with its own I/O. A program that talks to a drive
//! through a port uses the crate `motorlink` instead.
//!
//! | to | use |
//! |---|---|
//! | command an ST drive over a serial line | [`st::Master`], [`st::Request`] |
//! | answer as an ST drive, in firmware | [`st::Slave`] and your [`st::MotorControl`] |
//! | command RMD motors on a CAN bus | [`rmd::Host`], the request types such as [`rmd::SetSpeed`] |
//! | answer as an RMD motor, in firmware | [`rmd::Drive`] and your [`rmd::MotorControl`] |
//! | look up a register, a command or a unit | [`st::register`], [`rmd::COMMANDS`], [`units`] |
//! | refuse dangerous requests | [`st::Limits`] with [`st::Account`], [`rmd::Limits`] |
//! | print a frame | [`Hex`], [`rmd::describe`] |
//! | wait until a move has arrived | [`rmd::ArrivalWatch`], [`st::ArrivalWatch`] |
//!
//! ST's protocol is the serial Motor Control Protocol of MCSDK 5.x drives. RMD is the RMD motor
//! control protocol over CAN, V1.62; its frames are [`can::CanFrame`]s.
//!
//! The crate reads no clock and opens no port. The caller passes received bytes or frames, with the
//! [`time::Instant`] of their arrival. The caller then polls: the answer is what to send, a result,
//! or how long to wait. The crate is `no_std`, allocates nothing, contains no `unsafe` and does not
//! panic.
//!
//! Registers, codes, commands and units are defined only in the tables `st/register/table.rs`,
//! `st/code.rs`, `rmd/command.rs` and `units.rs`. All crates take names, sizes and texts from them.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

#[cfg(feature = "std")]
extern crate std;

#[macro_use]
mod table;
pub mod arrival;
pub mod can;
mod hex;
mod motion;
pub mod rmd;
pub mod st;
pub mod time;
pub mod units;

pub use hex::Hex;
pub use motion::Motion;
