//! Every header with every length, in both directions.

use crate::model::{Twins, framed};
use motorlink_proto::st::*;
use motorlink_proto::time::Instant;

/// First bytes of payloads: a valid id, phase, segment or command in one of the messages.
const FIRST: [u8; 4] = [0x00, 0x03, 0x1C, 0x5B];

fn payload(first: u8, length: u8) -> Vec<u8> {
    let rest = (1..length).map(|n| n.wrapping_mul(37) & 0x7F);
    [first].into_iter().chain(rest).take(usize::from(length)).collect()
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn the_slave_answers_every_header_and_length_as_the_model_does() {
    for profile in [Profile::Spec, Profile::Mcsdk54] {
        for (first, motors) in FIRST.into_iter().zip([7, 1, 3, 2]) {
            let mut twins = Twins::new(profile, motors);
            for header in 0..=255 {
                // Behind 40 bytes only the length matters.
                for length in (0..=128).filter(|length| first == 0 || !(40..126).contains(length)) {
                    let reply = twins.frame(header, &payload(first, length));
                    let dropped = profile == Profile::Mcsdk54 && length == 128;
                    assert!(dropped || matches!(reply[..], [HEADER_ACK | HEADER_NACK, ..]));
                    if dropped {
                        // The slave reads the rest as frames. 131 bytes are more than any frame.
                        twins.overrun();
                    }
                }
                for length in 129..=255 {
                    assert_eq!(twins.bytes(&[header, length]), [0_u8; 0]);
                    twins.wait(25_000);
                    twins.poll();
                    twins.overrun();
                }
            }
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_register_command_and_segment_does_as_the_model_does() {
    for profile in [Profile::Spec, Profile::Mcsdk54] {
        let mut twins = Twins::new(profile, 3);
        for motor in 1..=3 {
            let mut ask = |code, payload: &[u8]| {
                twins.frame(Frame::header(code, motor), payload);
            };
            for id in 0..=255 {
                for value in [[0x27; 5], [0xFF; 5], [0xBD, 0, 0, 0, 0], [2, 0x80, 0, 0x80, 1]] {
                    for size in 0..=5 {
                        ask(0x01, &[&[id], &value[..size]].concat());
                        ask(0x02, &[id]);
                    }
                }
                ask(0x03, &[id]);
                ask(0x0E, &[id % 5, id]);
                ask(0x0D, &[id % 5]);
                ask(0x08, &[id]);
                ask(0x09, &[id; 9]);
            }
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn the_master_reads_every_header_and_length() {
    for header in 0..=255u8 {
        for length in 0..=255u8 {
            let mut master = Master::new(MasterConfig::default());
            master.trust_line();
            master.request(0, &Request::GetRegister(RegisterId::STATUS)).unwrap();
            assert!(matches!(master.poll(Instant(0)), Output::Transmit(_)));
            let payload = payload(length ^ header, length.min(128));
            let frame = framed(header, &payload);
            let reply = if length > 128 { &[header, length][..] } else { &frame };
            for byte in reply {
                master.receive(Instant(1), &[*byte]);
            }
            let damaged = ExchangeError::Failed(Failure::Damaged(Bad::Length(length)));
            let expected = match (header, &payload[..]) {
                (HEADER_ACK | HEADER_NACK | HEADER_ATR, _) if length > 128 => Err(damaged),
                // STATUS has one byte.
                (HEADER_ACK, payload) if payload.len() == 1 => Ok(payload),
                (HEADER_ACK, _) => {
                    Err(ExchangeError::Failed(Failure::Size { received: length, fits: None }))
                }
                (HEADER_NACK, []) => Err(ExchangeError::Refused(ErrorCode::None)),
                (HEADER_NACK, [code, ..]) => Err(ExchangeError::Refused(ErrorCode::from(*code))),
                (HEADER_ATR, _) => {
                    assert!(matches!(master.poll(Instant(1)), Output::Wait(Some(_))));
                    assert_eq!(master.counters().identifications, 1);
                    continue;
                }
                _ => Err(ExchangeError::Failed(Failure::Header(header))),
            };
            assert_eq!(master.poll(Instant(1)), Output::Done(expected), "{header:#x} {length}");
        }
    }
}
