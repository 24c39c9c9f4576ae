//! What is behind a served port.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// The clients that a served CAN bus has at a time; one more is closed at once.
pub const MOST_CLIENTS: usize = 64;

/// What moves on a port: bytes of a serial line, or frames of a CAN bus.
pub trait Traffic: Copy {
    /// Clients that are welcome at a time, unless a station says otherwise.
    const MOST_CLIENTS: usize;
}

impl Traffic for u8 {
    const MOST_CLIENTS: usize = 1;
}

impl Traffic for CanFrame {
    const MOST_CLIENTS: usize = MOST_CLIENTS;
}

/// What answers at the far end of a served serial line, or sits on a served CAN bus.
pub trait Station<T: Traffic> {
    /// Takes what was received; what is to be sent is appended to `replies`.
    fn receive(&mut self, now: Instant, received: &[T], replies: &mut Vec<T>);

    /// Called when the deadline has passed.
    fn poll(&mut self, _now: Instant, _replies: &mut Vec<T>) {}

    /// When [`poll`](Self::poll) is to be called next, if at all.
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Someone opens the port, which `others` have open already. Unless it returns true they are
    /// closed at once, where the port can: on a pty it cannot.
    fn came(&mut self, _now: Instant, others: usize) -> bool {
        others < T::MOST_CLIENTS
    }

    /// A client closed the port, or is gone.
    fn left(&mut self, _now: Instant) {}

    /// Whether clients may send more now. While they may not, their bytes wait in the kernel, and
    /// those of a client that leaves are dropped.
    fn wants(&self) -> bool {
        true
    }

    /// A client that came spoke HTTP, TLS or STUN, and is closed.
    fn stranger(&mut self, _now: Instant) {}
}
