//! Deviations of frames, replies, timing and motor numbers.

use motorlink_proto::st::{ErrorCode, HEADER_ACK, HEADER_NACK};
use motorlink_proto::time::Micros;

use super::{MCSDK, Mutant, ack, answers, caught, hears, mutant, nack, parsed, refuses, says};
use crate::peer::{Deviation, frame};

/// Motors of the drive.
const MOTORS: u8 = 2;

fn low_byte(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte))
}

fn mend(bytes: &mut [u8]) {
    if let Some((check, body)) = bytes.split_last_mut() {
        *check = motorlink_proto::st::checksum(body);
    }
}

/// Whether bytes have the size in their length byte.
fn whole(bytes: &[u8]) -> bool {
    matches!(bytes, [_, length, rest @ ..] if rest.len() == usize::from(*length) + 1)
}

const CHECKSUMS: [Mutant; 6] = [
    mutant("a reply's checksum lacks the high byte", "ST-3.3-04", || {
        says(|_, reply| {
            let last = reply.len() - 1;
            reply[last] = low_byte(&reply[..last]);
        })
    }),
    mutant("a command's checksum is taken without the high byte", "ST-3.3-04", || {
        hears(|_, _, bytes| {
            if whole(bytes) {
                let last = bytes.len() - 1;
                if bytes[last] == low_byte(&bytes[..last]) {
                    mend(bytes);
                } else {
                    mend(bytes);
                    bytes[last] ^= 1;
                }
            }
            None
        })
    }),
    mutant("the checksum is not checked", "ST-4.1-07", || {
        hears(|_, _, bytes| {
            if whole(bytes) {
                mend(bytes);
            }
            None
        })
    }),
    mutant("a damaged frame is carried out and refused", "ST-4.3-03", || {
        hears(|station, now, bytes| {
            let damaged = whole(bytes) && parsed(bytes).is_none();
            if damaged {
                mend(bytes);
                station.receive(now, bytes, |_| {});
            }
            damaged.then(|| nack(ErrorCode::BadCrc))
        })
    }),
    mutant("the motor is checked before the checksum", "ST-4.1-09", || {
        hears(|_, _, bytes| {
            (whole(bytes) && bytes[0] >> 5 > MOTORS).then(|| nack(ErrorCode::BadMotorSelected))
        })
    }),
    mutant("a damaged frame selects its motor", "ST-4.1-09", || {
        hears(|station, now, bytes| {
            if whole(bytes) && parsed(bytes).is_none() {
                let select = frame(bytes[0] & 0xE0 | 0x02, &[0]);
                station.receive(now, &select, |_| {});
            }
            None
        })
    }),
];

const REPLIES: [Mutant; 11] = [
    mutant("a NACK has motor bits", "ST-3.2-02", || {
        says(|request, reply| {
            if reply[0] == HEADER_NACK {
                *reply = frame(0x1F | request[0] & 0xE0, &reply[2..3]);
            }
        })
    }),
    mutant("an ACK with a payload has motor bits", "ST-3.1-12", || {
        says(|request, reply| {
            if reply[0] == HEADER_ACK && reply[1] > 4 {
                *reply = frame(0x10 | request[0] & 0xE0, &reply[2..reply.len() - 1]);
            }
        })
    }),
    mutant("a NACK has no error code", "ST-4.3-04", || {
        says(|_, reply| {
            if reply[0] == HEADER_NACK {
                *reply = frame(HEADER_NACK, &[]);
            }
        })
    }),
    mutant("a NACK has two error codes", "ST-4.3-04", || {
        says(|_, reply| {
            if reply[0] == HEADER_NACK {
                *reply = frame(HEADER_NACK, &[reply[2], reply[2]]);
            }
        })
    }),
    mutant("a NACK has the code NONE", "ST-4.3-05", || {
        refuses(|_, code| if code == ErrorCode::GetWriteOnly { ErrorCode::None } else { code })
    }),
    mutant("a refusal is sent twice", "ST-2-03", || {
        says(|_, reply| {
            if reply[0] == HEADER_NACK {
                *reply = [reply.clone(), reply.clone()].concat();
            }
        })
    }),
    mutant("every reply is sent twice", "ST-2-03", || {
        says(|_, reply| *reply = [reply.clone(), reply.clone()].concat())
    }),
    mutant("a reply comes after 1.5 s", "ST-4.1-04", || Deviation {
        late: Some(|_| Micros::from_millis(1_500)),
        ..Deviation::default()
    }),
    mutant("bytes are sent without a command", "ST-2-01", || Deviation {
        chatter: Some((Micros::from_millis(50), vec![0xF0, 0x00, 0xF0])),
        ..Deviation::default()
    }),
    mutant("acknowledges are commands of no motor", "ST-3.1-14", || {
        answers(|_, _, header, _| {
            matches!(header, HEADER_ACK | HEADER_NACK).then(|| nack(ErrorCode::BadFrameId))
        })
    }),
    mutant("an unknown frame code is acknowledged", "ST-4.1-16", || {
        says(|_, reply| {
            if *reply == nack(ErrorCode::BadFrameId) {
                *reply = ack();
            }
        })
    }),
];

const TIMING: [Mutant; 10] = [
    mutant("a frame that is cut is dropped without a reply", "ST-4.1-08", || {
        says(|_, reply| {
            if *reply == nack(ErrorCode::Timeout) {
                reply.clear();
            }
        })
    }),
    mutant("the timeout is 100 ms", "ST-4.1-08", || Deviation {
        late: Some(|reply| {
            let timeout = *reply == *nack(ErrorCode::Timeout);
            Micros::from_millis(if timeout { 75 } else { 0 })
        }),
        ..Deviation::default()
    }),
    mutant("the timeout is answered with OVERRUN", "ST-4.3-12", || {
        refuses(|_, code| if code == ErrorCode::Timeout { ErrorCode::Overrun } else { code })
    }),
    mutant("late bytes are appended to the frame that timed out", "ST-4.1-08", || Deviation {
        glue: true,
        ..Deviation::default()
    }),
    mutant("a frame is refused before 25 ms", "ST-4.1-08", || {
        hears(|_, _, bytes| {
            (bytes.len() == 2 && bytes[1] > 0).then(|| {
                bytes.clear();
                nack(ErrorCode::Timeout)
            })
        })
    }),
    mutant("the timeout restarts with every byte", "ST-4.1-08", || {
        let mut part: Vec<u8> = Vec::new();
        let mut last = None;
        hears(move |_, now, bytes| {
            // Bytes are kept until the frame is complete, or until 25 ms of silence.
            if last.is_some_and(|last| now.since(last) >= Micros::from_millis(25)) {
                part.clear();
            }
            last = Some(now);
            part.append(bytes);
            let complete = matches!(*part, [_, length, ..] if part.len() > usize::from(length) + 2);
            if complete || part.first() == Some(&0xFF) {
                bytes.append(&mut part);
            }
            None
        })
    }),
    mutant("firmware drops a cut frame after 25 ms", "ST-4.1-08", || {
        let mut last = None;
        let mut part = 0;
        hears(move |station, now, bytes| {
            if part > 0 && last.is_some_and(|last| now.since(last) >= Micros::from_millis(25)) {
                let padding: Vec<u8> = [0xFF; 130].into_iter().chain([0x00, 0xFF]).collect();
                station.receive(now, &padding, |_| {});
                part = 0;
            }
            last = Some(now);
            part = if whole(bytes) { 0 } else { part + bytes.len() };
            None
        })
    })
    .of(MCSDK),
    mutant("a payload of 128 bytes is refused", "ST-3-05", || {
        answers(|_, _, _, payload| (payload.len() == 128).then(|| nack(ErrorCode::WrongSet)))
    }),
    mutant("a length over 128 is accepted", "ST-3-07", || {
        hears(|_, _, bytes| {
            let over = matches!(**bytes, [_, 129..=255, ..]);
            over.then(|| nack(ErrorCode::BadCrc))
        })
    }),
    mutant("firmware accepts a length over 127", "ST-3-07", || {
        let mut deaf = false;
        hears(move |_, _, bytes| {
            deaf |= matches!(**bytes, [0x02, 128..=255]);
            if deaf && bytes.len() != 132 {
                bytes.clear();
            } else {
                deaf = false;
            }
            None
        })
    })
    .of(MCSDK),
];

const MOTOR_NUMBERS: [Mutant; 11] = [
    mutant("motor number 0 is always motor 1", "ST-3.2-07", || {
        hears(|_, _, bytes| {
            let (header, payload) = parsed(bytes)?;
            if header >> 5 == 0 {
                *bytes = frame(header | 1 << 5, &payload);
            }
            None
        })
    }),
    mutant("motor number 0 is refused", "ST-3.2-04", || {
        answers(|_, _, header, _| {
            // The kit's first request is answered, so that the run starts.
            (header >> 5 == 0 && header != 0x02).then(|| nack(ErrorCode::BadMotorSelected))
        })
    }),
    mutant("a refused motor becomes the current one", "ST-3.2-08", || {
        let mut lost = false;
        answers(move |_, _, header, _| {
            match header >> 5 {
                0 => {}
                motor => lost = motor > MOTORS,
            }
            (lost && header >> 5 == 0).then(|| nack(ErrorCode::BadMotorSelected))
        })
    }),
    mutant("a missing motor is treated as the current one", "ST-3.2-07", || {
        hears(|_, _, bytes| {
            let (header, payload) = parsed(bytes)?;
            if header >> 5 > MOTORS {
                *bytes = frame(header & 0x1F, &payload);
            }
            None
        })
    }),
    mutant("a write to a missing motor is carried out and refused", "ST-3.2-08", || {
        answers(|station, now, header, payload| {
            let written = header >> 5 > MOTORS && header & 0x1F == 0x01;
            if written {
                station.receive(now, &frame(0x21, payload), |_| {});
            }
            written.then(|| nack(ErrorCode::BadMotorSelected))
        })
    }),
    mutant("the frame code is checked before the motor", "ST-4.1-15", || {
        answers(|_, _, header, _| {
            (header >> 5 > MOTORS && header & 0x1F == 0x1D).then(|| nack(ErrorCode::BadFrameId))
        })
    }),
    mutant("an unknown frame code does not select its motor", "ST-4.1-10", || {
        answers(|_, _, header, _| (header & 0x1F == 0x1D).then(|| nack(ErrorCode::BadFrameId)))
    }),
    mutant("the current motor is kept over a power cycle", "ST-3.2-05", || Deviation {
        remembers: true,
        ..Deviation::default()
    }),
    mutant("writes reach all motors", "ST-3.2-06", || {
        hears(|station, now, bytes| {
            let (header, payload) = parsed(bytes)?;
            if header == 0x21 {
                station.receive(now, &frame(0x41, &payload), |_| {});
            }
            None
        })
    }),
    mutant("TARGET_MOTOR counts from 1", "ST-4.4-18", || {
        super::gives(0x02, |asked, value| {
            if asked == [0] {
                value[0] += 1;
            }
        })
    }),
    mutant("TARGET_MOTOR accepts a missing motor", "ST-4.4-18", || {
        answers(|_, _, header, payload| {
            let taken = header & 0x1F == 0x01 && matches!(payload, [0, MOTORS..=255]);
            taken.then(ack)
        })
    }),
];

#[test]
fn checksums() {
    caught(&CHECKSUMS);
}

#[test]
fn replies() {
    caught(&REPLIES);
}

#[test]
fn timing() {
    caught(&TIMING);
}

#[test]
fn motor_numbers() {
    caught(&MOTOR_NUMBERS);
}
