//! For adapters that send back what they transmit.

use std::time::Duration;

use motorlink_proto::rmd::{CanFrame, MotorId};
use motorlink_proto::time::{self, Instant};

use super::{CanLink, PortError};
use crate::Clock;

/// How many sent frames wait for their echo: a cycle over every motor, and 0x280.
const WAITING: usize = MotorId::COUNT + 1;
/// An echo that has not come by then does not come; an equal frame is a motor's reply.
const PATIENCE: time::Duration = time::Duration::from_millis(100);

/// Leaves out the first received frame that is identical to each sent one.
///
/// RMD motors answer some requests with the same frame, so an adapter's echo looks like a motor.
#[derive(Debug)]
pub struct EchoCanceller<C> {
    link: C,
    clock: Clock,
    expected: [Option<(CanFrame, Instant)>; WAITING],
}

impl<C: CanLink> EchoCanceller<C> {
    /// Wraps `link`.
    pub fn new(link: C) -> Self {
        EchoCanceller { clock: link.clock().unwrap_or_default(), link, expected: [None; WAITING] }
    }

    pub(super) fn link(&self) -> &C {
        &self.link
    }

    pub(super) fn link_mut(&mut self) -> &mut C {
        &mut self.link
    }

    /// Strikes `frame` off the expected echoes.
    fn is_echo(&mut self, frame: &CanFrame) -> bool {
        let now = self.clock.now();
        for slot in &mut self.expected {
            match slot {
                Some((_, sent)) if now.since(*sent) > PATIENCE => *slot = None,
                Some((expected, _)) if expected == frame => {
                    *slot = None;
                    return true;
                }
                _ => {}
            }
        }
        false
    }
}

impl<C: CanLink> CanLink for EchoCanceller<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.link.send(frame)?;
        // A free place, or else the oldest: `None` is less than any `Some`.
        if let Some(slot) = self.expected.iter_mut().min_by_key(|slot| slot.map(|(_, sent)| sent)) {
            *slot = Some((*frame, self.clock.now()));
        }
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

    fn clock(&self) -> Option<Clock> {
        self.link.clock()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    /// A bus on which every sent frame comes back, twice when a motor echoes it too.
    struct Mirror(VecDeque<CanFrame>, usize);

    impl CanLink for Mirror {
        fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
            self.0.extend(std::iter::repeat_n(*frame, self.1));
            Ok(())
        }
        fn receive(&mut self, _: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
            Ok(self.0.pop_front())
        }
    }

    #[test]
    fn the_echo_goes_and_the_equal_reply_stays() -> Result<(), PortError> {
        let frame = CanFrame::new(0x141, [0x88, 0, 0, 0, 0, 0, 0, 0]);
        let mut silent = EchoCanceller::new(Mirror(VecDeque::new(), 1));
        silent.send(&frame)?;
        assert_eq!(silent.receive(Some(Duration::ZERO))?, None);

        let mut answered = EchoCanceller::new(Mirror(VecDeque::new(), 2));
        for _ in 0..2 * WAITING {
            answered.send(&frame)?;
            assert_eq!(answered.receive(Some(Duration::ZERO))?, Some(frame));
            assert_eq!(answered.receive(Some(Duration::ZERO))?, None);
        }
        Ok(())
    }
}
