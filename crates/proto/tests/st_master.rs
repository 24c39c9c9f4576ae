//! The master alone and with a slave, on a virtual clock.

use crate::st_bench::{MS, Pair, REQUESTS, STATUS, expected, master, prepare};
use motorlink_proto::st::*;
use motorlink_proto::time::{Instant, Micros};
use proptest::prelude::*;

#[test]
fn a_refusal_keeps_its_code_and_the_line_unless_the_frame_was_damaged() {
    let mut master = master(Recovery::None);
    for code in 0..=255 {
        master.request(0, &STATUS).unwrap();
        assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
        let mut out = [0; 8];
        let nack = Frame { header: HEADER_NACK, payload: &[code] }.encode(&mut out).unwrap();
        master.receive(Instant(1), nack);
        let damaged = matches!(code, 0x08..=0x0A);
        let code_of = ErrorCode::from(code);
        let error = if damaged {
            ExchangeError::Failed(Failure::NotUnderstood(code_of))
        } else {
            ExchangeError::Refused(code_of)
        };
        assert_eq!(master.poll(Instant(1)), Output::Done(Err(error)));
        assert_eq!(u8::from(code_of), code);
        assert_eq!(
            master.sync_state(),
            if damaged { SyncState::Lost } else { SyncState::InSync },
            "{code:#04x}"
        );
        master.reopened();
    }
}

#[test]
fn a_stop_is_sent_at_once_and_again_after_the_recovery() {
    let stop = Request::ExecuteCommand(Command::StopMotor);
    let frame = [0x23, 0x01, 0x02, 0x26];
    for recovery in Recovery::ALL {
        let mut master = master(recovery);
        master.lost();
        master.request(1, &stop).unwrap();
        assert_eq!(master.poll(Instant(0)), Output::Transmit(&frame), "{recovery:?}");
        assert_ne!(master.poll(Instant(0)), Output::Transmit(&frame), "{recovery:?}");
    }
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    pair.master.lost();
    pair.exchange(1, stop).unwrap();
    assert_eq!(pair.sent.last().unwrap(), &frame);
}

#[test]
fn a_raw_stop_is_sent_at_once_and_other_requests_are_not() {
    let start = Request::ExecuteCommand(Command::StartMotor);
    for recovery in [Recovery::Drain, Recovery::Pad] {
        let mut master = master(recovery);
        master.lost();
        master.request_raw(0x23, &[0x02]).unwrap();
        let frame = [0x23, 0x01, 0x02, 0x26];
        assert_eq!(master.poll(Instant(0)), Output::Transmit(&frame), "{recovery:?}");
        for request in [&start, &STATUS] {
            master.lost();
            master.request(1, request).unwrap();
            let frame = request_frame(request);
            assert_ne!(master.poll(Instant(0)), Output::Transmit(&frame), "{recovery:?}");
        }
    }
}

#[test]
fn a_stop_on_a_line_in_sync_is_sent_once() {
    let stop = Request::ExecuteCommand(Command::StopMotor);
    let mut master = master(Recovery::Drain);
    master.request(1, &stop).unwrap();
    assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
    assert!(matches!(master.poll(Instant(0)), Output::Wait(_)));
    for end in [Master::lost, Master::reopened, Master::trust_line] {
        master.lost();
        master.request(1, &stop).unwrap();
        end(&mut master);
        assert_eq!(master.poll(Instant(0)), Output::Wait(None));
    }
}

fn request_frame(request: &Request<'_>) -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    Frame::command(1, request, &mut frame).unwrap().to_vec()
}

#[test]
fn only_one_exchange_is_under_way() {
    let mut master = master(Recovery::None);
    master.request(0, &STATUS).unwrap();
    assert_eq!(master.request(0, &STATUS), Err(RequestError::Busy));
    assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
    assert_eq!(master.request(0, &STATUS), Err(RequestError::Busy));
}

#[test]
fn the_timer_starts_when_the_request_is_out_and_lasts_a_second() {
    let mut master = master(Recovery::None);
    master.request(0, &STATUS).unwrap();
    assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
    let sent = Instant(136 * MS);
    assert_eq!(master.poll(sent), Output::Wait(Some(Instant(1136 * MS))));
    assert_eq!(master.poll(Instant(1136 * MS - 1)), Output::Wait(Some(Instant(1136 * MS))));
    let failed = ExchangeError::Failed(Failure::Timeout);
    assert_eq!(master.poll(Instant(1136 * MS)), Output::Done(Err(failed)));
    assert_eq!(master.sync_state(), SyncState::Lost);
}

#[test]
fn without_recovery_a_lost_line_sends_nothing_until_it_is_reopened() {
    let mut pair = Pair::new(Profile::Spec, Recovery::None);
    pair.cut = Some(0);
    assert_eq!(pair.exchange(0, STATUS), Err(ExchangeError::Failed(Failure::Timeout)));
    let sent = pair.sent.len();
    assert_eq!(pair.exchange(0, STATUS), Err(ExchangeError::Failed(Failure::Lost)));
    assert_eq!(pair.sent.len(), sent, "nothing is sent on a lost line");
    pair.master.reopened();
    assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
}

#[test]
fn a_lost_line_recovers_after_silence_and_a_question() {
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    pair.cut = Some(0);
    pair.exchange(0, STATUS).unwrap_err();
    let lost = pair.now;
    assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
    assert_eq!(pair.sent[1..], [vec![0x06, 0x00, 0x06], vec![0x02, 0x01, 0x02, 0x05]]);
    assert_eq!(pair.now.since(lost), Micros(100 * MS), "two silences of 50 ms");
    assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
    assert_eq!(pair.sent.len(), 4, "recovered once");
}

#[test]
fn recovery_sends_a_question_that_the_lost_reply_cannot_answer() {
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    for (lost, probe) in [
        (Request::GetBoardInfo, [0x08, 0x01, 0x00, 0x09].as_slice()),
        (Request::GetFirmwareVersion, &[0x08, 0x01, 0x00, 0x09]),
        (Request::GetRevupData(0), &[0x06, 0x00, 0x06]),
        (Request::GetBoardInfo, &[0x08, 0x01, 0x00, 0x09]),
    ] {
        pair.cut = Some(0);
        pair.exchange(0, lost).unwrap_err();
        pair.sent.clear();
        pair.exchange(0, STATUS).unwrap();
        assert_eq!(pair.sent[0], probe, "after a lost {lost:?}");
    }
}

#[test]
fn the_longest_exchange_is_five_or_six_timeouts_and_the_silences() {
    for (recovery, ms) in
        [(Recovery::None, 1_000), (Recovery::Drain, 5_150), (Recovery::Pad, 6_200)]
    {
        let config = MasterConfig { recovery, ..MasterConfig::default() };
        assert_eq!(config.longest_exchange(), Micros::from_millis(ms), "{recovery:?}");
    }
}

#[test]
fn only_questions_are_sent_on_a_line_that_does_not_answer() {
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    pair.delay = Micros::from_millis(60_000);
    let start = Request::ExecuteCommand(Command::StartMotor);
    assert_eq!(pair.exchange(1, STATUS), Err(ExchangeError::Failed(Failure::Timeout)));
    for _ in 0..3 {
        assert_eq!(pair.exchange(1, start), Err(ExchangeError::Failed(Failure::Lost)));
    }
    assert!(pair.drive.log.is_empty(), "no START_MOTOR was sent");
}

#[test]
fn a_line_that_never_falls_silent_is_given_up() {
    let mut master = master(Recovery::Drain);
    master.request(0, &STATUS).unwrap();
    assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
    master.receive(Instant(0), &[0x55]);
    assert_eq!(
        master.poll(Instant(0)),
        Output::Done(Err(ExchangeError::Failed(Failure::Header(0x55))))
    );
    master.request(0, &STATUS).unwrap();
    let mut now = Instant(0);
    let result = loop {
        match master.poll(now) {
            Output::Wait(_) => {}
            Output::Transmit(bytes) => panic!("sent {bytes:02x?} during noise"),
            Output::Done(result) => break result,
        }
        now += Micros::from_millis(10);
        master.receive(now, &[0x55]);
    };
    assert_eq!(result, Err(ExchangeError::Failed(Failure::Noise)));
    assert!(now <= Instant(1_100 * MS));
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn padding_recovers_shipped_firmware_after_every_cut() {
    let write = Request::SetRegister { register: RegisterId::SPEED_KP, value: &[0x10, 0x00] };
    let start = Request::ExecuteCommand(Command::StartMotor);
    for (request, size) in [(STATUS, 4), (write, 6), (start, 4)] {
        for cut in 0..size {
            let mut pair = Pair::new(Profile::Mcsdk54, Recovery::Pad);
            pair.cut = Some(cut);
            pair.exchange(2, request).unwrap_err();
            assert_eq!(pair.exchange(2, STATUS), Ok(vec![0]), "{request:?} cut at {cut}");
            let stopped = pair.drive.log.last().is_some_and(|entry| entry == "STOP_MOTOR 2");
            assert_eq!(stopped, request != STATUS, "a cut-off command is followed by a stop");
        }
    }
}

#[test]
fn an_unasked_identification_is_skipped() {
    let mut master = master(Recovery::Drain);
    let mut out = [0; MAX_FRAME];
    let ident = Frame { header: HEADER_ATR, payload: &[7; 13] }.encode(&mut out).unwrap().to_vec();
    let ack = Frame { header: HEADER_ACK, payload: &[6] }.encode(&mut out).unwrap().to_vec();
    for cut in 0..ident.len() {
        master.request(0, &STATUS).unwrap();
        assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
        master.receive(Instant(1), &ident[..cut]);
        assert!(matches!(master.poll(Instant(1)), Output::Wait(_)));
        master.receive(Instant(2), &[&ident[cut..], &ack].concat());
        assert_eq!(master.poll(Instant(2)), Output::Done(Ok(&[6])));
    }
    assert_eq!(master.counters().identifications, ident.len() as u32);
}

#[test]
fn every_prefix_of_a_reply_waits_for_more() {
    let mut out = [0; MAX_FRAME];
    let reply = Frame { header: HEADER_ACK, payload: &[1; 128] }.encode(&mut out).unwrap();
    for cut in 1..reply.len() {
        let mut master = master(Recovery::Drain);
        master.request(0, &STATUS).unwrap();
        assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
        master.receive(Instant(0), &reply[..cut]);
        assert!(matches!(master.poll(Instant(0)), Output::Wait(Some(_))));
        let failed = ExchangeError::Failed(Failure::Incomplete { received: cut as u8 });
        assert_eq!(master.poll(Instant(1000 * MS)), Output::Done(Err(failed)));
    }
}

#[test]
fn bytes_behind_a_reply_lose_the_line_but_not_the_reply() {
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    pair.master.request(0, &STATUS).unwrap();
    assert!(matches!(pair.master.poll(pair.now), Output::Transmit(_)));
    pair.master.receive(pair.now, &[0xF0, 0x01, 0x06, 0xF7, 0xF0, 0x01]);
    assert_eq!(pair.master.poll(pair.now), Output::Done(Ok(&[6])));
    assert_eq!(pair.master.sync_state(), SyncState::Lost);
    assert_eq!(pair.master.counters().unasked_bytes, 2);
    assert_eq!(pair.exchange(0, STATUS), Ok(vec![0]));
}

#[test]
fn two_different_replies_are_not_an_answer() {
    let (mut first, mut second) = ([0; MAX_FRAME], [0; MAX_FRAME]);
    let ack = Frame { header: HEADER_ACK, payload: &[6] }.encode(&mut first).unwrap();
    let other = Frame { header: HEADER_ACK, payload: &[8] }.encode(&mut second).unwrap();
    for (copy, end) in
        [(ack, Ok(&[6][..])), (other, Err(ExchangeError::Failed(Failure::Ambiguous)))]
    {
        let mut master = master(Recovery::Drain);
        master.request(0, &STATUS).unwrap();
        assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
        master.receive(Instant(1), &[ack, copy].concat());
        assert_eq!(master.poll(Instant(1)), Output::Done(end));
        assert_eq!(master.sync_state(), SyncState::Lost);
    }
}

/// Flips one bit of the next request, then sends two requests.
#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn no_bit_flip_of_a_request_shifts_replies_by_one() {
    let write = Request::SetRegister { register: RegisterId::TORQUE_KP, value: &[0x22, 0x11] };
    for (request, size) in [(STATUS, 4), (write, 6), (Request::GetBoardInfo, 3)] {
        for (bit, pause) in (0..size * 8).flat_map(|bit| [0, 30].map(|pause| (bit, pause))) {
            let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
            pair.delay = Micros::from_millis(3);
            pair.drive.set(1, RegisterId::SPEED_KP, 0x0102);
            pair.drive.set(1, RegisterId::SPEED_KI, 0x0304);
            pair.flip = Some(bit);
            let _ = pair.exchange(1, request);
            pair.rest(Micros::from_millis(pause));
            for (register, value) in
                [(RegisterId::SPEED_KP, [2, 1]), (RegisterId::SPEED_KI, [4, 3])]
            {
                if let Ok(read) = pair.exchange(1, Request::GetRegister(register)) {
                    assert_eq!(read, value, "{request:?}, bit {bit}");
                }
            }
        }
    }
}

/// Each request has its delay. Includes those whose replies look like replies to recovery's questions.
fn late(recovery: Recovery, steps: &[(u32, usize)]) {
    let expected = expected();
    let mut pair = Pair::new(Profile::Spec, recovery);
    prepare(&mut pair.drive);
    for &(delay, n) in steps {
        pair.delay = Micros::from_millis(delay);
        let result = pair.exchange(1, REQUESTS[n]);
        assert!(result.is_err() || result == expected[n], "{:?}: {result:?}", REQUESTS[n]);
    }
}

/// What proptest found in former times.
#[test]
fn late_replies_that_were_matched_once() {
    late(Recovery::Drain, &[(1051, 0), (52, 1), (0, 0), (0, 1), (0, 0), (0, 1), (0, 0)]);
    late(Recovery::Drain, &[(1001, 3), (1001, 0), (1001, 0), (0, 0), (1051, 3), (1002, 4)]);
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_late_reply_is_never_matched_to_another_exchange(
        steps in proptest::collection::vec((0u32..2_000, 0..REQUESTS.len()), 1..40),
        pad in any::<bool>(),
    ) {
        late(if pad { Recovery::Pad } else { Recovery::Drain }, &steps);
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn late_replies_of_a_stalled_drive_are_never_matched_to_a_newer_request(
        stops in proptest::collection::vec(0u32..9_000, 1..10),
    ) {
        let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
        let registers = [RegisterId::SPEED_KP, RegisterId::SPEED_KI];
        for register in registers {
            pair.drive.set(1, register, i32::from(register.0));
        }
        for stop in stops {
            let until = pair.now + Micros::from_millis(stop);
            for n in 0..20 {
                pair.delay = until.since(pair.now);
                let register = registers[n % 2];
                if let Ok(value) = pair.exchange(1, Request::GetRegister(register)) {
                    prop_assert_eq!(register.decode(Profile::Spec, &value), Some(i32::from(register.0)));
                }
            }
            prop_assert_eq!(pair.master.sync_state(), SyncState::InSync, "in sync within 20 tries");
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn noise_never_panics_and_an_exchange_always_ends(
        chunks in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..40), 1..60),
        pad in any::<bool>(),
    ) {
        let recovery = if pad { Recovery::Pad } else { Recovery::Drain };
        let mut master = master(recovery);
        // Noise is received every 7 ms, so each wait may end that much later.
        let late = Micros::from_millis(50);
        let bound = MasterConfig { recovery, ..MasterConfig::default() }.longest_exchange() + late;
        let mut chunks = chunks.into_iter();
        let mut now = Instant(0);
        for _ in 0..8 {
            let begun = now;
            master.request(1, &STATUS).unwrap();
            loop {
                match master.poll(now) {
                    Output::Done(_) => break,
                    Output::Transmit(_) => {}
                    Output::Wait(until) => match chunks.next() {
                        Some(noise) => {
                            now += Micros::from_millis(7);
                            master.receive(now, &noise);
                        }
                        None => now = until.unwrap(),
                    },
                }
            }
            prop_assert!(now.since(begun) <= bound);
        }
    }
}

/// 4.5, 4.6 and table 3, SPEC-NOTES S17.
#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn a_reply_of_another_size_is_damage() {
    let answered = |profile: Profile, request: &Request<'_>, size: usize| {
        let mut master = Master::new(MasterConfig { profile, ..MasterConfig::default() });
        master.trust_line();
        master.request(1, request).unwrap();
        assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
        let mut frame = [0; MAX_FRAME];
        let reply = Frame { header: HEADER_ACK, payload: &vec![0x11; size] };
        master.receive(Instant(1), reply.encode(&mut frame).unwrap());
        let result = match master.poll(Instant(1)) {
            Output::Done(result) => result.map(<[u8]>::len),
            other => panic!("{other:?}"),
        };
        let line = if result.is_ok() { SyncState::InSync } else { SyncState::Lost };
        assert_eq!(master.sync_state(), line, "{profile:?} {request:?} {size}");
        result
    };
    let damage = |received: usize, fits| {
        Err(ExchangeError::Failed(Failure::Size { received: received as u8, fits }))
    };
    for register in RegisterId::all().chain([RegisterId(0xF0)]) {
        let sizes = Profile::ALL.map(|profile| {
            let shape = register.shape();
            shape.and_then(|shape| {
                shape.read_size(profile, Features::NONE.with(shape.feature)).map(usize::from)
            })
        });
        let takes =
            |own: Option<usize>, size| own.map_or([1, 2, 4].contains(&size), |own| own == size);
        for size in 0..=8 {
            let request = Request::GetRegister(register);
            let fits = takes(sizes[1], size).then_some(Profile::Mcsdk54);
            let expected = if takes(sizes[0], size) { Ok(size) } else { damage(size, fits) };
            assert_eq!(answered(Profile::Spec, &request, size), expected, "{register} {size}");
            let fits = takes(sizes[0], size).then_some(Profile::Spec);
            let expected = if takes(sizes[1], size) { Ok(size) } else { damage(size, fits) };
            assert_eq!(answered(Profile::Mcsdk54, &request, size), expected, "{register} {size}");
        }
    }
    let nothing = [0; 4];
    for acknowledged in [
        Request::SetRegister { register: RegisterId::SPEED_KP, value: &nothing[..2] },
        Request::ExecuteCommand(Command::StartMotor),
        Request::ExecuteCommand(Command::StopMotor),
        Request::SetRamp(Ramp { speed_rpm: 1, duration_ms: 1 }),
        Request::SetRevupData(0, RevupPhase::default()),
        Request::SetCurrentReference(CurrentReference { iq_s16a: 1, id_s16a: 1 }),
        Request::ConfigureSegment { segment: 0, registers: &nothing },
        Request::SetTorqueRamp(TorqueRamp { torque_s16a: 1, duration_ms: 1 }),
        Request::SetPosition(PositionMove { angle_rad: 1.0, duration_s: 1.0 }),
    ] {
        for profile in Profile::ALL {
            assert_eq!(answered(profile, &acknowledged, 0), Ok(0));
            for size in [1, 2, 4, 32] {
                assert_eq!(answered(profile, &acknowledged, size), damage(size, None));
            }
        }
    }
}
