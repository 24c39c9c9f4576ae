//! Frames on the wire: what a tap sees, and serial bytes split into frames.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Direction, EventBytes, EventCan, Tap};
use motorlink_capture::st::{self, Piece};
use motorlink_proto::st::HEADER_NACK;
use parking_lot::Mutex;

use super::wall::{Anchor, moment, wall_at, wall_now};
use crate::schema::{Frame, FrameResult, Time};
use crate::write::{Queue, Weighed};

/// The memory for what a tap has seen, until it is taken.
const MEMORY: usize = 8 << 20;

/// What a tap has seen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    time: Time,
    direction: Direction,
    what: Wire,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Wire {
    Bytes(Box<[u8]>),
    Can(CanFrame),
}

impl Weighed for Seen {
    fn bytes(&self) -> usize {
        let content = match &self.what {
            Wire::Bytes(bytes) => bytes.len(),
            Wire::Can(_) => 0,
        };
        size_of::<Seen>() + content
    }
}

/// Taps for each opening of a port. Clones put what they see into the same queue.
#[derive(Debug, Clone)]
pub struct Taps {
    seen: Queue<Seen>,
    /// Of a port with a time of its own.
    anchor: Arc<OnceLock<Anchor>>,
}

impl Default for Taps {
    fn default() -> Self {
        Taps { seen: Queue::new(MEMORY), anchor: Arc::default() }
    }
}

impl Taps {
    /// With the time of the day at a moment of the port's own clock.
    pub fn anchored(anchor: Anchor) -> Self {
        Taps { anchor: Arc::new(OnceLock::from(anchor)), ..Taps::default() }
    }

    /// Around a serial line.
    pub fn around_line(&self, link: Box<dyn EventBytes>) -> Box<dyn EventBytes> {
        let (seen, began) = (self.seen.clone(), self.now(link.clock()));
        Box::new(Tap::bytes(link, move |way, at, bytes: &[u8]| {
            seen.push(Seen::new(began, way, at, Wire::Bytes(bytes.into())));
        }))
    }

    /// Around a CAN bus.
    pub fn around_bus(&self, link: Box<dyn EventCan>) -> Box<dyn EventCan> {
        let (seen, began) = (self.seen.clone(), self.now(link.clock()));
        Box::new(Tap::frames(link, move |way, at, frame: &CanFrame| {
            seen.push(Seen::new(began, way, at, Wire::Can(*frame)));
        }))
    }

    fn now(&self, clock: Option<motorlink::Clock>) -> Time {
        match clock.filter(motorlink::Clock::is_virtual) {
            Some(clock) => self.anchor.get_or_init(|| Anchor::now(&clock)).wall(clock.now()),
            None => wall_now(),
        }
    }

    /// What was seen since the last time.
    pub(super) fn take(&self) -> impl Iterator<Item = Seen> {
        self.seen.take().items.into_iter()
    }

    /// How much was lost, because it was taken too late.
    pub(super) fn lost(&self) -> u64 {
        self.seen.lost()
    }
}

/// A place in an open port where taps are put and taken away. Clones are the same place.
#[derive(Debug, Clone, Default)]
pub struct Outlet(Arc<Mutex<Vec<Plugged>>>);

#[derive(Debug)]
struct Plugged {
    number: u64,
    seen: Queue<Seen>,
}

/// Taps in an outlet, until this is dropped.
#[derive(Debug)]
pub(super) struct Plug {
    outlet: Outlet,
    number: u64,
}

impl Outlet {
    /// Around a serial line.
    pub fn around_line(&self, link: Box<dyn ByteLink>) -> Box<dyn ByteLink> {
        let (outlet, began) = (self.clone(), moment());
        Box::new(Tap::bytes(link, move |way, at, bytes: &[u8]| {
            outlet.see(|| Seen::new(wall_at(began), way, at, Wire::Bytes(bytes.into())));
        }))
    }

    /// Around a CAN bus.
    pub fn around_bus(&self, link: Box<dyn CanLink>) -> Box<dyn CanLink> {
        let (outlet, began) = (self.clone(), moment());
        Box::new(Tap::frames(link, move |way, at, frame: &CanFrame| {
            outlet.see(|| Seen::new(wall_at(began), way, at, Wire::Can(*frame)));
        }))
    }

    /// Puts taps in. They see what comes from now on.
    pub(super) fn plug(&self, taps: &Taps) -> Plug {
        let mut plugged = self.0.lock();
        let number = plugged.last().map_or(0, |last| last.number + 1);
        plugged.push(Plugged { number, seen: taps.seen.clone() });
        Plug { outlet: self.clone(), number }
    }

    fn see(&self, seen: impl Fn() -> Seen) {
        for one in &*self.0.lock() {
            one.seen.push(seen());
        }
    }
}

impl Drop for Plug {
    fn drop(&mut self) {
        self.outlet.0.lock().retain(|one| one.number != self.number);
    }
}

impl Seen {
    fn new(began: Time, direction: Direction, at: Duration, what: Wire) -> Self {
        let since = u64::try_from(at.as_nanos()).unwrap_or(u64::MAX);
        Seen { time: Time(began.0.saturating_add(since)), direction, what }
    }
}

/// Makes frames of what a tap has seen.
#[derive(Debug, Default)]
pub struct Splitter(st::Duplex<Time>);

impl Splitter {
    /// Takes the next thing that was seen. `put` receives the frames.
    pub fn take(&mut self, seen: Seen, put: &mut dyn FnMut(Frame)) {
        let Seen { time, direction, what } = seen;
        match what {
            Wire::Can(frame) => put(Frame::of_can(time, direction.into(), &frame)),
            Wire::Bytes(bytes) => {
                self.0.take(time, direction, &bytes, |time, way, bytes, piece| {
                    put(frame(time, way, bytes, &piece));
                });
            }
        }
    }

    /// Nothing more comes.
    pub fn end(&mut self, put: &mut dyn FnMut(Frame)) {
        self.0.end(|time, way, bytes, piece| put(frame(time, way, bytes, &piece)));
    }
}

fn frame(stamp: Time, direction: Direction, bytes: &[u8], piece: &Piece<'_>) -> Frame {
    let result = match piece {
        Piece::Frame(frame) if direction == Direction::Received && frame.header == HEADER_NACK => {
            FrameResult::Nack
        }
        Piece::Frame(_) => FrameResult::Frame,
        Piece::Broken(_) => FrameResult::Damaged,
    };
    Frame { stamp, direction: direction.into(), id: 0, result, data: bytes.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPLY: [u8; 4] = [0xF0, 1, 6, 0xF7];
    const NACK: [u8; 4] = [0xFF, 1, 3, 0x04];

    fn results(received: &[&[u8]]) -> Vec<(FrameResult, usize)> {
        let (mut splitter, mut frames) = (Splitter::default(), Vec::new());
        let mut put = |frame: Frame| frames.push((frame.result, frame.data.len()));
        for bytes in received {
            let what = Wire::Bytes((*bytes).into());
            splitter.take(Seen::new(Time(0), Direction::Received, Duration::ZERO, what), &mut put);
        }
        splitter.end(&mut put);
        frames
    }

    #[test]
    fn bytes_that_are_no_frame_are_kept_between_those_that_are() {
        use FrameResult::{Damaged, Frame, Nack};
        assert_eq!(results(&[&[&[1, 2, 3], &REPLY[..]].concat()]), [(Damaged, 3), (Frame, 4)]);
        assert_eq!(results(&[&NACK, &[7]]), [(Nack, 4), (Damaged, 1)]);
        let mut wrong = REPLY;
        wrong[3] ^= 1;
        assert_eq!(results(&[&[wrong, NACK].concat()]), [(Damaged, 4), (Nack, 4)]);
        assert_eq!(results(&[&[0xF0, 200], &REPLY]), [(Damaged, 2), (Frame, 4)]);
    }
}
