//! Ports: a serial line or a CAN bus, opened by name.
//!
//! [`PortName::open_bytes`] and [`PortName::open_can`] open a [`ByteLink`] or a [`CanLink`]. Links
//! start no thread, allocate nothing during an exchange, and make one system call each to send, to
//! wait and to receive.
//!
//! A [`Scheme`] is one kind of port: the syntax of its names, how to open them, and the ports of
//! this machine. The schemes of this crate are built in; [`register`] adds others.

mod carries;
mod deadline;
mod descriptors;
mod echo;
mod emulated;
mod error;
mod event;
mod faulty;
mod fd;
mod holder;
mod interface;
mod link;
mod name;
mod place;
mod queued;
mod registry;
mod scheme;
mod schemes;
mod slcan;
mod socketcan;
mod system;
mod tap;

pub use carries::Carries;
pub use descriptors::open_descriptors;
pub use echo::EchoCanceller;
pub use error::{NotDone, PortError};
pub use event::{EventBytes, EventCan, Evented};
pub use faulty::{FaultBytes, FaultCan};
pub use fd::FdLink;
pub use holder::{Declined, Ending, HeldLine, HeldPort, Holder, RequestEnd};
pub use link::{ByteLink, CanLink, Link};
pub use name::NameError;
pub use place::Place;
pub use registry::{register, schemes};
pub use scheme::{CanPort, Form, Given, LinePort, Port, PortInfo, PortName, Scheme};
pub use schemes::DEFAULT_BAUD;
pub use slcan::SlcanLink;
pub use socketcan::SocketCanLink;
pub use tap::Tap;

pub use crate::direction::Direction;

pub(crate) use fd::timespec;
pub(crate) use name::{check_printable, host_and_port, present, unknown_form};
pub(crate) use schemes::{MARKED_LINK, keep_alive, mark, unbracketed};
