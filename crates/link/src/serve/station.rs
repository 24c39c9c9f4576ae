//! The device on a served port.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Maximum number of clients of a served CAN bus. Further clients are closed at once.
pub const MOST_CLIENTS: usize = 64;

/// The data on a port: bytes of a serial line, or frames of a CAN bus.
pub trait Traffic: Copy {
    /// Default maximum number of clients.
    const MOST_CLIENTS: usize;
}

impl Traffic for u8 {
    const MOST_CLIENTS: usize = 1;
}

impl Traffic for CanFrame {
    const MOST_CLIENTS: usize = MOST_CLIENTS;
}

/// The device at the end of a served serial line, or a node of a served CAN bus.
pub trait Station<T: Traffic> {
    /// Takes received data. Appends data to send to `replies`.
    fn receive(&mut self, now: Instant, received: &[T], replies: &mut Vec<T>);

    /// Called after the deadline.
    fn poll(&mut self, _now: Instant, _replies: &mut Vec<T>) {}

    /// When to call [`poll`](Self::poll) next; `None` for never.
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// A client opens the port; `others` clients have opened it already. On false the client is
    /// closed at once. This is not possible on a pty.
    fn client_connected(&mut self, _now: Instant, others: usize) -> bool {
        others < T::MOST_CLIENTS
    }

    /// Whether to disconnect the clients now. What they sent and was not read yet is dropped. A pty
    /// is replaced by a new one at the same link.
    fn disconnects(&self) -> bool {
        false
    }

    /// A client closed the port, or was disconnected.
    fn client_disconnected(&mut self, _now: Instant) {}

    /// Whether clients may send more now. Otherwise their bytes wait in the kernel, and those of a
    /// client that disconnects are dropped.
    fn accepts_input(&self) -> bool {
        true
    }

    /// A client used HTTP, TLS or STUN, and is closed.
    fn browser_detected(&mut self, _now: Instant) {}
}
