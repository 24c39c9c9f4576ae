//! What a bus and a line that were just opened ask first, and what keeps them from an answer.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::Clock;
use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Link, PortError, SlcanLink};
use motorlink::rmd::{self, Error, IqCommand, MotorId, MotorSet, SetTorque4};
use motorlink::slcan::Bitrate;
use motorlink::st::{self, Failure, register};
use motorlink::time::Instant;

const MS: u64 = 1_000;

/// Motors on a bus with a clock of its own, which answer after 1 ms what they are asked.
#[derive(Clone)]
struct Motors {
    clock: Clock,
    sent: Arc<Mutex<Vec<(u64, CanFrame)>>>,
    coming: Arc<Mutex<VecDeque<(Instant, CanFrame)>>>,
    /// Motor 1 answers somebody else each 20 ms.
    is_shared: bool,
    /// Motors that are not there.
    absent: MotorSet,
    /// Replies to 0x92 come twice, the second time after so many ms.
    twice: Option<u32>,
}

impl Motors {
    fn new() -> Self {
        Motors {
            clock: Clock::virtual_time(),
            sent: Arc::default(),
            coming: Arc::default(),
            is_shared: false,
            absent: MotorSet::EMPTY,
            twice: None,
        }
    }

    fn shared() -> Self {
        Motors { is_shared: true, ..Motors::new() }
    }

    fn without(absent: MotorSet) -> Self {
        Motors { absent, ..Motors::new() }
    }

    fn bus(&self) -> rmd::Client {
        rmd::Client::over("bus", Box::new(self.clone()), rmd::Options::default())
    }

    /// When something was sent, ms, to which identifier, and its first byte.
    fn sent(&self) -> Vec<(u64, u32, u8)> {
        let sent = self.sent.lock().unwrap();
        sent.iter().map(|(ms, frame)| (*ms, frame.id(), frame.data()[0])).collect()
    }
}

impl Link for Motors {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }
}

impl CanLink for Motors {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let now = self.clock.now();
        self.sent.lock().unwrap().push((now.0 / MS, *frame));
        let ids = match MotorId::from_can_id(frame.id()) {
            Some(id) => id.into(),
            None => MotorSet::TORQUE4,
        };
        for id in ids.without(self.absent) {
            let mut reply: [u8; 8] = frame.data().try_into().unwrap();
            match frame.data()[0] {
                _ if frame.id() == 0x280 => reply = [0xA1, 25, 0, 0, 0, 0, 0, 0],
                // A temperature and a voltage.
                0x9A | 0x9C => (reply[1], reply[3]) = (25, 240),
                _ => {}
            }
            let at = now + Duration::from_millis(1).into();
            let mut coming = self.coming.lock().unwrap();
            coming.push_back((at, CanFrame::new(id.can_id(), reply)));
            if let (Some(ms), 0x92) = (self.twice, reply[0]) {
                let copy = at + motorlink::time::Micros::from_millis(ms);
                coming.push_back((copy, CanFrame::new(id.can_id(), reply)));
            }
            coming.make_contiguous().sort_by_key(|(at, _)| *at);
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let end = self.clock.now() + timeout.expect("nobody waits for ever").into();
        let mut coming = self.coming.lock().unwrap();
        if coming.front().is_some_and(|(at, _)| *at <= end)
            && let Some((at, frame)) = coming.pop_front()
        {
            self.clock.wait(at);
            return Ok(Some(frame));
        }
        let next = Instant((self.clock.now().0 / (20 * MS) + 1) * 20 * MS);
        if self.is_shared && next <= end {
            self.clock.wait(next);
            return Ok(Some(CanFrame::new(0x141, [0x92, 0, 0, 0, 0, 0, 0, 1])));
        }
        self.clock.wait(end);
        Ok(None)
    }
}

#[test]
fn a_cycle_brings_all_its_motors_in_sync_at_once() {
    let motors = Motors::new();
    let bus = motors.bus();
    let ids = [1, 2, 9].map(|id| MotorId::new(id).unwrap());
    let requests = ids.map(|id| (id, [0x92, 0, 0, 0, 0, 0, 0, 0]));
    for _ in 0..2 {
        let mut answered = 0;
        bus.cycle(&requests, |_, outcome| answered += usize::from(outcome.is_ok())).unwrap();
        assert_eq!(answered, 3);
    }
    let codes: Vec<u8> = motors.sent().into_iter().map(|(_, _, code)| code).collect();
    assert_eq!(codes, [[0x9A; 3], [0x9C; 3], [0x92; 3], [0x92; 3]].concat(), "once");
    assert!(motors.clock.now() < Instant(110 * MS), "{:?}", motors.clock.now());
}

#[test]
fn torques_for_four_motors_are_sent_when_all_are_in_sync() {
    let motors = Motors::new();
    let bus = motors.bus();
    let ids: MotorSet = [1, 2, 4].into_iter().filter_map(MotorId::new).collect();
    let torques = SetTorque4([7; 4].map(IqCommand));
    let replies = bus.set_torque4(torques, ids).unwrap();
    assert!(replies[0].is_some() && replies[1].is_some() && replies[2].is_none());
    assert!(replies.into_iter().flatten().all(|reply| reply.is_ok()));
    let sent: Vec<_> = motors.sent().into_iter().map(|(_, id, _)| id).collect();
    assert_eq!(sent, [0x141, 0x142, 0x144, 0x141, 0x142, 0x144, 0x280]);
}

#[test]
fn torques_for_four_motors_are_sent_to_those_that_answer() {
    let motors = Motors::without(MotorId::new(3).unwrap().into());
    let replies = motors.bus().set_torque4(SetTorque4::default(), MotorSet::TORQUE4).unwrap();
    let replies = replies.map(|reply| reply.expect("all are expected"));
    assert!(matches!(replies[2], Err(Error::Timeout { .. })), "{replies:?}");
    assert_eq!(replies.iter().filter(|reply| reply.is_ok()).count(), 3, "{replies:?}");
    assert_eq!(motors.sent().last().map(|(_, id, _)| *id), Some(0x280));
}

#[test]
fn torques_for_a_motor_that_answers_somebody_else_are_an_error_for_each() {
    let motors = Motors::shared();
    let replies = motors.bus().set_torque4(SetTorque4::default(), MotorSet::TORQUE4).unwrap();
    let failed = replies.map(|reply| reply.expect("each is told").unwrap_err());
    assert!(failed.iter().all(|error| matches!(error, Error::Shared { .. })), "{failed:?}");
    assert!(motors.sent().iter().all(|(_, id, _)| *id != 0x280));
}

#[test]
fn torques_for_motors_that_are_all_silent_are_not_sent() {
    let motors = Motors::without(MotorSet::ALL);
    let bus = motors.bus();
    for _ in 0..3 {
        let replies = bus.set_torque4(SetTorque4::default(), MotorSet::TORQUE4);
        let is_error = |reply: Option<Result<_, Error>>| reply.is_some_and(|reply| reply.is_err());
        assert!(replies.is_err() || replies.is_ok_and(|replies| replies.into_iter().all(is_error)));
    }
    assert!(motors.sent().iter().all(|(_, id, _)| *id != 0x280));
}

#[test]
fn a_motor_that_answers_somebody_else_is_told_as_such() {
    for request in [[0x92, 0, 0, 0, 0, 0, 0, 0], [0x80, 0, 0, 0, 0, 0, 0, 0]] {
        let motors = Motors::shared();
        let shared = motors.bus().raw(MotorId::new(1).unwrap(), request).unwrap_err();
        assert!(matches!(shared, Error::Shared { .. }), "{shared}");
        assert!(motors.clock.now() < Instant(2_500 * MS), "{:?}", motors.clock.now());
        let is_sent = motors.sent().contains(&(0, 0x141, request[0]));
        assert_eq!(is_sent, request[0] == 0x80, "what ends motion does not wait");
        assert!(motors.sent().len() < 50, "{:?}", motors.sent());
    }
}

#[test]
fn a_motors_reply_that_came_twice_is_found_by_the_confirmation() {
    for twice in [None, Some(0), Some(1), Some(2)] {
        let motors = Motors { twice, ..Motors::new() };
        let (bus, id) = (motors.bus(), MotorId::new(1).unwrap());
        for _ in 0..3 {
            bus.raw(id, [0x92, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        }
        match bus.confirm(id) {
            Ok(()) => assert_eq!(twice, None),
            Err(error) => assert!(matches!(error, Error::Unconfirmed { .. }), "{error}"),
        }
        motors.clock.wait(motors.clock.now() + Duration::from_millis(50).into());
        let _ = bus.confirm(id);
        bus.confirm(id).expect("nothing comes any more");
    }
}

#[test]
fn a_scan_tells_of_a_motor_that_answers_somebody_else() {
    let mut found = vec![];
    let id = MotorId::new(1).unwrap();
    Motors::shared().bus().scan(id.into(), |one| found.push(one), |_| {}).unwrap();
    assert_eq!(found, [rmd::ScanResult::Shared(id)]);
}

/// An adapter that says this to each frame, or never anything.
struct Adapter {
    says: Option<&'static [u8]>,
    pending: VecDeque<u8>,
}

impl Link for Adapter {}

impl ByteLink for Adapter {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let Some(says) = self.says else { return Ok(()) };
        for command in bytes.split_inclusive(|byte| *byte == b'\r') {
            self.pending.extend(if command[0] == b't' { says } else { b"\r" });
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], _: Option<Duration>) -> Result<usize, PortError> {
        let size = self.pending.len().min(buffer.len());
        for (slot, byte) in buffer.iter_mut().zip(self.pending.drain(..size)) {
            *slot = byte;
        }
        Ok(size)
    }
}

#[test]
fn an_adapter_that_refuses_or_is_mute_is_named_as_the_cause() {
    for (says, cause) in [
        (Some(&b"\x07"[..]), Some("it refused the frame (BEL)")),
        (None, Some("it has not answered anything")),
        (Some(b"z\r"), None),
    ] {
        let line = Adapter { says, pending: VecDeque::new() };
        let link = SlcanLink::open(line, "adapter", Bitrate::DEFAULT).unwrap();
        let bus = rmd::Client::over("adapter", Box::new(link), rmd::Options::default());
        let error = bus.raw(MotorId::new(1).unwrap(), [0x92, 0, 0, 0, 0, 0, 0, 0]).unwrap_err();
        match cause {
            Some(cause) => assert!(error.to_string().contains(cause), "{error}"),
            None => assert!(matches!(error, Error::Timeout { .. }), "{error}"),
        }
        assert!(error.is_line_failure());
        assert_eq!(bus.trouble().is_some(), cause.is_some());
    }
}

/// A drive that answers a request for a register with its number, in two bytes, and STATUS and FLAGS with
/// their sizes. What it says to the first register comes twice, the second time with the next reply.
#[derive(Default)]
struct Twice {
    replies: VecDeque<Vec<u8>>,
    copy: Option<Vec<u8>>,
    is_doubling: bool,
    /// What is left of replies comes in a pause, too.
    is_talking: bool,
}

impl Link for Twice {
    fn is_fresh(&self) -> bool {
        true
    }
}

impl ByteLink for Twice {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let payload: &[u8] = match bytes[2] {
            _ if bytes[0] == 0x06 => &[0; 32],
            0x01 => &[0; 4],
            0x02 => &[0; 1],
            register => &[register, 0],
        };
        let mut reply = [&[0xF0, payload.len() as u8], payload].concat();
        let sum: u32 = reply.iter().map(|byte| u32::from(*byte)).sum();
        reply.push((sum + (sum >> 8)) as u8);
        self.replies.extend(self.copy.take());
        if self.is_doubling && payload.len() == 2 {
            self.copy = Some(reply.clone());
            self.is_doubling = false;
        }
        self.replies.push_back(reply);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let is_waiting = self.is_talking || timeout.is_none_or(|timeout| !timeout.is_zero());
        let reply = if is_waiting { self.replies.pop_front().unwrap_or_default() } else { vec![] };
        buffer[..reply.len()].copy_from_slice(&reply);
        Ok(reply.len())
    }
}

#[test]
fn a_reply_that_came_twice_is_found_before_its_values_are_relied_on() {
    for (is_doubling, is_talking) in [(false, false), (true, false), (true, true)] {
        let line = Twice { is_doubling, is_talking, ..Twice::default() };
        let client = st::Client::over("line", Box::new(line), st::Options::default());
        let motor = client.motor(1).unwrap();
        let kp = motor.get(register::SPEED_KP).unwrap();
        let ki = motor.get(register::SPEED_KI).unwrap();
        assert_eq!(kp == ki, is_doubling, "nothing tells so far");
        // Longer than a program may take without looking what came.
        std::thread::sleep(Duration::from_millis(1));
        match client.confirm() {
            Ok(()) => assert!(!is_doubling),
            Err(st::Error::Unconfirmed { .. }) if is_talking => {}
            Err(st::Error::Unconfirmed { why, .. }) => {
                let size = Failure::Size { received: 2, fits: None };
                assert!(
                    matches!(**why.as_ref().unwrap(), st::Error::Failed { failure, .. } if failure == size)
                );
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn a_confirmation_finds_a_wrong_value_behind_a_line_that_recovered_since() {
    let line = Twice { is_doubling: true, is_talking: true, ..Twice::default() };
    let client = st::Client::over("line", Box::new(line), st::Options::default());
    let motor = client.motor(1).unwrap();
    let kp = motor.get(register::SPEED_KP).unwrap();
    assert_eq!(motor.get(register::SPEED_KI).unwrap(), kp, "nothing tells so far");
    // The reply for SPEED_KI comes now. The next read finds it and recovers the line.
    std::thread::sleep(Duration::from_millis(1));
    assert_ne!(motor.get(register::SPEED_KD).unwrap(), kp);
    assert!(matches!(client.confirm(), Err(st::Error::Unconfirmed { why: None, .. })));

    motor.get(register::SPEED_KI).unwrap();
    client.confirm().expect("the replies since then are right");
}
