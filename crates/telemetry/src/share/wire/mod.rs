//! The frames of a line that a share keeps for a while: what its tap saw, and what it means.
//!
//! Nothing is decoded until a program asks.

mod memory;
mod reading;
mod record;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use motorlink::Clock;
use motorlink::can::CanFrame;
use motorlink::port::{Direction as Way, EventBytes, EventCan, TapBytes, TapCan};
use motorlink_capture::Direction;
use motorlink_proto::time::{Instant, Micros};

use memory::Memory;
use record::What;

pub use memory::{KEPT, MEMORY};
pub(super) use reading::{Part, read};

/// The most frames of an answer.
pub const MOST_FRAMES: u32 = 1000;

/// Keeps what passes a port. Clones share it: one goes around the port, one to the line of the share.
#[derive(Debug, Clone, Default)]
pub struct Tap(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// That of the line. Nothing is kept before it is known.
    clock: OnceLock<Clock>,
    memory: Mutex<Memory>,
}

impl Tap {
    /// Around a serial line.
    pub fn around_line(&self, link: Box<dyn EventBytes>) -> Box<dyn EventBytes> {
        let mut keeper = Keeper { tap: self.clone(), began: None };
        let keep = move |way, at, bytes: &[u8]| keeper.keep(way, at, What::Bytes(bytes));
        Box::new(TapBytes::new(link, keep))
    }

    /// Around a CAN bus.
    pub fn around_bus(&self, link: Box<dyn EventCan>) -> Box<dyn EventCan> {
        let mut keeper = Keeper { tap: self.clone(), began: None };
        let keep = move |way, at, frame: &CanFrame| keeper.keep(way, at, What::Can(*frame));
        Box::new(TapCan::new(link, keep))
    }

    /// Begins to keep, with times of this clock.
    pub fn follow(&self, clock: &Clock) {
        self.0.clock.get_or_init(|| clock.clone());
    }

    fn keep(&self, at: Instant, way: Way, what: What<'_>) {
        let direction = match way {
            Way::Sent => Direction::Sent,
            Way::Received => Direction::Received,
        };
        self.memory().keep(at, direction, what);
    }

    fn memory(&self) -> MutexGuard<'_, Memory> {
        self.0.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What is around an open port.
struct Keeper {
    tap: Tap,
    /// When its stopwatch began, by the clock of the line.
    began: Option<Instant>,
}

impl Keeper {
    /// `at` is the time of the stopwatch: of what is sent, before it is sent.
    fn keep(&mut self, way: Way, at: Duration, what: What<'_>) {
        let Some(clock) = self.tap.0.clock.get() else { return };
        // It is never too early, and the less too late the less time has passed since `at`.
        let at = Micros::from(at);
        let began = Instant(clock.now().0.saturating_sub(at.0));
        let began = self.began.map_or(began, |earlier| earlier.min(began));
        self.began = Some(began);
        self.tap.keep(began + at, way, what);
    }
}
