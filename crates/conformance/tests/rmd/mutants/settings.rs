//! Gains and acceleration.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::units::DpsPerSecond;

use super::{Mutant, are_caught, code, commands, i32_at, mutant, obey, on, put_i32, taken_for};
use crate::drive::{Behaviour, Event};

#[test]
fn mutants_of_gains_and_acceleration_are_caught() {
    are_caught(mutants());
}

fn mutants() -> Vec<Mutant> {
    vec![
        mutant("gains_in_the_order_of_v3", "RMD-31-01", reversed_gains()),
        mutant("ki_before_kp_in_replies", "RMD-30-05", on(Code::ReadPid, |d| d.swap(4, 5))),
        mutant("data_1_is_not_0", "RMD-30-03", on(Code::ReadPid, |data| data[1] = 0x30)),
        mutant(
            "gains_are_read_from_rom",
            "RMD-30-07",
            commands(|motors, data| {
                let rom = motors.first().drive().rom().gains;
                (code(data) == Code::ReadPid).then(|| Some(rom.encode_as(Code::ReadPid)))
            }),
        ),
        mutant("gains_for_ram_go_to_rom", "RMD-31-03", taken_for(0x31, 0x32)),
        mutant("gains_for_rom_go_to_ram", "RMD-32-02", taken_for(0x32, 0x31)),
        mutant(
            "gains_need_a_null_byte_that_is_0",
            "RMD-31-01",
            commands(|_, data| (data[0] == 0x31 && data[1] != 0).then_some(None)),
        ),
        mutant(
            "acceleration_is_read_high_byte_first",
            "RMD-33-04",
            on(Code::ReadAcceleration, |data| data[4..].reverse()),
        ),
        mutant(
            "acceleration_has_16_bits",
            "RMD-34-01",
            commands(|motors, data| {
                (data[0] == 0x34).then(|| {
                    let mut done = *data;
                    (done[6], done[7]) = (0, 0);
                    obey(motors, data, done)
                })
            }),
        ),
        mutant("acceleration_stays", "RMD-34-04", lasting_acceleration()),
        mutant("acceleration_is_kept_and_not_obeyed", "RMD-34-03", scaled_acceleration(0)),
        mutant("acceleration_has_tenfold_digits", "RMD-34-03", scaled_acceleration(10)),
        mutant(
            "acceleration_needs_null_bytes_that_are_0",
            "RMD-34-01",
            commands(|_, data| (data[0] == 0x34 && data[2] != 0).then_some(None)),
        ),
    ]
}

/// Swaps the gains of torque and position.
fn reversed_gains() -> Behaviour {
    let reverse = |mut data: [u8; 8]| {
        data.swap(2, 6);
        data.swap(3, 7);
        data
    };
    commands(move |motors, data| match data[0] {
        0x30 => Some(Some(reverse(motors.ask(*data)))),
        0x31 | 0x32 => Some(obey(motors, data, reverse(*data))),
        _ => None,
    })
}

/// Keeps the acceleration over a power cycle.
fn lasting_acceleration() -> Behaviour {
    let mut last = None;
    Box::new(move |motors, event| {
        match event {
            Event::Frame(frame) if frame.data().first() == Some(&0x34) => {
                last = frame.eight_bytes().map(|(_, data)| *data);
            }
            Event::PowerOn => {
                last.map(|data| motors.ask(data));
            }
            Event::Frame(_) => {}
        }
        motors.pass(event)
    })
}

/// Reads back the written value, but applies it `times` as large; 0 does not apply it.
fn scaled_acceleration(times: i32) -> Behaviour {
    let mut written: Option<i32> = None;
    Box::new(move |motors, event| {
        let Event::Frame(frame) = event else {
            written = None;
            return Vec::new();
        };
        let id = motors.first_id().can_id();
        match frame.eight_bytes().filter(|(to, _)| *to == id) {
            Some((_, data)) if data[0] == 0x34 => {
                let value = i32_at(data);
                written = Some(value);
                let mut done = *data;
                put_i32(&mut done, value.saturating_mul(times));
                obey(motors, data, done).map(|data| CanFrame::new(id, data)).into_iter().collect()
            }
            Some((_, data)) if data[0] == 0x33 && written.is_some() => {
                let acceleration = DpsPerSecond(written.unwrap_or_default());
                let reply = Acceleration { acceleration }.encode_as(Code::ReadAcceleration);
                vec![CanFrame::new(id, reply)]
            }
            _ => motors.pass(event),
        }
    })
}
