//! Support for adapters that echo sent frames.

use std::collections::VecDeque;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::CanFrame;

use super::error::PortError;
use super::event::Evented;
use super::link::{CanLink, Link};
use crate::clock::Clock;

/// Maximum number of expected echoes per identifier. So repeated frames to one motor do not remove
/// the expected echo of a STOP to another.
const PER_ID: usize = 32;
/// Maximum number of expected echoes: for all identifiers of a bus with the maximum number of
/// motors.
const WAITING: usize = PER_ID * 33;

/// Removes the first received frame that is identical to each sent one.
///
/// RMD motors answer some requests with the same frame, so an adapter's echo looks like a reply. An
/// echo may take any time, because an adapter, a network or this process may be busy. Echoes arrive
/// in the order of sending. If a later echo of the same identifier arrives first, the earlier one
/// was lost. Until then a motor's reply may be removed as the missing echo; its request ends with a
/// timeout.
#[derive(Debug)]
pub struct EchoCanceller<C> {
    link: C,
    clock: Clock,
    /// The oldest first.
    expected: VecDeque<CanFrame>,
}

impl<C: CanLink> EchoCanceller<C> {
    /// Wraps `link`.
    pub fn new(link: C) -> Self {
        let expected = VecDeque::with_capacity(WAITING);
        EchoCanceller { clock: link.clock().unwrap_or_default(), link, expected }
    }

    /// Removes `frame` from the expected echoes, with earlier ones of the same identifier. Those of
    /// other identifiers remain, because this may be a late reply.
    fn is_echo(&mut self, frame: &CanFrame) -> bool {
        let Some(place) = self.expected.iter().position(|expected| expected == frame) else {
            return false;
        };
        let mut index = 0..;
        self.expected.retain(|expected| index.next() > Some(place) || expected.id() != frame.id());
        true
    }
}

impl<C: CanLink> Link for EchoCanceller<C> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<C: CanLink> CanLink for EchoCanceller<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.link.send(frame)?;
        let is_same = |other: &CanFrame| other.id() == frame.id();
        if self.expected.iter().filter(|other| is_same(other)).count() == PER_ID {
            self.expected.iter().position(is_same).map(|oldest| self.expected.remove(oldest));
        }
        if self.expected.len() == WAITING {
            self.expected.pop_front();
        }
        self.expected.push_back(*frame);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let end = self.clock.end_of(timeout);
        loop {
            match self.link.receive(self.clock.left(end))? {
                Some(frame) if self.is_echo(&frame) => {}
                other => return Ok(other),
            }
        }
    }
}

impl<C: CanLink + Evented> Evented for EchoCanceller<C> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::time::Instant;

    use super::*;

    /// A bus that returns every sent frame, or two copies if a motor echoes it too.
    struct Mirror {
        clock: Clock,
        frames: VecDeque<CanFrame>,
        copies: usize,
    }

    fn mirror(copies: usize) -> EchoCanceller<Mirror> {
        EchoCanceller::new(Mirror { clock: Clock::virtual_time(), frames: VecDeque::new(), copies })
    }

    impl Link for Mirror {
        fn clock(&self) -> Option<Clock> {
            Some(self.clock.clone())
        }
    }

    impl CanLink for Mirror {
        fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
            self.frames.extend(std::iter::repeat_n(*frame, self.copies));
            Ok(())
        }
        fn receive(&mut self, _: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
            Ok(self.frames.pop_front())
        }
    }

    const RUN: CanFrame = CanFrame::new(0x141, [0x88, 0, 0, 0, 0, 0, 0, 0]);
    const ANGLE: CanFrame = CanFrame::new(0x141, [0x92, 0, 0, 0, 0, 0, 0, 0]);
    const NOW: Option<Duration> = Some(Duration::ZERO);

    #[test]
    fn the_echo_is_removed_and_an_equal_reply_is_kept() -> Result<(), PortError> {
        let mut silent = mirror(1);
        silent.send(&RUN)?;
        assert_eq!(silent.receive(NOW)?, None);

        let mut answered = mirror(2);
        for _ in 0..2 * WAITING {
            answered.send(&RUN)?;
            assert_eq!(answered.receive(NOW)?, Some(RUN));
            assert_eq!(answered.receive(NOW)?, None);
        }
        Ok(())
    }

    /// The adapter, the network or this process was busy. As a reply, the echo would be an angle of
    /// 0.
    #[test]
    fn a_late_echo_is_not_a_reply() -> Result<(), PortError> {
        let mut bus = mirror(1);
        bus.send(&ANGLE)?;
        bus.link.clock.wait(Instant(3_600_000_000));
        assert_eq!(bus.receive(NOW)?, None);
        Ok(())
    }

    /// The line delivers nothing during a cycle and repeated STOPs, and then everything.
    #[test]
    fn repeated_frames_to_one_motor_keep_the_expected_echo_of_another() -> Result<(), PortError> {
        let mut bus = mirror(1);
        for _ in 0..4 {
            for id in 0x141..=0x160 {
                bus.send(&CanFrame::new(id, [0x81, 0, 0, 0, 0, 0, 0, 0]))?;
            }
            for _ in 0..100 {
                bus.send(&CanFrame::new(0x280, [0; 8]))?;
            }
        }
        while let Some(frame) = bus.receive(NOW)? {
            assert_eq!(frame.id(), 0x280, "an echo became a reply");
        }
        Ok(())
    }

    #[test]
    fn a_late_reply_does_not_remove_the_echo_of_another_motor() -> Result<(), PortError> {
        let stop = CanFrame::new(0x142, [0x81, 0, 0, 0, 0, 0, 0, 0]);
        let mut bus = mirror(0);
        bus.send(&ANGLE)?;
        bus.send(&stop)?;
        bus.link.frames.extend([stop, ANGLE, stop]);
        assert_eq!(bus.receive(NOW)?, Some(stop));
        assert_eq!(bus.receive(NOW)?, None);
        Ok(())
    }

    #[test]
    fn a_lost_echo_removes_at_most_one_reply() -> Result<(), PortError> {
        let mut bus = mirror(0);
        bus.send(&ANGLE)?;
        bus.link.copies = 2;
        bus.send(&RUN)?;
        assert_eq!(bus.receive(NOW)?, Some(RUN), "the echo of RUN came after the lost one");
        assert_eq!(bus.receive(NOW)?, None);
        bus.send(&ANGLE)?;
        assert_eq!(bus.receive(NOW)?, Some(ANGLE));

        bus.link.copies = 0;
        bus.send(&RUN)?;
        bus.link.copies = 2;
        for replies in [0, 1, 1] {
            bus.send(&RUN)?;
            for _ in 0..replies {
                assert_eq!(bus.receive(NOW)?, Some(RUN));
            }
            assert_eq!(bus.receive(NOW)?, None);
        }
        Ok(())
    }
}
