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
    /// How often this host pauses for 30 ms when it waits for the 15 ms between two parts of a frame.
    pauses: usize,
}

/// The kit at a UART.
fn kit(profile: Profile, baud: u64, allowed: &[Need], pauses: usize) -> Harness {
    let byte_time = Micros(10_000_000 / baud);
    let peer = Peer::new(profile, &MotorConfig::demo(), Deviation::default());
    let (outward, inward) = Default::default();
    let uart = Uart { peer, byte_time, clock: Clock::virtual_time(), outward, inward, pauses };
    let allowed = allowed.to_vec();
    let options = Options { profile, motor: MotorNumber::FIRST, allowed, byte_time };
    Harness::new(Box::new(uart), Box::new(()), options)
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
        let timeout = timeout.expect("the kit waits for a while");
        let mut until = self.clock.now() + timeout.into();
        if self.pauses > 0 && timeout.as_millis() == 15 {
            self.pauses -= 1;
            until += Micros::from_millis(30);
        }
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
    let lines: [(_, _, &[Need], _); 3] = [
        (Profile::Spec, 9_600, &[Need::Spin], too_long),
        (Profile::Spec, 57_600, &[], &[]),
        (Profile::Mcsdk54, 9_600, &[], &[]),
    ];
    for (profile, baud, allowed, skipped) in lines {
        let mut harness = kit(profile, baud, allowed, 0);
        let report = run(&st::suite(profile), &mut harness, |_| {}).strict();
        assert!(report.is_clean(), "{baud}: {:#?}", report.failed().collect::<Vec<_>>());
        let slow = report.outcomes.iter().filter(
            |outcome| matches!(&outcome.verdict, Verdict::Skipped(why) if why.contains("25 ms")),
        );
        let slow: Vec<&str> = slow.map(|outcome| &*outcome.name).collect();
        assert_eq!(slow, skipped, "{profile:?} {baud}");
    }
}

#[test]
fn a_host_that_pauses_in_a_frame_tries_again() {
    let name = "a_frame_within_25_ms_is_accepted";
    for pauses in 0..=10 {
        let mut harness = kit(Profile::Spec, 57_600, &[], pauses);
        let cases: Vec<_> =
            st::suite(Profile::Spec).into_iter().filter(|case| case.name == name).collect();
        assert_eq!(cases.len(), 1);
        let report = run(&cases, &mut harness, |_| {});
        match &report.outcomes[0].verdict {
            Verdict::Passed => assert!(pauses < 5, "it was always too late"),
            Verdict::Skipped(why) => {
                assert!(pauses >= 5 && why.contains("25 ms"), "{pauses}: {why}")
            }
            other => panic!("{pauses}: {other:?}"),
        }
    }
}
