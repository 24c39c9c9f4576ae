//! Motors with pending replies to a former host, and adapters that echo (SPEC-NOTES R29).

use crate::rmd_bench::{Node, Pair, motor, trusted_host};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::Celsius;
use proptest::prelude::*;

const SPEED: [u8; 8] = [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];

fn opened(ids: &[u8]) -> Pair {
    let mut pair = Pair::new(ids);
    pair.host = Host::new();
    pair
}

#[test]
fn a_motor_that_was_not_asked_before_answers_two_questions_and_is_silent_first() {
    let mut pair = opened(&[1]);
    pair.request(1, SetSpeed::default()).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Quarantined))]);
    assert_eq!(pair.codes, [0x9A, 0x9C]);
    let until = pair.now + DEFAULT_QUARANTINE;
    let refused = RequestError::Quarantined { id: motor(1), until };
    assert_eq!(pair.request(1, SetSpeed::default()), Err(refused));
    pair.wait(DEFAULT_QUARANTINE);
    for _ in 0..2 {
        pair.request(1, SetSpeed::default()).unwrap();
        assert!(pair.run().iter().all(|(_, result)| result.is_ok()));
    }
    assert_eq!(pair.codes, [0x9A, 0x9C, 0xA2, 0xA2], "once");
}

#[test]
fn off_and_stop_go_out_before_the_questions_and_their_replies_do_not_count() {
    for halt in [Off.encode(), Stop.encode()] {
        let mut pair = opened(&[1, 2]);
        for id in [1, 2] {
            pair.host.request(pair.now, motor(id), halt).unwrap();
        }
        assert_eq!(pair.run().len(), 2);
        let code = halt[0];
        assert_eq!(pair.codes, [code, code, 0x9A, 0x9A, 0x9C, 0x9C]);

        let mut pair = opened(&[1]);
        for end in [Err(Failure::Quarantined), Ok(halt)] {
            pair.host.request(pair.now, motor(1), halt).unwrap();
            assert_eq!(pair.run(), [(motor(1), end)]);
            pair.wait(DEFAULT_QUARANTINE);
        }
    }
}

#[test]
fn an_off_that_was_answered_is_repeated_after_the_silence_that_its_acknowledge_needs() {
    let mut pair = opened(&[1]);
    pair.request(1, Off).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Quarantined))]);
    let until = pair.now + DEFAULT_QUARANTINE;
    assert_eq!(pair.request(1, Off), Err(RequestError::Quarantined { id: motor(1), until }));
    // A Stop was not sent yet.
    pair.request(1, Stop).unwrap();
    pair.run();
    pair.wait(DEFAULT_QUARANTINE);
    pair.request(1, Off).unwrap();
    assert_eq!(pair.run(), [(motor(1), Ok(Off.encode()))]);
    assert_eq!(pair.codes, [0x80, 0x9A, 0x9C, 0x81, 0x9A, 0x9C, 0x80]);
}

#[test]
fn an_off_is_sent_again_to_a_motor_that_does_not_fall_silent() {
    let mut pair = opened(&[1]);
    pair.request(1, Off).unwrap();
    let sent = pair.now;
    pair.run();
    while let Err(RequestError::Quarantined { until, .. }) = pair.request(1, Off) {
        assert!(until > pair.now && until <= sent + DEFAULT_QUARANTINE + DEFAULT_QUARANTINE);
        pair.wait(Micros(until.since(pair.now).0 / 2 + 1));
        pair.host.receive(pair.now, &CanFrame::new(0x141, ReadPid.encode()));
    }
    assert_eq!(pair.now, sent + DEFAULT_QUARANTINE + DEFAULT_QUARANTINE);
    pair.run();
    assert_eq!(pair.codes, [0x80, 0x9A, 0x9C, 0x80, 0x9A, 0x9C]);
}

#[test]
fn off_goes_out_at_each_attempt_to_a_motor_that_is_silent() {
    let (mut host, mut now) = (Host::new(), Instant(0));
    for _ in 0..3 {
        host.request(now, motor(1), Off.encode()).unwrap();
        let sent = Output::Transmit(CanFrame::new(0x141, Off.encode()));
        assert_eq!(host.poll(now), sent);
        now += DEFAULT_TIMEOUT;
        let silent = Output::Done { id: motor(1), result: Err(Failure::Timeout) };
        assert_eq!(host.poll(now), silent);
    }
}

#[test]
fn an_echoed_question_is_reported_as_an_echo() {
    for mut host in [Host::new(), trusted_host()] {
        host.request(Instant(0), motor(1), ReadStatus.encode()).unwrap();
        let Output::Transmit(frame) = host.poll(Instant(0)) else { panic!("it is sent") };
        host.receive(Instant(1), &frame);
        let echo = Output::Done { id: motor(1), result: Err(Failure::Echo) };
        assert_eq!(host.poll(Instant(1)), echo);
        let now = Instant(1) + DEFAULT_QUARANTINE;
        host.request(now, motor(1), SPEED).unwrap();
        assert!(matches!(host.poll(now), Output::Transmit(frame) if frame.data()[0] == 0x9A));
    }
}

#[test]
fn a_bus_that_is_opened_again_is_not_trusted() {
    let mut pair = Pair::new(&[1]);
    pair.request(1, SetSpeed::default()).unwrap();
    pair.host.reopened(pair.now);
    assert!(pair.host.busy().is_empty());
    pair.request(1, SetSpeed::default()).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Quarantined))]);
}

/// A host, the pending replies to former hosts, and a motor that answers late.
struct Late {
    host: Host,
    node: Node,
    now: Instant,
    delay: Micros,
    coming: Vec<(Instant, CanFrame)>,
    /// Each reply is received twice, with this delay between them.
    copy: Option<Micros>,
}

impl Late {
    /// Repeats the request until it was carried out, or until `end`, when the host exits.
    fn ask(&mut self, request: [u8; 8], end: Instant) -> Option<[u8; 8]> {
        let mut is_asked = false;
        while self.now < end {
            if !is_asked {
                match self.host.request(self.now, motor(1), request) {
                    Ok(()) => is_asked = true,
                    Err(RequestError::Quarantined { until, .. }) => self.pass(until.min(end)),
                    Err(other) => panic!("{other:?}"),
                }
                continue;
            }
            match self.host.poll(self.now) {
                Output::Transmit(frame) => {
                    let reply = self.node.receive(self.now, &frame).unwrap();
                    let at = self.now + self.delay;
                    self.coming.push((at, reply));
                    self.coming.extend(self.copy.map(|apart| (at + apart, reply)));
                    self.coming.sort_by_key(|(at, _)| *at);
                }
                Output::Done { result: Ok(reply), .. } => return Some(reply),
                Output::Done { result: Err(Failure::Quarantined), .. } => is_asked = false,
                Output::Done { .. } => return None,
                Output::Wait(until) => self.pass(until.unwrap().min(end)),
            }
        }
        None
    }

    fn pass(&mut self, until: Instant) {
        let next = self.coming.first().map_or(until, |(at, _)| *at).min(until);
        self.now = self.now.max(next);
        while let Some((at, frame)) = self.coming.first().copied().filter(|(at, _)| *at <= self.now)
        {
            self.coming.remove(0);
            self.host.receive(at, &frame);
        }
    }
}

/// Hosts one after the other. Each has a first request, a lifetime, and a pause after it; it exits
/// without finishing its exchange.
fn in_turn(delay: u32, timeout: u32, copy: Option<u32>, turns: &[(usize, u32, u32)]) {
    let mut late = Late {
        host: Host::new(),
        node: Node::new(1),
        now: Instant(0),
        delay: Micros::from_millis(delay),
        coming: vec![],
        copy: copy.map(Micros::from_millis),
    };
    let requests = [
        ReadPid.encode(),
        ReadStatus.encode(),
        ReadMotionStatus.encode(),
        Off.encode(),
        ReadAcceleration.encode(),
    ];
    for (temperature, &(n, life, pause)) in (1..).zip(turns) {
        late.host = Host::new();
        late.host.set_timeout(Micros::from_millis(timeout));
        // The temperature in a reply identifies the host of the request.
        late.node.motor.sense.temperature = Celsius(temperature);
        let end = late.now + Micros::from_millis(life);
        for n in n.. {
            let request = requests[n % requests.len()];
            let Some(reply) = late.ask(request, end) else { break };
            assert_eq!(reply[0], request[0]);
            if matches!(request[0], 0x9A | 0x9C) {
                assert_eq!(reply[1], temperature as u8, "a reply to a former host");
            }
        }
        late.now += Micros::from_millis(pause);
    }
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn the_reply_to_a_former_host_is_not_matched_to_the_next_request(
        delay in 1u32..400,
        timeout in 20u32..500,
        turns in proptest::collection::vec((0usize..5, 1u32..900, 0u32..100), 2),
    ) {
        in_turn(delay, timeout, None, &turns);
    }

    /// Replies are not later than the quarantine time, or are received twice.
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn hosts_in_turn_never_take_each_others_replies(
        delay in 1u32..80,
        timeout in 20u32..500,
        turns in proptest::collection::vec((0usize..5, 1u32..900, 0u32..100), 2..8),
        copy in proptest::option::of(1u32..20),
    ) {
        in_turn(delay, timeout, copy, &turns);
    }
}
