//! A slow line: bytes take time in both directions, and the suite knows their transmission time.

use std::collections::VecDeque;
use std::time::Duration as Span;

use motorlink::Clock;
use motorlink::port::{ByteLink, Link, PortError};
use motorlink_conformance::st::{self, Harness, Options};
use motorlink_conformance::{Need, Verdict, run};
use motorlink_link::serve::Station as _;
use motorlink_proto::st::{MotorNumber, Profile};
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::st::MotorConfig;

use crate::peer::{Deviation, Peer};

/// A UART with a drive. `send` returns at once, like a driver with a buffer.
struct Uart {
    peer: Peer,
    byte_time: Micros,
    clock: Clock,
    /// Bytes in transit to the drive, and their time of arrival.
    outward: VecDeque<(Instant, u8)>,
    /// Bytes in transit from the drive.
    inward: VecDeque<(Instant, u8)>,
}

impl Uart {
    fn answer(&mut self, at: Instant, reply: Vec<u8>) {
        for byte in reply {
            let before = self.inward.back().map_or(at, |(last, _)| at.max(*last));
            self.inward.push_back((before + self.byte_time, byte));
        }
    }

    /// Advances the time to the next event, or to a moment.
    fn step(&mut self, until: Instant) {
        let arrival = self.outward.front().map(|(at, _)| *at);
        let deadline = self.peer.deadline();
        let due = [arrival, deadline].into_iter().flatten().min().filter(|due| *due <= until);
        self.clock.wait(due.unwrap_or(until));
        let now = self.clock.now();
        let mut reply = Vec::new();
        if arrival.is_some_and(|at| at <= now) {
            let (at, byte) = self.outward.pop_front().expect("it has just been there");
            self.peer.receive(at, &[byte], &mut reply);
        } else if deadline.is_some_and(|at| at <= now) {
            self.peer.poll(now, &mut reply);
        }
        self.answer(now, reply);
    }
}

impl Link for Uart {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }
}

impl ByteLink for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        for &byte in bytes {
            let now = self.clock.now();
            let before = self.outward.back().map_or(now, |(last, _)| now.max(*last));
            self.outward.push_back((before + self.byte_time, byte));
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Span>) -> Result<usize, PortError> {
        let until = self.clock.now() + timeout.expect("the kit waits for a while").into();
        loop {
            let came = self.inward.front().map(|(at, _)| *at);
            if let Some(at) = came.filter(|at| *at <= until) {
                while self.clock.now() < at {
                    self.step(at);
                }
                let (_, byte) = self.inward.pop_front().expect("it has just been there");
                buffer[0] = byte;
                return Ok(1);
            }
            if self.clock.now() >= until {
                return Ok(0);
            }
            self.step(until);
        }
    }
}

#[test]
fn a_slow_line_skips_frames_that_take_too_long_and_fails_nothing() {
    let too_long: &[&str] = &[
        "payloads_of_every_length_are_accepted",
        "invalid_registers_of_a_data_segment_are_refused",
        "a_reply_may_have_128_bytes",
    ];
    let lines = [
        (Profile::Spec, 9_600, too_long),
        (Profile::Spec, 57_600, &[]),
        (Profile::Mcsdk54, 9_600, &[]),
    ];
    for (profile, baud, skipped) in lines {
        let byte_time = Micros(10_000_000 / baud);
        let peer = Peer::new(profile, &MotorConfig::demo(), Deviation::default());
        let (outward, inward) = Default::default();
        let uart = Uart { peer, byte_time, clock: Clock::virtual_time(), outward, inward };
        let allowed = vec![Need::Spin];
        let options = Options { profile, motor: MotorNumber::FIRST, allowed, byte_time };
        let mut harness = Harness::new(Box::new(uart), Box::new(()), options);
        let report = run(&st::suite(profile), &mut harness, |_| {}).strict();
        assert!(report.is_clean(), "{baud}: {:#?}", report.failed().collect::<Vec<_>>());
        let slow = report.outcomes.iter().filter(
            |outcome| matches!(&outcome.verdict, Verdict::Skipped(why) if why.contains("25 ms")),
        );
        let slow: Vec<&str> = slow.map(|outcome| &*outcome.name).collect();
        assert_eq!(slow, skipped, "{profile:?} {baud}");
    }
}
