//! A protocol's half of a relay.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::PortError;
use motorlink_link::serve::{ServeName, Served, Server};
use motorlink_proto::time::Instant;

use super::event::Halt;
use super::station::Desk;

/// The protocol's side of a relay: the port, what passes it, and what was set turning.
pub(super) trait Hold {
    fn serve(
        &self,
        server: &mut Server,
        name: &ServeName,
        desk: &Rc<RefCell<Desk>>,
        port: Rc<RefCell<String>>,
    ) -> Result<Served, PortError>;

    /// A turn of the server that ends when the port has something as well; whether the port is open.
    fn turn(&self, server: &mut Server, most: Duration) -> Result<bool, PortError>;

    /// Moves what can be moved between port and client. While the port is closed what the client
    /// sends is dropped: it must not come out of the blue later.
    fn pass(&mut self, now: Instant, desk: &mut Desk) -> Result<(), PortError>;

    /// When [`pass`](Self::pass) has to be called again.
    fn due(&self, now: Instant) -> Option<Instant>;

    /// The client is gone: drops what it sent and the port has not taken. Gives how much that was.
    fn forget(&mut self, now: Instant) -> usize;

    /// Whether something was set turning and not stopped.
    fn owes(&self) -> bool;

    /// Stops the motors that were started, and waits for the drive's answers. If a stop fails,
    /// [`owes`](Self::owes) stays true.
    fn stop(&mut self) -> Vec<Halt>;
}
