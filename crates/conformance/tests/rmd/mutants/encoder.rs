//! Encoder, offset, zero, angles.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;

use super::{Mutant, are_caught, code, commands, mutant, on, put_u16, replies, swap, u16_at};
use crate::drive::{Behaviour, Event, Motors};

#[test]
fn mutants_of_encoder_and_angles_are_caught() {
    are_caught(mutants());
}

fn mutants() -> Vec<Mutant> {
    use Code::{ReadEncoder, ReadMultiTurnAngle, ReadSingleTurnAngle};
    let multi = |change: fn(i64) -> i64| {
        on(ReadMultiTurnAngle, move |data| {
            let MultiTurnAngle { angle } = MultiTurnAngle::decode(data);
            let angle = motorlink_proto::units::WideCentiDegrees(change(angle.0));
            *data = MultiTurnAngle { angle }.encode_as(ReadMultiTurnAngle);
        })
    };
    let circle = |change: fn(u16) -> u16| {
        on(ReadSingleTurnAngle, move |data| put_u16(data, 6, change(u16_at(data, 6))))
    };
    vec![
        mutant(
            "the_offset_is_not_subtracted",
            "RMD-90-05",
            on(ReadEncoder, |data| put_u16(data, 2, u16_at(data, 4))),
        ),
        mutant("values_have_a_bit_too_many", "RMD-90-08", on(ReadEncoder, |data| data[5] |= 0x40)),
        mutant("raw_is_high_byte_first", "RMD-90-06", on(ReadEncoder, |data| swap(data, 4))),
        mutant("offset_is_high_byte_first", "RMD-90-07", on(ReadEncoder, |data| swap(data, 6))),
        mutant("position_and_raw_are_swapped", "RMD-90-04", {
            on(ReadEncoder, |data| {
                data.swap(2, 4);
                data.swap(3, 5);
            })
        }),
        mutant("status_2_has_the_raw_position", "RMD-9C-06", {
            commands(|motors, data| {
                (code(data) == Code::ReadMotionStatus).then(|| {
                    let raw = u16_at(&motors.ask(Command::encode(&ReadEncoder_)), 4);
                    let mut reply = motors.ask(*data);
                    put_u16(&mut reply, 6, raw);
                    Some(reply)
                })
            })
        }),
        mutant("a_written_offset_is_lost", "RMD-91-07", lost_offset()),
        mutant("a_written_offset_acts_after_power_on", "RMD-91-02", late_offset()),
        mutant("a_written_offset_is_high_byte_first", "RMD-91-01", {
            commands(|motors, data| {
                (data[0] == 0x91).then(|| {
                    let mut done = *data;
                    swap(&mut done, 6);
                    let mut reply = motors.ask(done);
                    swap(&mut reply, 6);
                    Some(reply)
                })
            })
        }),
        mutant("the_reply_to_an_offset_is_the_request", "RMD-91-03", {
            replies(|request, reply| {
                if request[0] == 0x91 {
                    *reply = *request;
                }
            })
        }),
        mutant("a_zero_acts_at_once", "RMD-19-02", {
            commands(|motors, data| {
                (data[0] == 0x19).then(|| {
                    let reply = motors.ask(*data);
                    let mut write = reply;
                    write[0] = 0x91;
                    motors.ask(write);
                    Some(reply)
                })
            })
        }),
        mutant("a_zero_is_not_written", "RMD-19-03", {
            commands(|motors, data| {
                (data[0] == 0x19).then(|| {
                    let raw = u16_at(&motors.ask(Command::encode(&ReadEncoder_)), 4);
                    Some(EncoderOffset { offset: raw }.encode_as(Code::WriteZeroRom))
                })
            })
        }),
        mutant("the_reply_to_a_zero_has_none", "RMD-19-07", {
            on(Code::WriteZeroRom, |data| put_u16(data, 6, 0))
        }),
        mutant("the_reply_to_a_zero_has_the_old_one", "RMD-19-07", {
            commands(|motors, data| {
                (data[0] == 0x19).then(|| {
                    let mut reply = motors.ask(*data);
                    let old = u16_at(&motors.ask(Command::encode(&ReadEncoder_)), 6);
                    put_u16(&mut reply, 6, old);
                    Some(reply)
                })
            })
        }),
        mutant("48_bits_of_a_multi_turn_angle", "RMD-92-03", {
            on(ReadMultiTurnAngle, |data| data[7] = 0)
        }),
        mutant("a_multi_turn_angle_in_tenths", "RMD-92-05", multi(|angle| angle / 10)),
        mutant("a_multi_turn_angle_that_falls", "RMD-92-04", multi(|angle| -angle)),
        mutant("a_multi_turn_angle_of_one_turn", "RMD-92-04", multi(|a| a.rem_euclid(36_000))),
        mutant("a_single_turn_angle_beyond_the_turn", "RMD-94-04", circle(|a| a.max(36_000))),
        mutant("a_single_turn_angle_high_byte_first", "RMD-94-04", circle(u16::swap_bytes)),
        mutant("a_single_turn_angle_from_elsewhere", "RMD-94-05", {
            circle(|angle| (angle + 1_000) % 36_000)
        }),
        mutant("a_single_turn_angle_that_falls", "RMD-94-06", circle(|a| (36_000 - a) % 36_000)),
    ]
}

use motorlink_proto::rmd::ReadEncoder as ReadEncoder_;

fn write_offset(motors: &mut Motors, offset: u16) -> [u8; 8] {
    motors.ask(Command::encode(&WriteEncoderOffsetRom(EncoderOffset { offset })))
}

/// Writes the offset to RAM only.
pub fn lost_offset() -> Behaviour {
    let mut rom = None;
    Box::new(move |motors, event| {
        match event {
            Event::Frame(frame) if frame.data().first() == Some(&0x91) => {
                rom.get_or_insert(motors.first().drive().rom().encoder_offset);
            }
            Event::Frame(frame) if frame.data().first() == Some(&0x19) => rom = None,
            Event::Frame(_) => {}
            Event::PowerOn => {
                if let Some(offset) = rom {
                    write_offset(motors, offset);
                }
            }
        }
        motors.pass(event)
    })
}

/// Writes the offset to ROM only.
pub fn late_offset() -> Behaviour {
    let mut rom = None;
    Box::new(move |motors, event| match event {
        Event::Frame(frame) => match frame.eight_bytes() {
            Some((id, data)) if data[0] == 0x91 => {
                rom = Some(u16_at(data, 6));
                let offset = u16_at(data, 6);
                let reply = EncoderOffset { offset }.encode_as(Code::WriteEncoderOffsetRom);
                vec![CanFrame::new(id, reply)]
            }
            Some((_, data)) if data[0] == 0x19 => {
                rom = None;
                motors.pass(event)
            }
            _ => motors.pass(event),
        },
        Event::PowerOn => {
            if let Some(offset) = rom.take() {
                write_offset(motors, offset);
            }
            Vec::new()
        }
    })
}
