//! The schemes of this crate: one file and one line per scheme.

mod serial;
mod slcan;
mod socketcan;
mod tcp;
mod unix;

use super::scheme::Scheme;

pub use serial::DEFAULT_BAUD;
pub(crate) use serial::{MARKED_LINK, mark};
pub(crate) use tcp::{keep_alive, unbracketed};

pub(super) const BUILT_IN: &[&dyn Scheme] =
    &[&serial::Serial, &tcp::Tcp, &unix::Unix, &slcan::Slcan, &socketcan::SocketCan];
