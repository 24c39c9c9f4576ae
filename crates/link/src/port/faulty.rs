//! Ports with faults, to test a program's error handling on any port.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::{CanFrame, Identifiers};
use motorlink_proto::time::Instant;

use super::error::PortError;
use super::event::Evented;
use super::link::{ByteLink, CanLink, Link};
use crate::clock::Clock;
use crate::direction::Direction;
use crate::fault::{Faults, Lane, Unit};

/// A byte line with faults in both directions.
///
/// It has no thread: delayed data move while the program reads or writes.
#[derive(Debug)]
pub struct FaultBytes<B> {
    link: B,
    lanes: Lanes<u8>,
}

/// A CAN port with faults in both directions, as [`FaultBytes`] is for bytes.
#[derive(Debug)]
pub struct FaultCan<C> {
    link: C,
    lanes: Lanes<CanFrame>,
}

impl<B: ByteLink> FaultBytes<B> {
    /// Wraps `link`. [`Faults::on_serial`] checks the faults.
    pub fn new(link: B, faults: &Faults) -> Self {
        Self::paced(link, faults, Duration::ZERO)
    }

    /// Wraps a `link` without a pace of its own. `byte` is the transmission time of a byte in each
    /// direction.
    pub fn paced(link: B, faults: &Faults, byte: Duration) -> Self {
        FaultBytes { lanes: Lanes::new(faults, byte, (), link.clock()), link }
    }

    fn transmit(&mut self) -> Result<(), PortError> {
        let now = self.lanes.clock.now();
        let mut chunk = [0; 256];
        loop {
            let size = fill(&mut chunk, || self.lanes.sent.pop(now));
            if size == 0 {
                return Ok(());
            }
            self.link.write(&chunk[..size])?;
        }
    }
}

impl<C: CanLink> FaultCan<C> {
    /// Wraps `link`. [`Faults::on_can`] checks the faults. Noise avoids frames to the drives that
    /// use `identifiers`.
    pub fn new(link: C, faults: &Faults, identifiers: Identifiers) -> Self {
        Self::paced(link, faults, identifiers, Duration::ZERO)
    }

    /// Wraps a `link` without a pace of its own. `frame` is the transmission time of a frame; both
    /// directions share the bus.
    pub fn paced(link: C, faults: &Faults, identifiers: Identifiers, frame: Duration) -> Self {
        FaultCan { lanes: Lanes::new(faults, frame, identifiers, link.clock()), link }
    }

    fn transmit(&mut self) -> Result<(), PortError> {
        let now = self.lanes.clock.now();
        while let Some(frame) = self.lanes.sent.pop(now) {
            self.link.send(&frame)?;
        }
        Ok(())
    }
}

impl<B: ByteLink> Link for FaultBytes<B> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<B: ByteLink> ByteLink for FaultBytes<B> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let now = self.lanes.clock.now();
        self.lanes.sent.push(now, bytes.iter().copied());
        self.transmit()
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let deadline = self.lanes.clock.end_of(timeout);
        let mut chunk = [0; 256];
        loop {
            self.transmit()?;
            let wait = self.lanes.patience(deadline);
            let came = self.link.read(&mut chunk, wait)?;
            let now = self.lanes.clock.now();
            if came > 0 {
                self.lanes.received.push(now, chunk[..came].iter().copied());
            }
            let size = fill(buffer, || self.lanes.received.pop(now));
            if size > 0 || deadline.is_some_and(|end| end <= now) {
                return Ok(size);
            }
        }
    }
}

impl<C: CanLink> Link for FaultCan<C> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<C: CanLink> CanLink for FaultCan<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let free = self.lanes.clock.now().max(self.lanes.received.free());
        self.lanes.sent.push(free, [*frame]);
        self.transmit()
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let deadline = self.lanes.clock.end_of(timeout);
        loop {
            self.transmit()?;
            let wait = self.lanes.patience(deadline);
            let came = self.link.receive(wait)?;
            let now = self.lanes.clock.now();
            if let Some(frame) = came {
                self.lanes.received.push(now.max(self.lanes.sent.free()), [frame]);
            }
            let frame = self.lanes.received.pop(now);
            if frame.is_some() || deadline.is_some_and(|end| end <= now) {
                return Ok(frame);
            }
        }
    }
}

/// Delayed data do not make the descriptor readable: while there are some, the port asks to be
/// flushed, and a loop comes back for them.
impl<B: ByteLink + Evented> Evented for FaultBytes<B> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.transmit()?;
        Ok(self.link.flush()? || self.lanes.has_delayed())
    }

    fn discard(&mut self) -> Result<(), PortError> {
        self.link.discard()
    }
}

impl<C: CanLink + Evented> Evented for FaultCan<C> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.transmit()?;
        Ok(self.link.flush()? || self.lanes.has_delayed())
    }
}

fn fill(buffer: &mut [u8], mut next: impl FnMut() -> Option<u8>) -> usize {
    let slots = buffer.iter_mut();
    slots.map_while(|slot| next().map(|byte| *slot = byte)).count()
}

/// Both directions, and their clock.
#[derive(Debug)]
struct Lanes<T: Unit> {
    clock: Clock,
    sent: Lane<T>,
    received: Lane<T>,
}

impl<T: Unit> Lanes<T> {
    fn new(faults: &Faults, pace: Duration, protocol: T::Protocol, clock: Option<Clock>) -> Self {
        let lane = |way| Lane::new(faults, way, pace.into(), protocol.clone());
        let clock = clock.unwrap_or_default();
        Lanes { clock, sent: lane(Direction::Sent), received: lane(Direction::Received) }
    }

    /// Whether data are on their way.
    fn has_delayed(&self) -> bool {
        self.sent.due().or(self.received.due()).is_some()
    }

    /// Maximum wait for the port: until the deadline, or until the next unit is due.
    fn patience(&self, deadline: Option<Instant>) -> Option<Duration> {
        let first = [self.sent.due(), self.received.due(), deadline].into_iter().flatten().min();
        self.clock.left(first)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::time::Instant as Moment;

    use super::*;

    /// Returns sent data at once.
    struct Loopback<T>(VecDeque<T>);

    impl<T> Loopback<T> {
        fn new() -> Self {
            Loopback(VecDeque::new())
        }
    }

    /// Waits like an idle port.
    fn idle(timeout: Option<Duration>) {
        std::thread::sleep(timeout.expect("no data will come"));
    }

    impl<T: Send> Link for Loopback<T> {}

    impl ByteLink for Loopback<u8> {
        fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
            self.0.extend(bytes);
            Ok(())
        }
        fn read(
            &mut self,
            buffer: &mut [u8],
            timeout: Option<Duration>,
        ) -> Result<usize, PortError> {
            let size = fill(buffer, || self.0.pop_front());
            if size == 0 {
                idle(timeout);
            }
            Ok(size)
        }
    }

    impl CanLink for Loopback<CanFrame> {
        fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
            self.0.push_back(*frame);
            Ok(())
        }
        fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
            let frame = self.0.pop_front();
            if frame.is_none() {
                idle(timeout);
            }
            Ok(frame)
        }
    }

    fn bytes(faults: &str) -> FaultBytes<Loopback<u8>> {
        FaultBytes::new(Loopback::new(), &faults.parse().unwrap())
    }

    #[test]
    fn bytes_delayed_in_both_directions_arrive_in_one_read() {
        let mut port = bytes("delay=5ms");
        let began = Moment::now();
        port.write(&[1, 2, 3]).unwrap();
        let mut buffer = [0; 8];
        assert_eq!(port.read(&mut buffer, None).unwrap(), 3);
        assert_eq!(buffer[..3], [1, 2, 3]);
        assert!(began.elapsed() >= Duration::from_millis(10));
    }

    #[test]
    fn a_read_ends_at_its_timeout_and_late_bytes_come_with_the_next() {
        let mut port = bytes("delay=1s,only=received");
        port.write(&[1]).unwrap();
        let mut buffer = [0; 8];
        assert_eq!(port.read(&mut buffer, Some(Duration::ZERO)).unwrap(), 0);
        assert_eq!(port.read(&mut buffer, Some(Duration::from_millis(1))).unwrap(), 0);
        assert_eq!(port.read(&mut buffer, Some(Duration::from_secs(60))).unwrap(), 1);
    }

    #[test]
    fn frames_are_late_and_come_twice() {
        let faults = "delay=1s,dup=1,only=sent".parse().unwrap();
        let mut port = FaultCan::new(Loopback::new(), &faults, Identifiers::default());
        let frame = CanFrame::new(0x141, [0x9A; 8]);
        port.send(&frame).unwrap();
        assert_eq!(port.receive(Some(Duration::ZERO)).unwrap(), None);
        assert_eq!(port.receive(None).unwrap(), Some(frame));
        assert_eq!(port.receive(None).unwrap(), Some(frame));
        assert_eq!(port.receive(Some(Duration::from_millis(1))).unwrap(), None);
    }
}
