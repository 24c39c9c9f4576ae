//! Properties of any frames in any order.

use crate::rmd_bench::{Node, motor, trusted_host};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use proptest::prelude::*;
use std::collections::HashMap;

fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id =
        prop_oneof![0x13Eu32..0x164, Just(0x280), 0x17Eu32..0x1A4, 0x23Eu32..0x264, any::<u32>()];
    let first = prop_oneof![prop::sample::select(Code::ALL).prop_map(u8::from), any::<u8>()];
    (id, any::<[u8; 8]>(), first, prop_oneof![9 => Just(8), 1 => 0usize..8], 0u8..20).prop_map(
        |(id, mut data, first, len, kind)| {
            data[0] = first;
            match kind {
                0 => CanFrame::data_frame(id, true, &data[..len]),
                1 => CanFrame::remote_frame(id, false, len as u8),
                _ => CanFrame::data_frame(id, false, &data[..len]),
            }
        },
    )
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_drive_answers_only_its_own_frames_and_only_those_change_it(
        id in 1u8..=32,
        encoder in any::<i64>(),
        bits in 12u8..=18,
        frames in prop::collection::vec(any_frame(), 1..60),
    ) {
        let mut node = Node::new(id);
        node.drive.config.encoder = EncoderBits::new(bits).unwrap();
        node.motor.sense.encoder = encoder;
        for (at, frame) in frames.iter().enumerate() {
            let (set, ram, rom) =
                (node.motor.modes_set, *node.drive.settings(), *node.drive.rom());
            let own = frame.id() == 0x140 + u32::from(id) || (frame.id() == 0x280 && id <= 4);
            match node.receive(Instant(at as u64), frame) {
                Some(reply) => {
                    prop_assert!(own && frame.eight_bytes().is_some());
                    prop_assert_eq!(reply.id(), 0x140 + u32::from(id));
                    let (asked, came) = (frame.data()[0], reply.data()[0]);
                    prop_assert!(frame.id() == 0x280 && came == 0xA1
                        || asked == came || (asked, came) == (0x9B, 0x9A));
                }
                None => {
                    prop_assert_eq!(node.motor.modes_set, set);
                    prop_assert_eq!(*node.drive.settings(), ram);
                    prop_assert_eq!(*node.drive.rom(), rom);
                }
            }
            if let Mode::Torque(torque) = node.motor.mode {
                prop_assert!((-2000..=2000).contains(&torque.0));
            }
        }
    }

    #[test]
    fn the_single_turn_angle_is_the_multi_turn_angle_within_the_turn(
        encoder in -(1i64 << 50)..1 << 50,
        offset in any::<u16>(),
        bits in 12u8..=18,
    ) {
        let mut node = Node::new(1);
        node.drive.config.encoder = EncoderBits::new(bits).unwrap();
        node.motor.sense.encoder = encoder % (1 << 36);
        node.ask(WriteEncoderOffsetRom(EncoderOffset { offset }));
        let multi = node.ask(ReadMultiTurnAngle).angle.0;
        prop_assert_eq!(multi.rem_euclid(36_000), i64::from(node.ask(ReadSingleTurnAngle).angle.0));
        let Encoder { position, raw, offset } = node.ask(ReadEncoder);
        let travels = u32::from(bits.min(16));
        prop_assert_eq!(
            u32::from(position),
            u32::from(raw).wrapping_sub(u32::from(offset)) & ((1 << travels) - 1)
        );
        prop_assert_eq!(node.ask(ReadMotionStatus).encoder, position);
    }

    #[test]
    fn every_frame_can_be_described(frame in any_frame()) {
        for direction in [Some(Direction::HostToDrive), Some(Direction::DriveToHost), None] {
            prop_assert!(!describe(frame, direction).to_string().is_empty());
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn only_its_own_reply_ends_an_exchange(
        asked in prop::collection::vec((1u8..=32, any::<u8>()), 1..8),
        frames in prop::collection::vec(any_frame(), 0..80),
    ) {
        let mut host = trusted_host();
        let mut open = HashMap::new();
        for (id, code) in asked {
            if host.request(Instant(0), motor(id), [code, 0, 0, 0, 0, 0, 0, 0]).is_ok() {
                open.insert(id, code);
            }
        }
        while let Output::Transmit(_) = host.poll(Instant(0)) {}
        for frame in &frames {
            host.receive(Instant(1), frame);
            match host.poll(Instant(1)) {
                Output::Done { id, result } => {
                    prop_assert_eq!(frame.id(), u32::from(id.can_id()));
                    let code = open.remove(&id.number()).expect("it was open");
                    let is_request = frame.data() == [code, 0, 0, 0, 0, 0, 0, 0];
                    let came = frame.data()[0];
                    match result {
                        Ok(reply) => prop_assert_eq!(frame.data(), reply),
                        Err(Failure::Altered) => prop_assert!(!is_request && came == code),
                        Err(Failure::Echo) => prop_assert!(is_request && code == 0x9A),
                        Err(other) => prop_assert!(false, "{other}"),
                    }
                    prop_assert!(came == code || (code, came) == (0x9B, 0x9A));
                }
                Output::Wait(until) => prop_assert_eq!(until.is_none(), open.is_empty()),
                Output::Transmit(_) => prop_assert!(false, "there is nothing to send"),
            }
        }
    }

    /// Replies carry the number of their request. Some take longer than the timeout.
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_late_reply_never_ends_another_exchange(
        steps in prop::collection::vec((1u8..=4, 0u8..3, 1u64..140, any::<bool>(), 0u64..40), 1..150),
    ) {
        let mut host = host();
        let mut now = Instant(0);
        let mut coming: Vec<(Instant, CanFrame)> = vec![];
        let mut last = HashMap::new();
        for (number, (id, code, delay, lost, pause)) in (1u8..).zip(steps) {
            let code = [0x9A, 0x80, 0x9C][usize::from(code)];
            if host.request(now, motor(id), [code, number, 0, 0, 0, 0, 0, 0]).is_ok() {
                last.insert(id, number);
            }
            let until = now + Micros(pause);
            while now < until {
                loop {
                    match host.poll(now) {
                        Output::Transmit(frame) if !lost => {
                            coming.push((now + Micros(delay), answer(&frame)));
                        }
                        Output::Transmit(_) => {}
                        Output::Done { id, result: Ok(reply) } => {
                            prop_assert_eq!(last.get(&id.number()), Some(&reply[1]));
                        }
                        Output::Done { .. } => {}
                        Output::Wait(_) => break,
                    }
                }
                now += Micros(1);
                for (_, frame) in coming.extract_if(.., |(at, _)| *at <= now) {
                    host.receive(now, &frame);
                }
            }
        }
    }

    /// Some replies are lost.
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn late_replies_after_a_stall_are_never_matched_to_a_newer_request(
        steps in prop::collection::vec((0usize..2, any::<bool>(), 0u64..40, 0u64..2_000), 1..60),
    ) {
        let mut bench = Stalling::new();
        for (number, (code, lost, pause, stand)) in (1u8..).zip(steps) {
            // Most of the time the motor does not stall.
            if stand < 600 {
                bench.stall(Micros(stand));
            }
            let request = [[0x9A, 0x9C][code], number, 0, 0, 0, 0, 0, 0];
            let is_asked = bench.host.request(bench.now, motor(1), request).is_ok();
            let result = bench.pass(bench.now + TIMEOUT + Micros(10 + pause), lost);
            prop_assert_eq!(result.is_some(), is_asked, "an exchange ends with its timeout");
            if let Some(Ok(reply)) = result {
                prop_assert_eq!(&reply[..2], &request[..2]);
            }
        }
        let back = bench.now.max(bench.still);
        let request = [0x9C, 0, 0, 0, 0, 0, 0, 0];
        let mut result = None;
        while !matches!(result, Some(Ok(_))) {
            let until = match bench.host.request(bench.now, motor(1), request) {
                Err(RequestError::Quarantined { until, .. }) => until,
                asked => bench.now + asked.map(|()| TIMEOUT).unwrap() + Micros(1),
            };
            result = bench.pass(until, false);
            prop_assert!(bench.now <= back + TIMEOUT + TIMEOUT + QUARANTINE + QUARANTINE + Micros(9));
        }
    }
}

const TIMEOUT: Micros = Micros(50);
const QUARANTINE: Micros = Micros(100);

/// The motor's reply: a copy of the request, with a supply voltage where it has one.
fn answer(request: &CanFrame) -> CanFrame {
    let (id, data) = request.eight_bytes().unwrap();
    let mut reply = *data;
    if matches!(reply[0], 0x9A | 0x9C) {
        reply[3] = 240;
    }
    CanFrame::new(id, reply)
}

fn host() -> Host {
    let mut host = trusted_host();
    host.set_timeout(TIMEOUT);
    host.set_quarantine(QUARANTINE);
    host
}

/// A motor that may stall for any time and then sends all replies at once.
struct Stalling {
    host: Host,
    now: Instant,
    still: Instant,
    coming: Vec<(Instant, CanFrame)>,
}

impl Stalling {
    fn new() -> Self {
        Stalling { host: host(), now: Instant(0), still: Instant(0), coming: vec![] }
    }

    fn stall(&mut self, span: Micros) {
        self.still = self.still.max(self.now + span);
        self.coming.iter_mut().for_each(|(at, _)| *at = self.still.max(*at));
    }

    /// Lets time pass; the result of the exchange that ended.
    fn pass(&mut self, until: Instant, lost: bool) -> Option<Result<[u8; 8], Failure>> {
        let mut ended = None;
        while self.now < until {
            loop {
                match self.host.poll(self.now) {
                    Output::Transmit(frame) if !lost => {
                        self.coming.push((self.still.max(self.now + Micros(1)), answer(&frame)));
                    }
                    Output::Transmit(_) => {}
                    Output::Done { result, .. } => {
                        assert!(ended.replace(result).is_none(), "one exchange, one result");
                    }
                    Output::Wait(_) => break,
                }
            }
            self.now += Micros(1);
            for (_, frame) in self.coming.extract_if(.., |(at, _)| *at <= self.now) {
                self.host.receive(self.now, &frame);
            }
        }
        ended
    }
}
