//! Deviations of messages and commands of a motor at rest.

use motorlink_proto::st::ErrorCode;

use super::{MCSDK, Mutant, ack, answers, caught, gives, mutant, nack, refuses, takes};

const EXECUTE: u8 = 0x03;
const BOARD_INFO: u8 = 0x06;
const SET_RAMP: u8 = 0x07;
const GET_REVUP: u8 = 0x08;
const SET_REVUP: u8 = 0x09;
const CURRENT_REF: u8 = 0x0A;
const VERSION: u8 = 0x0C;

const MUTANTS: [Mutant; 36] = [
    mutant("an unknown command is acknowledged", "ST-4.6-03", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == EXECUTE && matches!(payload, [0x10..=255])).then(ack)
        })
    }),
    mutant("an unknown command is WRONG_SET", "ST-4.3-10", || {
        refuses(|_, code| if code == ErrorCode::WrongCmd { ErrorCode::WrongSet } else { code })
    }),
    mutant("RESET is a command in the document's profile", "ST-4.6-03", || {
        answers(|_, _, header, payload| (header & 0x1F == EXECUTE && *payload == [4]).then(ack))
    }),
    mutant("firmware does not know PING", "ST-4.6-38", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == EXECUTE && *payload == [5]).then(|| nack(ErrorCode::WrongCmd))
        })
    })
    .of(MCSDK),
    mutant("a command without a number is acknowledged", "ST-4.6-06", || {
        answers(|_, _, header, payload| (header & 0x1F == EXECUTE && payload.is_empty()).then(ack))
    }),
    mutant("a command with parameters is refused", "ST-4.6-06", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == EXECUTE && payload.len() > 1).then(|| nack(ErrorCode::WrongCmd))
        })
    }),
    mutant("STOP_MOTOR fails at rest", "ST-4.6-13", || {
        answers(|station, _, header, payload| {
            let idle = station.drive().motors()[0].truth().speed_rpm == 0.0;
            (idle && header & 0x1F == EXECUTE && *payload == [2]).then(|| nack(ErrorCode::WrongCmd))
        })
    }),
    mutant("the ACK to a command repeats it", "ST-4.6-04", || {
        gives(EXECUTE, |asked, payload| payload.extend(asked))
    }),
    mutant("IQDREF_CLEAR does nothing", "ST-4.6-27", || {
        answers(|_, _, header, payload| (header & 0x1F == EXECUTE && *payload == [9]).then(ack))
    }),
    mutant("PFC_ENABLE is acknowledged without a PFC", "ST-4.6-31", || {
        answers(|_, _, header, payload| (header == 0x43 && *payload == [0x0A]).then(ack))
    })
    .on(2)
    .spinning(),
    mutant("PFC_DISABLE is acknowledged without a PFC", "ST-4.6-34", || {
        answers(|_, _, header, payload| (header == 0x43 && *payload == [0x0B]).then(ack))
    })
    .on(2),
    mutant("PFC_FAULT_ACK is refused with a PFC", "ST-4.6-37", || {
        answers(|_, _, header, payload| {
            (header == 0x23 && *payload == [0x0C]).then(|| nack(ErrorCode::WrongCmd))
        })
    }),
    mutant("board info has 31 bytes", "ST-4.7-03", || {
        gives(BOARD_INFO, |_, payload| payload.truncate(31))
    }),
    mutant("board info has the version in digits", "ST-4.7-04", || {
        gives(BOARD_INFO, |_, payload| payload[..3].iter_mut().for_each(|byte| *byte += b'0'))
    }),
    mutant("firmware's board info has the version in integers", "ST-4.7-04", || {
        gives(BOARD_INFO, |_, payload| payload[..3].iter_mut().for_each(|byte| *byte -= b'0'))
    })
    .of(MCSDK),
    mutant("the SDK's name is not terminated", "ST-4.7-05", || {
        gives(BOARD_INFO, |_, payload| payload[3..].fill(b'x'))
    }),
    mutant("GET_BOARD_INFO is unknown", "ST-3.1-04", || {
        answers(|_, _, header, _| {
            (header & 0x1F == BOARD_INFO).then(|| nack(ErrorCode::BadFrameId))
        })
    }),
    mutant("GET_FW_VERSION is unknown", "ST-3.1-09", || {
        answers(|_, _, header, _| (header & 0x1F == VERSION).then(|| nack(ErrorCode::BadFrameId)))
    }),
    mutant("SET_CURRENT_REF has the code of the prose", "ST-3.1-08", || {
        answers(|_, _, header, _| {
            (header & 0x1F == CURRENT_REF).then(|| nack(ErrorCode::BadFrameId))
        })
    }),
    mutant("the version string is not terminated", "ST-4.12-04", || {
        gives(VERSION, |_, payload| {
            payload.iter_mut().filter(|byte| **byte == 0).for_each(|byte| *byte = b'0');
        })
    }),
    mutant("the version string is not padded to 32 bytes", "ST-4.12-03", || {
        gives(VERSION, |_, payload| payload.truncate(20))
    }),
    mutant("the version string has a space for the tab", "ST-4.12-05", || {
        gives(VERSION, |_, payload| {
            payload.iter_mut().filter(|byte| **byte == b'\t').for_each(|byte| *byte = b' ');
        })
    }),
    mutant("the major version is 0", "ST-4.12-06", || {
        gives(VERSION, |_, payload| {
            payload.iter_mut().filter(|byte| **byte == b'5').for_each(|byte| *byte = b'0');
        })
    }),
    mutant("a rev-up phase 5 can be read", "ST-4.9-02", || {
        takes(GET_REVUP, |_, payload| {
            if let [phase @ 5] = &mut payload[..] {
                *phase = 4;
            }
        })
    }),
    mutant("rev-up phases beyond 4 can be written", "ST-4.10-03", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == SET_REVUP && payload.first() >= Some(&5)).then(ack)
        })
    }),
    mutant("the rev-up speed has 16 bits", "ST-4.10-04", || {
        takes(SET_REVUP, |_, payload| {
            if let [_, _, _, high @ .., _, _, _, _] = &mut payload[..] {
                high.fill(0);
            }
        })
    }),
    mutant("torque and duration of a rev-up phase are swapped", "ST-4.9-04", || {
        gives(GET_REVUP, |_, payload| payload[4..].rotate_left(2))
    }),
    mutant("a rev-up duration is signed and cut", "ST-4.10-06", || {
        takes(SET_REVUP, |_, payload| {
            if let [.., high] = &mut payload[..] {
                *high &= 0x7F;
            }
        })
    }),
    mutant("all rev-up phases are the same", "ST-4.10-02", || {
        takes(SET_REVUP, |_, payload| {
            if let [phase @ 1..=4, ..] = &mut payload[..] {
                *phase = 0;
            }
        })
    }),
    mutant("writing a rev-up phase is acknowledged with it", "ST-4.10-07", || {
        gives(SET_REVUP, |asked, payload| payload.extend(asked))
    }),
    mutant("a rev-up phase that is too short is filled up", "ST-4.10-08", || {
        takes(SET_REVUP, |_, payload| payload.resize(9, 0))
    }),
    mutant("a ramp that is too short is filled up", "ST-4.8-10", || {
        takes(SET_RAMP, |_, payload| payload.resize(6, 0))
    }),
    mutant("current references that are too short are filled up", "ST-4.11-07", || {
        takes(CURRENT_REF, |_, payload| payload.resize(4, 0))
    }),
    mutant("a ramp is acknowledged with its speed", "ST-4.8-09", || {
        gives(SET_RAMP, |asked, payload| payload.extend(&asked[..4]))
    }),
    mutant("the profiler's question is unknown to firmware", "ST-4.3-15", || {
        answers(|_, _, header, _| (header & 0x1F == 0x0B).then(|| nack(ErrorCode::BadFrameId)))
    })
    .of(MCSDK),
    mutant("a data segment has its registers backwards", "ST-3.1-10", || {
        gives(0x0D, |_, payload| {
            if payload.len() == 9 {
                payload.reverse();
            }
        })
    }),
];

#[test]
fn messages() {
    caught(&MUTANTS);
}
