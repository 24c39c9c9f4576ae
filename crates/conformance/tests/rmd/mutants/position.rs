//! Positions.

use motorlink_proto::rmd::*;
use motorlink_proto::units::CentiDegrees;

use super::{
    Mutant, are_caught, commands, i32_at, mutant, obey, put_i32, put_u16, requests, u16_at,
};
use crate::drive::{Behaviour, Motors};

#[test]
fn mutants_of_positions_are_caught() {
    are_caught(mutants());
}

fn mutants() -> Vec<Mutant> {
    vec![
        mutant("a3_takes_the_short_way", "RMD-A3-03", short_way(0xA3)),
        mutant("a4_takes_the_short_way", "RMD-A4-03", short_way(0xA4)),
        mutant("a3_counts_from_where_the_motor_is", "RMD-A3-02", {
            commands(|motors, data| {
                (data[0] == 0xA3).then(|| {
                    let mut done = *data;
                    put_i32(&mut done, i32_at(data) + angle(motors));
                    obey(motors, data, done)
                })
            })
        }),
        mutant("a4_in_tenths", "RMD-A4-02", on(0xA4, |d| put_i32(d, i32_at(d).wrapping_mul(10)))),
        mutant("a4_by_the_printed_labels", "RMD-A4-01", on(0xA4, |data| data.rotate_left(1))),
        mutant("a4_knows_no_greatest_speed", "RMD-A4-04", on(0xA4, |data| put_u16(data, 2, 9_999))),
        mutant("a4_takes_0_for_any_speed", "RMD-A4-04", {
            on(0xA4, |data| {
                if u16_at(data, 2) == 0 {
                    put_u16(data, 2, 180);
                }
            })
        }),
        mutant("a5_turns_the_other_way", "RMD-A5-03", on(0xA5, |data| data[1] ^= 1)),
        mutant("a5_always_turns_clockwise", "RMD-A5-04", on(0xA5, |data| data[1] = 0)),
        mutant("a5_takes_another_direction_for_clockwise", "RMD-A5-04", {
            on(0xA5, |data| {
                if data[1] > 1 {
                    data[1] = 0;
                }
            })
        }),
        mutant("a5_takes_any_angle", "RMD-A5-02", {
            on(0xA5, |data| put_u16(data, 4, u16_at(data, 4) % 36_000))
        }),
        mutant("a5_looks_at_null_bytes", "RMD-A5-01", {
            on(0xA5, |data| {
                if data[2] != 0 {
                    put_u16(data, 4, (u16_at(data, 4) + 9_000) % 36_000);
                }
            })
        }),
        mutant("a5_turns_again", "RMD-A5-05", again(0xA5)),
        mutant("a6_turns_again", "RMD-A6-05", again(0xA6)),
        mutant("a6_takes_the_short_way", "RMD-A6-04", {
            commands(|motors, data| {
                (data[0] == 0xA6 && u16_at(data, 4) < 36_000 && data[1] < 2).then(|| {
                    let here = angle(motors);
                    let way = i32::from(u16_at(data, 4)) - here;
                    let way = (way + 18_000).rem_euclid(36_000) - 18_000;
                    let mut done = *data;
                    (done[0], done[1]) = (0xA4, 0);
                    put_i32(&mut done, here + way);
                    obey(motors, data, done)
                })
            })
        }),
        mutant("a6_knows_no_greatest_speed", "RMD-A6-06", on(0xA6, |data| put_u16(data, 2, 9_999))),
        mutant("a6_has_its_angle_in_data_6", "RMD-A6-01", {
            on(0xA6, |data| put_u16(data, 4, u16_at(data, 6)))
        }),
        mutant("a6_ignores_an_acceleration", "RMD-A6-07", without_acceleration(0xA6)),
        mutant("a3_ignores_an_acceleration", "RMD-A3-06", without_acceleration(0xA3)),
    ]
}

/// Changes one command.
fn on(to: u8, change: impl Fn(&mut [u8; 8]) + Send + 'static) -> Behaviour {
    requests(move |data| {
        if data[0] == to {
            change(data);
            data[0] = to;
        }
    })
}

/// The multi-turn angle, 0.01°.
fn angle(motors: &mut Motors) -> i32 {
    let data = motors.ask(Command::encode(&ReadMultiTurnAngle));
    MultiTurnAngle::decode(&data).angle.0 as i32
}

/// Turns by less than half a turn for every difference.
fn short_way(to: u8) -> Behaviour {
    commands(move |motors, data| {
        (data[0] == to).then(|| {
            let here = angle(motors);
            let way = (i32_at(data) - here + 18_000).rem_euclid(36_000) - 18_000;
            let mut done = *data;
            put_i32(&mut done, here + way);
            obey(motors, data, done)
        })
    })
}

/// Repeating the command starts another turn.
fn again(to: u8) -> Behaviour {
    let mut last = None;
    commands(move |motors, data| {
        let same = last == Some(*data);
        last = (data[0] == to).then_some(*data).or(last);
        (same && data[0] == to).then(|| {
            let further = CentiDegrees(angle(motors) + 36_000);
            obey(motors, data, Command::encode(&SetPosition { angle: further }))
        })
    })
}

/// Executes one command without an acceleration limit.
fn without_acceleration(to: u8) -> Behaviour {
    commands(move |motors, data| {
        if data[0] == to {
            let gains = motors.first().drive().settings().gains;
            let settings = Settings { gains, ..Settings::default() };
            motors.first_mut().motor_mut().configure(&settings);
        }
        None
    })
}
