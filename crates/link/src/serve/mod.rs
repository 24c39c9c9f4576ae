//! Served ports: the other side of a serial line or a CAN bus, for simulated drives.
//!
//! A [`Server`] owns ptys, TCP listeners and CAN sockets, and one station behind each. It has no
//! thread: whoever runs it calls [`Server::turn`] again and again. It never waits for a client that
//! does not read; what such a client misses is dropped and counted.
//!
//! A pty is a line with one client at a time; bytes that one left unread are not shown to the next.
//! A served TCP port that is a serial line has one client too: while it is connected, others are
//! closed at once; a station is told who comes and goes. Behind a TCP port that is a CAN bus
//! each client has an slcan adapter of its own on the same bus: it hears the station and the other
//! clients. Unix sockets (`unix-listen:`) serve as TCP ports do, to the user who serves them. A
//! station on a CAN interface of the kernel is a node of that bus, and goes on when the interface was
//! away.
//!
//! Web pages can make a browser connect to TCP ports of this machine. A client that begins with an
//! HTTP request, a TLS handshake or a STUN message is closed; a station gets none of its bytes.
//!
//! Without a port, a [`StationLink`] reaches a station in the process, on virtual time if its clock stands.

mod endpoint;
mod link;
mod name;
mod node;
mod pty;
mod server;
mod station;
mod stranger;
mod unix;

pub use link::StationLink;
pub use name::ServeName;
pub use server::{Served, Server, Turn};
pub use station::{MOST_CLIENTS, Station, Traffic};
