//! What is behind a served port.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// The clients that a served CAN bus has at a time; one more is closed at once.
pub const MOST_CLIENTS: usize = 64;

/// What answers at the far end of a served serial line.
pub trait ByteStation {
    /// Takes received bytes; what is to be sent back is appended to `reply`.
    fn receive(&mut self, now: Instant, bytes: &[u8], reply: &mut Vec<u8>);
    /// Called when the deadline has passed.
    fn poll(&mut self, now: Instant, reply: &mut Vec<u8>);
    /// When [`poll`](Self::poll) is to be called next, if at all.
    fn deadline(&self) -> Option<Instant>;

    /// Someone opens the line, which `others` have open already. Unless it returns true they are
    /// closed at once, where the port can: on a pty it cannot.
    fn came(&mut self, _now: Instant, others: usize) -> bool {
        others == 0
    }

    /// A client closed the line, or is gone.
    fn left(&mut self, _now: Instant) {}

    /// Whether clients may send more now. While they may not, their bytes wait in the kernel, and
    /// those of a client that leaves are dropped.
    fn wants(&self) -> bool {
        true
    }

    /// A client that came spoke HTTP, TLS or STUN, and is closed.
    fn stranger(&mut self, _now: Instant) {}
}

/// What sits on a served CAN bus.
pub trait CanStation {
    /// Takes a frame from the bus; what is to be sent is appended to `replies`.
    fn receive(&mut self, now: Instant, frame: &CanFrame, replies: &mut Vec<CanFrame>);
    /// Called when the deadline has passed.
    fn poll(&mut self, now: Instant, replies: &mut Vec<CanFrame>);
    /// When [`poll`](Self::poll) is to be called next, if at all.
    fn deadline(&self) -> Option<Instant>;

    /// As [`ByteStation::came`]. Unless the station says otherwise, [`MOST_CLIENTS`] are welcome.
    fn came(&mut self, _now: Instant, others: usize) -> bool {
        others < MOST_CLIENTS
    }

    /// As [`ByteStation::left`].
    fn left(&mut self, _now: Instant) {}

    /// As [`ByteStation::wants`].
    fn wants(&self) -> bool {
        true
    }

    /// As [`ByteStation::stranger`].
    fn stranger(&mut self, _now: Instant) {}
}
