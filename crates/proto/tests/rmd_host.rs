//! The host against drives on a virtual clock.

use crate::rmd_bench::{Pair, motor, trusted_host};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;

fn temperature(reply: &[u8; 8]) -> i8 {
    MotionStatus::decode(reply).temperature.0
}

#[test]
fn a_cycle_over_many_motors_takes_as_long_as_one_exchange() {
    let ids: Vec<u8> = (1..=32).collect();
    let mut pair = Pair::new(&ids);
    for id in &ids {
        pair.request(*id, ReadMotionStatus).unwrap();
    }
    let outcomes = pair.run();
    assert_eq!(pair.now, Instant(800));
    assert_eq!(outcomes.len(), 32);
    for (id, result) in outcomes {
        assert_eq!(temperature(&result.unwrap()), 20 + id.number() as i8);
    }
    assert!(pair.host.busy().is_empty());
    assert_eq!(*pair.host.counters(), Counters::default());
}

/// The reply to 0x31, 0x32, 0x34, 0x80, 0x81 and 0x88 is a copy of the request (3).
#[test]
fn a_reply_that_differs_from_its_request_is_altered() {
    for row in COMMANDS.iter().filter(|row| row.code != Code::ClearErrors) {
        for byte in 1..8 {
            let (mut host, id) = (trusted_host(), motor(1));
            let request = [row.code.into(), 1, 2, 3, 4, 5, 6, 7];
            host.request(Instant(0), id, request).unwrap();
            assert!(matches!(host.poll(Instant(0)), Output::Transmit(_)));
            let mut reply = request;
            reply[byte] ^= 0x10;
            host.receive(Instant(500), &CanFrame::new(id.can_id(), reply));
            let result = if row.echo { Err(Failure::Altered) } else { Ok(reply) };
            assert_eq!(host.poll(Instant(500)), Output::Done { id, result }, "{}", row.paragraph);
            // The motor's own reply may still come.
            let next = host.request(Instant(600), id, ReadMotionStatus.encode());
            let is_left_alone = matches!(next, Err(RequestError::Quarantined { .. }));
            assert_eq!(is_left_alone, row.echo, "{}", row.paragraph);
        }
    }
}

#[test]
fn an_unknown_code_is_sent_and_times_out() {
    let mut pair = Pair::new(&[1]);
    pair.host.request(pair.now, motor(1), [0x60; 8]).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Timeout))]);
    assert_eq!(pair.nodes[0].drive.ignored().unknown, 1);
}

#[test]
fn the_reply_to_clear_errors_may_have_either_code() {
    for clear_reply_0x9b in [false, true] {
        let mut pair = Pair::new(&[1]);
        pair.nodes[0].drive.config.clear_reply_0x9b = clear_reply_0x9b;
        pair.request(1, ClearErrors).unwrap();
        let reply = pair.run()[0].1.unwrap();
        assert_eq!(reply[0], if clear_reply_0x9b { 0x9B } else { 0x9A });
    }
}

#[test]
fn four_torques_in_one_frame_reach_their_motors_and_all_answer() {
    let mut pair = Pair::new(&[1, 2, 3, 4, 5]);
    let torques = SetTorque4([100, -100, 0, 2000].map(IqCommand));
    pair.host.set_torque4(pair.now, torques, MotorSet::TORQUE4).unwrap();
    let outcomes = pair.run();
    assert!(outcomes.iter().map(|(id, _)| id.number()).eq([1, 2, 3, 4]));
    for (id, result) in outcomes {
        let reply = result.unwrap();
        assert_eq!(reply[0], 0xA1);
        assert_eq!(temperature(&reply), 20 + id.number() as i8);
    }
    let modes = pair.nodes.iter().map(|node| node.motor.mode);
    assert!(
        modes.eq([100, -100, 0, 2000]
            .map(|digits| Mode::Torque(IqCommand(digits)))
            .into_iter()
            .chain([Mode::Off]))
    );
    assert_eq!(pair.log, [0x280, 0x141, 0x142, 0x143, 0x144]);
}

#[test]
fn four_torques_are_refused_as_a_whole() {
    let mut host = trusted_host();
    let now = Instant(0);
    let none = SetTorque4::default();
    let beyond = host.set_torque4(now, none, MotorSet::from(motor(5)));
    assert_eq!(beyond, Err(RequestError::OutOfReach(motor(5))));

    let current = Some(IqCommand(10));
    host.set_limits(motor(3), Limits { current, ..Limits::default() });
    let torques = SetTorque4([0, 0, 11, 0].map(IqCommand));
    let limited = host.set_torque4(now, torques, MotorSet::TORQUE4);
    assert!(matches!(limited, Err(RequestError::Limit { id, .. }) if id == motor(3)));

    host.request(now, motor(4), ReadMotionStatus.encode()).unwrap();
    let busy = host.set_torque4(now, none, MotorSet::from(motor(1)));
    assert_eq!(busy, Err(RequestError::Busy(motor(4))));
    assert_eq!(host.busy(), MotorSet::from(motor(4)));
}

#[test]
fn while_four_torques_wait_to_be_sent_their_motors_are_busy() {
    let mut host = trusted_host();
    host.set_torque4(Instant(0), SetTorque4::default(), MotorSet::from(motor(1))).unwrap();
    assert_eq!(host.busy(), MotorSet::TORQUE4);
    let data = ReadMotionStatus.encode();
    assert_eq!(host.request(Instant(0), motor(2), data), Err(RequestError::Busy(motor(2))));
    assert_eq!(host.request(Instant(0), motor(5), data), Ok(()));
}

#[test]
fn an_unexpected_reply_to_four_torques_is_not_matched_to_another_exchange() {
    let mut pair = Pair::new(&[1, 2]);
    pair.nodes[1].turnaround = Micros(2_000);
    for _ in 0..2 {
        pair.host.set_torque4(pair.now, SetTorque4::default(), MotorSet::from(motor(1))).unwrap();
        assert_eq!(pair.run().len(), 1);
    }
    let torque = SetTorque { iq: IqCommand(1) };
    assert!(matches!(pair.request(2, torque), Err(RequestError::Quarantined { .. })));
    pair.wait(Micros(5_000));
    assert_eq!(pair.host.counters().late, 2);
    assert_eq!(pair.request(2, Off), Ok(()), "off is still possible");
}

#[test]
fn a_motor_has_one_exchange_at_a_time() {
    let mut pair = Pair::new(&[1]);
    pair.request(1, ReadStatus).unwrap();
    assert_eq!(pair.request(1, ReadMotionStatus), Err(RequestError::Busy(motor(1))));
    pair.run();
    assert_eq!(pair.request(1, ReadMotionStatus), Ok(()));
}

#[test]
fn the_timeout_starts_when_the_request_is_sent() {
    let mut host = trusted_host();
    host.request(Instant(0), motor(1), ReadStatus.encode()).unwrap();
    let sent = Instant(1_000_000);
    assert!(matches!(host.poll(sent), Output::Transmit(_)));
    assert_eq!(host.poll(sent), Output::Wait(Some(sent + DEFAULT_TIMEOUT)));
    let Output::Done { result, .. } = host.poll(sent + DEFAULT_TIMEOUT) else {
        panic!("the time is over")
    };
    assert_eq!(result, Err(Failure::Timeout));
    assert_eq!(host.poll(sent + DEFAULT_TIMEOUT), Output::Wait(None));
}

#[test]
fn each_request_may_have_its_own_timeout() {
    let mut host = trusted_host();
    let (now, data) = (Instant(0), ReadStatus.encode());
    host.set_timeout(Micros(500));
    host.request(now, motor(1), data).unwrap();
    host.request_within(now, motor(2), data, Micros(200)).unwrap();
    let mut failed = vec![];
    let mut now = now;
    loop {
        match host.poll(now) {
            Output::Transmit(_) => {}
            Output::Done { id, .. } => failed.push((now.0, id.number())),
            Output::Wait(Some(until)) => now = until,
            Output::Wait(None) => break,
        }
    }
    assert_eq!(failed, [(200, 2), (500, 1)]);
}

#[test]
fn a_late_reply_is_counted_and_ends_the_quarantine() {
    let mut pair = Pair::new(&[1]);
    pair.nodes[0].turnaround = Micros::from_millis(60);
    pair.request(1, ReadMotionStatus).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Timeout))]);
    let until = pair.now + DEFAULT_QUARANTINE;
    let refused = Err(RequestError::Quarantined { id: motor(1), until });
    assert_eq!(pair.request(1, ReadMotionStatus), refused);

    pair.wait(Micros::from_millis(10));
    assert_eq!(pair.host.counters().late, 1);
    pair.nodes[0].turnaround = Micros(800);
    pair.nodes[0].motor.sense.temperature = Celsius(77);
    pair.request(1, ReadMotionStatus).unwrap();
    assert_eq!(temperature(&pair.run()[0].1.unwrap()), 77);
}

#[test]
fn a_quarantine_ends_with_its_guard_time_when_no_reply_comes() {
    let mut pair = Pair::new(&[]);
    pair.host.set_quarantine(Micros(300));
    pair.request(1, ReadMotionStatus).unwrap();
    pair.run();
    pair.now += Micros(299);
    assert!(pair.request(1, ReadMotionStatus).is_err());
    pair.now += Micros(1);
    assert_eq!(pair.request(1, ReadMotionStatus), Ok(()));
    assert_eq!(pair.host.counters().late, 0);
}

#[test]
fn off_is_sent_during_a_quarantine_and_the_late_reply_is_not_matched() {
    let mut pair = Pair::new(&[1]);
    pair.nodes[0].turnaround = Micros::from_millis(60);
    pair.request(1, ReadMotionStatus).unwrap();
    pair.run();
    pair.request(1, Off).unwrap();
    assert_eq!(pair.run(), [(motor(1), Err(Failure::Timeout))]);
    assert_eq!(pair.host.counters().late, 1);
    assert!(pair.request(1, Off).is_err(), "its own late reply is pending");
    assert_eq!(pair.request(1, Stop), Ok(()));
}

#[test]
fn off_can_be_sent_right_after_a_cancelled_exchange() {
    let mut pair = Pair::new(&[1]);
    pair.request(1, ReadMotionStatus).unwrap();
    assert!(matches!(pair.host.poll(pair.now), Output::Transmit(_)));
    pair.host.cancel(pair.now, motor(1));
    assert!(pair.request(1, ReadMotionStatus).is_err());
    pair.request(1, Off).unwrap();
    assert_eq!(pair.run(), [(motor(1), Ok(Off.encode()))]);

    pair.request(2, ReadMotionStatus).unwrap();
    pair.host.cancel(pair.now, motor(2));
    assert_eq!(
        pair.request(2, ReadMotionStatus),
        Ok(()),
        "nothing was sent, so no reply is pending"
    );
}

#[test]
fn cancelling_one_motor_cancels_the_four_torques_that_would_reach_it() {
    let mut pair = Pair::new(&[1, 2]);
    pair.host.set_torque4(pair.now, SetTorque4::default(), MotorSet::TORQUE4).unwrap();
    pair.host.cancel(pair.now, motor(5));
    assert_eq!(pair.host.busy(), MotorSet::TORQUE4);
    pair.host.cancel(pair.now, motor(2));
    pair.request(2, Off).unwrap();
    assert_eq!(pair.run(), [(motor(2), Ok(Off.encode()))]);
    assert_eq!(pair.log, [0x142, 0x142]);
}

#[test]
fn frames_without_a_request_are_counted_and_dropped() {
    let mut host = trusted_host();
    host.request(Instant(0), motor(1), ReadStatus.encode()).unwrap();
    assert!(matches!(host.poll(Instant(0)), Output::Transmit(_)));
    let data = ReadStatus.encode();
    host.receive(Instant(0), &CanFrame::new(0x142, data));
    host.receive(Instant(0), &CanFrame::new(0x141, ReadMotionStatus.encode()));
    host.receive(Instant(0), &CanFrame::data_frame(0x141, false, &data[..7]));
    host.receive(Instant(0), &CanFrame::data_frame(0x141, true, &data));
    host.receive(Instant(0), &CanFrame::remote_frame(0x141, false, 8));
    host.receive(Instant(0), &CanFrame::new(0x7FF, data));
    let Counters { unasked, malformed, late, .. } = *host.counters();
    assert_eq!((unasked, malformed, late), (2, 3, 0));
    assert!(matches!(host.poll(Instant(0)), Output::Wait(Some(_))));
}

#[test]
fn a_motor_of_another_protocol_is_named_when_the_exchange_fails() {
    for (base, dialect) in [(0x240, Dialect::V3), (0x180, Dialect::LkTech)] {
        let mut host = trusted_host();
        host.request(Instant(0), motor(7), ReadStatus.encode()).unwrap();
        assert!(matches!(host.poll(Instant(0)), Output::Transmit(_)));
        host.receive(Instant(0), &CanFrame::new(base + 7, ReadStatus.encode()));
        let Output::Done { result, .. } = host.poll(Instant(0) + DEFAULT_TIMEOUT) else {
            panic!("the time is over")
        };
        assert_eq!(result, Err(Failure::Foreign(dialect)));
        let Counters { foreign_v3, foreign_lk, last_foreign, .. } = *host.counters();
        assert_eq!(foreign_v3 + foreign_lk, 1);
        assert_eq!(last_foreign, Some((dialect, motor(7))));
    }
}

#[test]
fn limits_apply_to_raw_frames_of_their_motor_only() {
    let mut pair = Pair::new(&[1, 2]);
    let limits = Limits { current: Some(IqCommand(50)), ..Limits::default() };
    pair.host.set_limits(motor(1), limits);
    let raw = [0xA1, 0, 0, 0, 51, 0, 0, 0];
    let refused = pair.host.request(pair.now, motor(1), raw);
    let exceeded = Exceeded::Current { value: IqCommand(51), limit: IqCommand(50) };
    assert_eq!(refused, Err(RequestError::Limit { id: motor(1), exceeded }));
    assert_eq!(
        refused.unwrap_err().to_string(),
        "motor 1: torque current 0.816 A is beyond the limit of 0.800 A"
    );
    assert_eq!(pair.host.request(pair.now, motor(2), raw), Ok(()));
    assert_eq!(pair.run().len(), 1);
    assert_eq!(pair.log, [0x142, 0x142]);
}

/// A host after the timeout and the quarantine time of a request with this code to motor 1.
fn unanswered(code: u8) -> (Host, Instant) {
    let mut host = trusted_host();
    host.request(Instant(0), motor(1), [code, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert!(matches!(host.poll(Instant(0)), Output::Transmit(_)));
    let timeout = Instant(0) + DEFAULT_TIMEOUT;
    let failed = Output::Done { id: motor(1), result: Err(Failure::Timeout) };
    assert_eq!(host.poll(timeout), failed);
    (host, timeout + DEFAULT_QUARANTINE)
}

const QUESTION: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];
const ANSWER: [u8; 8] = [0x9A, 25, 0, 0xF0, 0, 0, 0, 0];

#[test]
fn a_motor_that_did_not_answer_is_asked_for_its_status_and_then_has_to_be_silent() {
    let (mut host, asked) = unanswered(0x9C);
    let (own, question) = (ReadMotionStatus.encode(), CanFrame::new(0x141, QUESTION));
    host.request(asked, motor(1), own).unwrap();
    assert_eq!(host.poll(asked), Output::Transmit(question));
    let heard = asked + Micros::from_millis(10);
    host.receive(heard, &CanFrame::new(0x141, ANSWER));
    let answered = Output::Done { id: motor(1), result: Err(Failure::Quarantined) };
    assert_eq!(host.poll(heard), answered);

    // A late reply that is not the only pending one prolongs the quarantine.
    let again = |until| Err(RequestError::Quarantined { id: motor(1), until });
    assert_eq!(host.request(heard, motor(1), own), again(heard + DEFAULT_QUARANTINE));
    host.request(heard, motor(1), Off.encode()).unwrap();
    assert_eq!(host.poll(heard), Output::Transmit(CanFrame::new(0x141, Off.encode())));
    let timeout = heard + DEFAULT_TIMEOUT;
    assert!(matches!(host.poll(timeout), Output::Done { result: Err(Failure::Timeout), .. }));
    let late = timeout + Micros::from_millis(90);
    host.receive(late, &CanFrame::new(0x141, own));
    assert_eq!(host.counters().late, 1);
    assert_eq!(host.request(late, motor(1), own), again(late + DEFAULT_QUARANTINE));
    assert_eq!(host.request(late + DEFAULT_QUARANTINE, motor(1), own), Ok(()));
    let sent = Output::Transmit(CanFrame::new(0x141, own));
    assert_eq!(host.poll(late + DEFAULT_QUARANTINE), sent);
}

#[test]
fn a_motor_that_does_not_answer_the_question_is_left_alone_and_asked_again() {
    let (mut host, mut now) = unanswered(0xA2);
    for _ in 0..3 {
        host.request(now, motor(1), SetSpeed::default().encode()).unwrap();
        assert_eq!(host.poll(now), Output::Transmit(CanFrame::new(0x141, QUESTION)));
        now += DEFAULT_TIMEOUT;
        let failed = Output::Done { id: motor(1), result: Err(Failure::Timeout) };
        assert_eq!(host.poll(now), failed);
        let until = now + DEFAULT_QUARANTINE;
        let refused = Err(RequestError::Quarantined { id: motor(1), until });
        assert_eq!(host.request(now, motor(1), SetSpeed::default().encode()), refused);
        // Two kinds of replies are pending. None of them is the reply to Off.
        for halt in [Off.encode(), Stop.encode()] {
            host.request(now, motor(1), halt).unwrap();
            host.cancel(now, motor(1));
        }
        now = until;
    }
}

#[test]
fn off_is_sent_to_a_motor_that_keeps_sending() {
    let (mut host, _) = unanswered(0x80);
    let mut now = Instant(0) + DEFAULT_TIMEOUT;
    let until = now + DEFAULT_QUARANTINE;
    host.request(now, motor(1), Stop.encode()).unwrap();
    host.poll(now);
    host.cancel(now, motor(1));
    while now < until {
        host.receive(now, &CanFrame::new(0x141, ReadMotionStatus.encode()));
        let refused = Err(RequestError::Quarantined { id: motor(1), until });
        assert_eq!(host.request(now, motor(1), Off.encode()), refused, "at {}", now.0);
        now += Micros::from_millis(10);
    }
    assert_eq!(host.request(now, motor(1), Off.encode()), Ok(()));
    assert_eq!(host.poll(now), Output::Transmit(CanFrame::new(0x141, Off.encode())));
}

#[test]
fn four_torques_are_not_sent_while_one_of_the_motors_is_in_doubt() {
    let mut pair = Pair::new(&[1, 2]);
    let expect: MotorSet = [1, 2].map(motor).into_iter().collect();
    let (mut host, now) = unanswered(0x9C);
    std::mem::swap(&mut pair.host, &mut host);
    pair.now = now;
    let torques = SetTorque4([7; 4].map(IqCommand));
    pair.host.set_torque4(now, torques, expect).unwrap();
    assert!(pair.run().iter().all(|(_, result)| *result == Err(Failure::Quarantined)));
    assert_eq!(pair.log, [0x141, 0x142, 0x141, 0x142]);
    let refused = pair.host.set_torque4(pair.now, torques, expect);
    assert!(matches!(refused, Err(RequestError::Quarantined { id, .. }) if id == motor(1)));
    pair.wait(DEFAULT_QUARANTINE);
    pair.host.set_torque4(pair.now, torques, expect).unwrap();
    assert!(pair.run().iter().all(|(_, result)| result.is_ok()));
    assert!(pair.nodes.iter().all(|node| node.motor.mode == Mode::Torque(IqCommand(7))));
}
