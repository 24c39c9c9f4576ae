//! Deviations of registers: SET_REG, GET_REG, table 3.

use motorlink_proto::st::{ErrorCode, Profile, RegisterId};

use super::{MCSDK, Mutant, ack, answers, caught, gives, mutant, nack, refuses, takes};
use crate::peer::frame;

const SET: u8 = 0x01;
const GET: u8 = 0x02;

/// The size of a register of table 3, for a value to write.
fn size(id: u8) -> usize {
    RegisterId(id).shape().map_or(4, |shape| usize::from(shape.ty(Profile::Spec).size()))
}

const MUTANTS: [Mutant; 31] = [
    mutant("numbers in registers are big endian", "ST-4.1-20", || {
        let mut both = gives(GET, |_, value| value.reverse());
        both.before = takes(SET, |_, payload| {
            if let [_, value @ ..] = &mut payload[..] {
                value.reverse();
            }
        })
        .before;
        both
    }),
    mutant("numbers that are read are big endian", "ST-4.1-20", || {
        gives(GET, |_, value| value.reverse())
    }),
    mutant("an unknown register reads 0", "ST-4.5-06", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && payload.first() >= Some(&0x89)).then(|| frame(0xF0, &[0]))
        })
    }),
    mutant("a write to an unknown register is acknowledged", "ST-4.4-10", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == SET && payload.first() >= Some(&0x89)).then(ack)
        })
    }),
    mutant("one unknown register can be read", "ST-4.5-06", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && *payload == [0xFF]).then(|| frame(0xF0, &[0]))
        })
    }),
    mutant("a write to a read-only register is acknowledged", "ST-4.4-10", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == SET && payload.first() == Some(&RegisterId::SPEED_MEAS.0)).then(ack)
        })
    }),
    mutant("a read-only register is refused and changed", "ST-4.4-13", || {
        let mut stages = None;
        answers(move |_, _, header, payload| match (header & 0x1F, payload) {
            (SET, [id, value]) if *id == RegisterId::RUC_STAGE_NBR.0 => {
                stages = Some(*value);
                None
            }
            (GET, [id]) if *id == RegisterId::RUC_STAGE_NBR.0 => {
                stages.map(|stages| frame(0xF0, &[stages]))
            }
            _ => None,
        })
    }),
    mutant("a write is refused with WRONG_SET", "ST-4.3-07", || {
        refuses(|_, code| match code {
            ErrorCode::SetReadOnly => ErrorCode::WrongSet,
            code => code,
        })
    }),
    mutant("a read is refused with SET_READ_ONLY", "ST-4.3-08", || {
        refuses(|_, code| match code {
            ErrorCode::GetWriteOnly => ErrorCode::SetReadOnly,
            code => code,
        })
    }),
    mutant("a 16-bit register is read as 4 bytes", "ST-4.5-05", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::BUS_VOLTAGE.0] {
                value.extend([0, 0]);
            }
        })
    }),
    mutant("a 32-bit register is read as 2 bytes", "ST-4.5-05", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::SPEED_MEAS.0] {
                value.truncate(2);
            }
        })
    }),
    mutant("a register of every drive is missing", "ST-4.5-04", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && *payload == [RegisterId::SPEED_KI_DIV.0])
                .then(|| nack(ErrorCode::GetWriteOnly))
        })
    }),
    mutant("one register of a feature is missing", "ST-4.4-11", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && *payload == [RegisterId::FLUXWK_BUS_MEAS.0])
                .then(|| nack(ErrorCode::GetWriteOnly))
        })
    }),
    mutant("a value with a sign is filled up with zeros", "ST-4.4-16", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::RAMP_FINAL_SPEED.0] {
                value[2..].fill(0);
            }
        })
    }),
    mutant("of a longer value the high bytes are written", "ST-4.4-07", || {
        takes(SET, |_, payload| {
            let size = size(*payload.first().unwrap_or(&0));
            if payload.len() > 1 + size {
                payload.drain(1..payload.len() - size);
            }
        })
    }),
    mutant("a longer value is refused", "ST-4.4-06", || {
        answers(|_, _, header, payload| {
            let longer =
                header & 0x1F == SET && payload.len() > 1 + size(*payload.first().unwrap_or(&0));
            longer.then(|| nack(ErrorCode::WrongSet))
        })
    }),
    mutant("a shorter value is filled up with zeros", "ST-4.4-08", || {
        takes(SET, |_, payload| {
            let size = size(*payload.first().unwrap_or(&0));
            if !payload.is_empty() && payload.len() < 1 + size {
                payload.resize(1 + size, 0);
            }
        })
    }),
    mutant("a shorter value is refused", "ST-4.4-09", || {
        answers(|_, _, header, payload| {
            let shorter = header & 0x1F == SET
                && (1..1 + size(*payload.first().unwrap_or(&0))).contains(&payload.len());
            shorter.then(|| nack(ErrorCode::WrongSet))
        })
    }),
    mutant("firmware fills a shorter value up with zeros", "ST-4.4-08", || {
        answers(|station, now, header, payload| {
            let [id @ 5..=7, rest @ ..] = payload else { return None };
            (header & 0x1F == SET && rest.len() == 1).then(|| {
                station.receive(now, &frame(header, &[*id, rest[0], 0]), |_| {});
                nack(ErrorCode::WrongSet)
            })
        })
    })
    .of(MCSDK),
    mutant("a write is acknowledged and discarded", "ST-4.4-05", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == SET && payload.first() == Some(&RegisterId::SPEED_KI.0)).then(ack)
        })
    }),
    mutant("the ACK to a write carries the value", "ST-4.4-05", || {
        gives(SET, |asked, payload| payload.extend(asked.iter().skip(1)))
    }),
    mutant("a register of access D can be read", "ST-4.4-15", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && *payload == [RegisterId::V_Q.0]).then(|| frame(0xF0, &[0, 0]))
        })
    }),
    mutant("a register of access W can be read", "ST-4.4-14", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == GET && *payload == [RegisterId::IQ_SPEEDMODE.0])
                .then(|| frame(0xF0, &[0, 0]))
        })
    }),
    mutant("an unknown control mode is refused", "ST-4.4-19", || {
        answers(|_, _, header, payload| {
            (header & 0x1F == SET && matches!(payload, [3, 2..=255]))
                .then(|| nack(ErrorCode::WrongSet))
        })
    }),
    mutant("a DAC channel accepts any register", "ST-4.4-22", any_for_dac),
    mutant("speeds are tenths of a hertz", "ST-4.4-17", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::RAMP_FINAL_SPEED.0] {
                let speed = i32::from_le_bytes([value[0], value[1], value[2], value[3]]);
                *value = (speed / 6).to_le_bytes().to_vec();
            }
        })
    }),
    mutant("firmware keeps speeds in rpm", "ST-4.4-17", || {
        let mut told = None;
        answers(move |_, _, header, payload| match (header & 0x1F, payload) {
            (SET, [0x5B, speed @ ..]) => {
                told = Some(speed.to_vec());
                None
            }
            (GET, [0x5B]) => told.as_ref().map(|speed| frame(0xF0, speed)),
            _ => None,
        })
    })
    .of(MCSDK),
    mutant("FLAGS lacks what is present", "ST-4.4-21", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::FLAGS.0] {
                value[2..].fill(0);
            }
        })
    }),
    mutant("a GET_REG without a register reads the first", "ST-4.5-07", || {
        takes(GET, |_, payload| {
            if payload.is_empty() {
                payload.push(0);
            }
        })
    }),
    mutant("a SET_REG without a register is acknowledged", "ST-4.4-24", || {
        answers(|_, _, header, payload| (header & 0x1F == SET && payload.is_empty()).then(ack))
    }),
    mutant("IQ_SPEEDMODE is not the Id reference", "ST-4.4-25", || {
        takes(SET, |_, payload| {
            if let [id @ 0x41, ..] = &mut payload[..] {
                *id = RegisterId::PLL_KI.0;
            }
        })
    })
    .spinning(),
];

/// Acknowledges every value of a DAC channel, like shipped firmware.
fn any_for_dac() -> crate::peer::Deviation {
    super::says(|request, reply| {
        if matches!(request, [_, _, 0x1C | 0x1D, ..]) && *reply == nack(ErrorCode::WrongSet) {
            *reply = ack();
        }
    })
}

#[test]
fn registers() {
    caught(&MUTANTS);
}
