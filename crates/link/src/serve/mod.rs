//! Served ports: the other side of a serial line or a CAN bus, for simulated drives.
//!
//! A [`Server`] owns ptys, TCP listeners and CAN sockets, and one station for each. It has no
//! thread: the caller calls [`Server::turn`] in a loop. It never waits for a client that does not
//! read; the bytes that such a client misses are dropped and counted.
//!
//! A pty is a line with one client at a time. Bytes that one client left unread are not shown to
//! the next. A TCP port that is a serial line also has one client; while it is connected, others
//! are closed at once. A station is informed of connections and disconnections. On a TCP port that
//! is a CAN bus, each client has its own slcan adapter on the same bus: it receives the frames of
//! the station and of the other clients. Unix sockets (`unix-listen:`) serve like TCP ports, but
//! only to the user who runs the server. A station on a CAN interface of the kernel is a node of
//! that bus. It continues after the interface was down.
//!
//! A web page can make a browser connect to TCP ports of this machine. A client that starts with an
//! HTTP request, a TLS handshake or a STUN message is closed; the station gets none of its bytes.
//!
//! Without a port, a [`StationLink`] connects to a station in this process, on virtual time with a
//! virtual clock.

mod browser;
mod endpoint;
mod link;
mod name;
mod node;
mod pty;
mod server;
mod station;
mod unix;

pub use link::StationLink;
pub use name::ServeName;
pub use server::{Served, Server, Turn};
pub use station::{MOST_CLIENTS, Station, Traffic};
pub use unix::UnixServer;
