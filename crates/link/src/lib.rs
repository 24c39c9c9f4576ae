//! Serial lines and CAN buses: opened by name, served to other programs, reopened after a failure.
//!
//! | to | use |
//! |---|---|
//! | open a serial line or a CAN bus by name | [`port::PortName`] |
//! | add a kind of port | [`port::Scheme`], [`port::register`] |
//! | list the ports of this machine | [`list::ports`] |
//! | serve a simulated drive on a pty, a socket or a CAN interface | [`serve::Server`] |
//! | reopen a port after a failure, with back-off | [`reopening::Reopening`] |
//! | inject faults into a line | [`fault::Faults`], [`port::FaultBytes`], [`port::FaultCan`] |
//! | observe the traffic of a port | [`port::Tap`] |
//! | run on virtual time | [`clock::Clock`] |
//!
//! This crate knows no protocol of a drive.
#![forbid(unsafe_code)]

mod clock;
mod direction;
pub mod fault;
pub mod list;
pub mod port;
pub mod reopening;
pub mod serve;
mod text;

pub use clock::Clock;
pub use motorlink_proto::{can, time};
pub use motorlink_slcan as slcan;
pub use text::{is_printable, printable, printable_lines};
