//! Deviations of a motor that turns or has a fault.

use motorlink_proto::st::{Flags, MotorNumber, RegisterId, Status};

use super::{Mutant, ack, answers, caught, gives, hears, mutant, parsed, takes};
use crate::peer::{Station, frame};

const SET: u8 = 0x01;
const GET: u8 = 0x02;
const EXECUTE: u8 = 0x03;
const SET_RAMP: u8 = 0x07;
const CURRENT_REF: u8 = 0x0A;

fn status(station: &Station) -> Status {
    station.drive().motors()[0].truth().status
}

fn running(station: &Station) -> bool {
    status(station) == Status::Run
}

fn faulty(station: &Station) -> bool {
    matches!(status(station), Status::FaultNow | Status::FaultOver)
}

/// Replaces a command by another one while a condition is true.
macro_rules! instead {
    ($command:literal, $other:literal, $holds:expr) => {
        || {
            takes(EXECUTE, |station, payload| {
                if *payload == [$command] && $holds(station) {
                    *payload = vec![$other];
                }
            })
        }
    };
}

const MUTANTS: [Mutant; 27] = [
    mutant("START_MOTOR does nothing", "ST-4.6-07", instead!(1, 3, |_: &Station| true)),
    mutant("START_MOTOR stops a motor that runs", "ST-4.6-08", instead!(1, 2, running)),
    mutant("START_MOTOR acknowledges a fault", "ST-4.6-09", instead!(1, 7, faulty)),
    mutant("STOP_MOTOR does nothing", "ST-4.6-11", instead!(2, 3, running)),
    mutant("STOP_RAMP stops the motor", "ST-4.6-14", instead!(3, 2, running)),
    mutant("STOP_RAMP does nothing", "ST-4.6-14", instead!(3, 9, running)),
    mutant("STOP_RAMP starts a ramp", "ST-4.6-15", || {
        hears(|station, now, bytes| {
            if running(station) && parsed(bytes) == Some((0x23, vec![3])) {
                let ramp = frame(0x27, &[0x84, 0x03, 0, 0, 100, 0]);
                station.receive(now, &ramp, |_| {});
                return Some(ack());
            }
            None
        })
    }),
    mutant("START_STOP only starts", "ST-4.6-18", instead!(6, 1, |_: &Station| true)),
    mutant("START_STOP only stops", "ST-4.6-17", instead!(6, 2, |_: &Station| true)),
    mutant("START_STOP acknowledges a fault", "ST-4.6-19", instead!(6, 7, faulty)),
    mutant("FAULT_ACK clears a fault that is present", "ST-4.6-22", || {
        hears(|station, now, bytes| {
            let cleared =
                parsed(bytes) == Some((0x23, vec![7])) && status(station) == Status::FaultNow;
            if cleared {
                let motor = station.drive_mut().motor_mut(MotorNumber::FIRST).expect("motor 1");
                motor.release_faults(Flags::OVER_TEMP);
                let until = now + motorlink_proto::time::Micros::from_millis(5);
                station.advance_to(until);
            }
            None
        })
    }),
    mutant("FAULT_ACK does nothing", "ST-4.6-21", instead!(7, 3, faulty)),
    mutant("ENCODER_ALIGN stops a motor that runs", "ST-4.6-25", instead!(8, 2, running)),
    mutant("ENCODER_ALIGN starts the motor", "ST-4.6-24", || {
        takes(EXECUTE, |station, payload| {
            if *payload == [8] && status(station) == Status::Idle {
                *payload = vec![1];
            }
        })
    }),
    mutant("PFC_ENABLE does nothing", "ST-4.6-29", instead!(0x0A, 3, |_: &Station| true)),
    mutant("PFC_ENABLE switches off an enabled PFC", "ST-4.6-30", || {
        let mut on = false;
        takes(EXECUTE, move |_, payload| match payload[..] {
            [0x0A] if on => *payload = vec![0x0B],
            [0x0A] => on = true,
            [0x0B] => on = false,
            _ => {}
        })
    }),
    mutant("PFC_DISABLE does nothing", "ST-4.6-32", instead!(0x0B, 3, |_: &Station| true)),
    mutant("the duration of a ramp is ignored", "ST-4.8-08", || {
        takes(SET_RAMP, |_, payload| {
            if let [.., low, high] = &mut payload[..] {
                (*low, *high) = (0, 0);
            }
        })
    }),
    mutant("the duration of a ramp is in units of 10 ms", "ST-4.8-08", || {
        takes(SET_RAMP, |_, payload| {
            if let [.., low, high] = &mut payload[..] {
                let ms = u16::from_le_bytes([*low, *high]).saturating_mul(10);
                [*low, *high] = ms.to_le_bytes();
            }
        })
    }),
    mutant("a ramp at rest starts the motor", "ST-4.8-04", || {
        hears(|station, now, bytes| {
            if parsed(bytes).is_some_and(|(header, _)| header == 0x27)
                && status(station) == Status::Idle
            {
                station.receive(now, &frame(0x23, &[1]), |_| {});
            }
            None
        })
    }),
    mutant("a ramp in RUN waits for the next start", "ST-4.8-03", || {
        answers(|station, _, header, _| (header & 0x1F == SET_RAMP && running(station)).then(ack))
    }),
    mutant("a ramp has no sign", "ST-4.8-07", || {
        takes(SET_RAMP, |_, payload| {
            if let [a, b, c, d, ..] = &mut payload[..] {
                let speed = i32::from_le_bytes([*a, *b, *c, *d]).saturating_abs();
                [*a, *b, *c, *d] = speed.to_le_bytes();
            }
        })
    }),
    mutant("a ramp does not end torque mode", "ST-4.8-05", || {
        let mut torque = false;
        answers(move |station, _, header, payload| match (header & 0x1F, payload) {
            (SET, [3, mode]) => {
                torque = *mode == 0 && running(station);
                None
            }
            (GET, [3]) if torque && running(station) => Some(frame(0xF0, &[0])),
            _ => None,
        })
    }),
    mutant("Iq and Id are swapped", "ST-4.11-05", || {
        takes(CURRENT_REF, |_, payload| {
            if payload.len() >= 4 {
                payload[..4].rotate_left(2);
            }
        })
    }),
    mutant("current references in RUN wait for the next start", "ST-4.11-03", || {
        answers(|station, _, header, _| {
            (header & 0x1F == CURRENT_REF && running(station)).then(ack)
        })
    }),
    mutant("current references at rest are discarded", "ST-4.11-04", || {
        answers(|station, _, header, _| {
            (header & 0x1F == CURRENT_REF && !running(station)).then(ack)
        })
    }),
    mutant("STATUS has other numbers", "ST-4.4-20", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::STATUS.0] && value[0] == u8::from(Status::FaultOver) {
                value[0] = u8::from(Status::FaultNow);
            }
        })
    }),
];

#[test]
fn motion() {
    caught(&MUTANTS.map(Mutant::spinning));
}
