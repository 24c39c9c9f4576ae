//! The frames of a line that a share keeps for a while: what its tap saw, and what it means.
//!
//! Nothing is decoded until a program asks.

mod frame_ring;
mod reading;
mod record;
#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use motorlink::Clock;
use motorlink::can::CanFrame;
use motorlink::port::{self, Direction, EventBytes, EventCan};
use motorlink_proto::time::{Instant, Micros};
use parking_lot::Mutex;

use frame_ring::Memory;
use record::What;

pub use frame_ring::{KEPT, MEMORY};
pub(super) use reading::{Part, read};

/// The most frames of an answer.
pub const MOST_FRAMES: u32 = 1000;

/// Keeps what passes a port. Clones share it: one goes around the port, one to the line of the share.
#[derive(Debug, Clone, Default)]
pub struct Tap(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    clock: OnceLock<Clock>,
    memory: Mutex<Memory>,
}

impl Tap {
    /// Around a serial line.
    pub fn around_line(&self, link: Box<dyn EventBytes>) -> Box<dyn EventBytes> {
        let (tap, clock) = (self.clone(), self.clock(link.clock()));
        let keep = move |direction, at, bytes: &[u8]| tap.keep(at, direction, What::Bytes(bytes));
        Box::new(port::Tap::bytes_by(clock, link, keep))
    }

    /// Around a CAN bus.
    pub fn around_bus(&self, link: Box<dyn EventCan>) -> Box<dyn EventCan> {
        let (tap, clock) = (self.clone(), self.clock(link.clock()));
        let keep =
            move |direction, at, frame: &CanFrame| tap.keep(at, direction, What::Can(*frame));
        Box::new(port::Tap::frames_by(clock, link, keep))
    }

    /// That of the line, which takes it from the port. A port that is opened again has the same one.
    fn clock(&self, of_port: Option<Clock>) -> Clock {
        self.0.clock.get_or_init(|| of_port.unwrap_or_default()).clone()
    }

    fn keep(&self, at: Duration, direction: Direction, what: What<'_>) {
        self.0.memory.lock().keep(Instant(0) + Micros::from(at), direction, what);
    }
}
