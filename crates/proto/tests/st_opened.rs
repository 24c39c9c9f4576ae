//! A line that was just opened: pending replies to a former master, and echoes (SPEC-NOTES S16).

use crate::st_bench::{MS, Pair, REQUESTS, STATUS, expected, prepare};
use motorlink_proto::st::*;
use motorlink_proto::time::{Instant, Micros};
use proptest::prelude::*;

const INFO: [u8; 3] = [0x06, 0x00, 0x06];
const GET_STATUS: [u8; 4] = [0x02, 0x01, 0x02, 0x05];
const GET_FLAGS: [u8; 4] = [0x02, 0x01, 0x01, 0x04];

fn opened(recovery: Recovery) -> Master {
    Master::new(MasterConfig { recovery, ..MasterConfig::default() })
}

/// A line that was just opened, to a drive that answers `delay` late.
fn pair(recovery: Recovery, delay: Micros) -> Pair {
    let mut pair = Pair::new(Profile::Spec, recovery);
    pair.master = opened(recovery);
    pair.delay = delay;
    pair
}

#[test]
fn three_questions_bring_a_just_opened_line_in_sync() {
    let mut pair = pair(Recovery::Drain, Micros::from_millis(3));
    pair.drive.set(2, RegisterId::STATUS, 6);
    assert_eq!(pair.exchange(2, STATUS), Ok(vec![6]));
    assert_eq!(pair.sent, [INFO.as_slice(), &GET_STATUS, &GET_FLAGS, &[0x42, 1, 2, 0x45]]);
    assert_eq!(pair.now, Instant(112 * MS), "two silences of 50 ms and four replies");
    assert_eq!(pair.exchange(2, STATUS), Ok(vec![6]));
    assert_eq!(pair.sent.len(), 5, "once");
    assert_eq!(pair.master.counters().losses, 0);
}

#[test]
fn a_trusted_line_gets_the_request_at_once() {
    for master in [opened(Recovery::None), crate::st_bench::master(Recovery::Drain)] {
        let mut pair = pair(Recovery::Drain, Micros(0));
        pair.master = master;
        assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
        assert_eq!(pair.sent.len(), 1);
    }
}

#[test]
fn a_reopened_line_is_not_in_sync() {
    let mut pair = pair(Recovery::Drain, Micros::from_millis(3));
    for _ in 0..2 {
        pair.sent.clear();
        assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
        assert_eq!(pair.sent[..3], [INFO.as_slice(), &GET_STATUS, &GET_FLAGS]);
        pair.master.reopened();
    }
}

/// A drive that answers after 150 ms, and a former master with a timeout of 100 ms.
#[test]
fn the_reply_to_a_former_master_is_not_matched_to_the_next_request() {
    for ms in [1, 20, 49, 51, 150, 400, 900, 1_900] {
        for former in [STATUS, Request::GetBoardInfo, Request::GetFirmwareVersion] {
            let mut pair = pair(Recovery::Drain, Micros::from_millis(ms));
            prepare(&mut pair.drive);
            pair.master.trust_line();
            pair.master.config_mut().timeout = Micros::from_millis(100);
            let late = ms > 100;
            assert_eq!(pair.exchange(1, former).is_err(), late);
            assert_eq!(pair.exchange(1, former).is_err(), late);
            pair.master = opened(Recovery::Drain);
            let read = pair.exchange(1, Request::GetRegister(RegisterId::SPEED_KI));
            if ms < 1_000 {
                assert_eq!(read, Ok(vec![0x78, 0x56]), "{ms} ms behind {former:?}");
            } else {
                assert_eq!(read, Err(ExchangeError::Failed(Failure::Timeout)));
            }
        }
    }
}

/// A loop that passes received bytes on before it polls has the answer before the poll behind the
/// question.
#[test]
fn an_answer_before_the_next_poll_recovers_the_line() {
    let Pair { mut master, mut slave, mut drive, .. } = pair(Recovery::Drain, Micros(0));
    master.request(2, &STATUS).unwrap();
    let (mut now, mut sent) = (Instant(0), 0);
    let end = loop {
        let frame = match master.poll(now) {
            Output::Wait(until) => {
                now = until.unwrap();
                continue;
            }
            Output::Done(result) => break result.map(<[u8]>::to_vec),
            Output::Transmit(frame) => frame.to_vec(),
        };
        sent += 1;
        for byte in frame {
            if let Some(reply) = slave.receive(now, byte, &mut drive) {
                master.receive(now, reply);
            }
        }
    };
    assert_eq!((end, sent), (Ok(vec![0]), 4));
}

/// If the pending replies are unknown, the master waits for the longest possible delay.
#[test]
fn a_refused_question_counts_as_a_slow_answer() {
    let mut master = opened(Recovery::Drain);
    master.request(0, &STATUS).unwrap();
    assert_eq!(master.poll(Instant(0)), Output::Wait(Some(Instant(50 * MS))));
    assert_eq!(master.poll(Instant(50 * MS)), Output::Transmit(&INFO));
    assert_eq!(master.poll(Instant(50 * MS)), Output::Wait(Some(Instant(1_050 * MS))));
    master.receive(Instant(51 * MS), &[0xFF, 0x01, 0x01, 0x02]);
    assert_eq!(master.poll(Instant(51 * MS)), Output::Wait(Some(Instant(2_050 * MS))));
    assert_eq!(master.poll(Instant(2_050 * MS)), Output::Transmit(&GET_STATUS));
}

/// An adapter that echoes, a wire from TX to RX: with a drive behind it or without.
#[test]
fn an_echo_is_not_an_answer_and_is_reported() {
    for (drive, cut) in [(false, 0), (false, 1), (true, 0), (true, 2)] {
        let mut master = opened(Recovery::Drain);
        master.request(1, &STATUS).unwrap();
        let mut now = Instant(0);
        let end = loop {
            let echo = match master.poll(now) {
                Output::Wait(until) => {
                    now = until.unwrap();
                    continue;
                }
                Output::Transmit(sent) => sent.to_vec(),
                Output::Done(result) => break result.map(<[u8]>::to_vec),
            };
            let mut frame = [0; MAX_FRAME];
            let reply = Frame { header: HEADER_ACK, payload: &[0; 32] }.encode(&mut frame).unwrap();
            let came = if drive { [&echo, reply].concat() } else { echo };
            master.receive(now, &came[..cut]);
            master.receive(now, &came[cut..]);
        };
        assert_eq!(
            end,
            Err(ExchangeError::Failed(Failure::Echo)),
            "a drive: {drive}, cut at {cut}"
        );
    }
}

/// GET_BOARD_INFO of a drive with version 6.0.6 begins with the bytes of the question.
#[test]
fn an_answer_that_looks_like_the_question_is_not_an_echo() {
    let mut payload = [0; 32];
    payload[..3].copy_from_slice(&INFO);
    let mut frame = [0; MAX_FRAME];
    let reply = Frame { header: HEADER_ACK, payload: &payload }.encode(&mut frame).unwrap();
    let mut master = opened(Recovery::Drain);
    master.request(0, &STATUS).unwrap();
    for (ms, bytes) in [(0, &[][..]), (50, &[]), (51, reply)] {
        let _ = master.poll(Instant(ms * MS));
        master.receive(Instant(ms * MS), bytes);
    }
    assert_eq!(master.poll(Instant(51 * MS)), Output::Transmit(&GET_STATUS));
}

/// The failures of a wrong baud rate are the same as on a line in sync.
#[test]
fn bytes_instead_of_an_answer_are_reported() {
    let cases = [
        (vec![0x55], Failure::Header(0x55)),
        (vec![0xF0, 0x90], Failure::Damaged(Bad::Length(0x90))),
        (vec![0xF0, 0x00, 0x01], Failure::Damaged(Bad::Checksum { expected: 0xF0, received: 1 })),
        (vec![0xF0, 0x20, 0x00], Failure::Incomplete { received: 3 }),
        (vec![0xFF, 0x01, 0x09, 0x0A], Failure::NotUnderstood(ErrorCode::Timeout)),
        (vec![0xFF, 0x01, 0x0A, 0x0B], Failure::NotUnderstood(ErrorCode::BadCrc)),
        (vec![], Failure::Timeout),
    ];
    for (came, failure) in cases {
        let mut master = opened(Recovery::Drain);
        master.request(0, &STATUS).unwrap();
        for (ms, bytes) in [(0, &[][..]), (50, &[]), (51, &came)] {
            let _ = master.poll(Instant(ms * MS));
            master.receive(Instant(ms * MS), bytes);
        }
        let end = Instant(1_051 * MS);
        assert_eq!(
            master.poll(end),
            Output::Done(Err(ExchangeError::Failed(failure))),
            "{came:02x?}"
        );
    }
}

proptest! {
    /// A former master of any kind. It exits without finishing its exchange.
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn masters_in_turn_never_take_each_others_replies(
        delay in 1u32..1_900,
        turns in proptest::collection::vec((0..REQUESTS.len(), 1u32..4_000, 10u32..1_000), 1..8),
    ) {
        let expected = expected();
        let mut pair = pair(Recovery::Drain, Micros::from_millis(delay));
        prepare(&mut pair.drive);
        for (n, life, timeout) in turns {
            pair.master = opened(Recovery::Drain);
            pair.master.config_mut().timeout = Micros::from_millis(timeout.max(delay / 2 + 1));
            pair.until = Some(pair.now + Micros::from_millis(life));
            for n in n.. {
                let n = n % REQUESTS.len();
                match pair.attempt(1, REQUESTS[n]) {
                    Some(Ok(reply)) => prop_assert_eq!(&Ok(reply), &expected[n], "{:?}", REQUESTS[n]),
                    Some(Err(_)) => {}
                    None => break,
                }
            }
        }
    }
}
