//! Off, stop, run; torque and speed; torque for four motors.

use motorlink_conformance::rmd::suite;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;

use super::{
    Mutant, are_caught, code, commands, frames, i32_at, mutant, obey, on, put_i32, put_u16,
    requests, taken_for, u16_at,
};
use crate::drive::{Behaviour, Event, Setup, motor};

#[test]
fn mutants_of_off_stop_run_torque_and_speed_are_caught() {
    are_caught(mutants());
}

#[test]
fn a_motor_that_cannot_be_switched_off_is_stopped_and_not_turned_again() {
    let mut suite = suite();
    suite.retain(|case| case.name.contains("torque"));
    let behaviour = commands(|_, data| (data[0] == 0x80).then_some(Some(*data)));
    let tested = Setup { suite, behaviour, ..Setup::new(vec![motor(1)]) }.run();
    let verdicts: Vec<_> = tested.report.outcomes.iter().map(|o| o.verdict.word()).collect();
    assert_eq!(verdicts[0], "FAILED");
    assert!(verdicts[1..].iter().all(|word| *word == "not run"), "{verdicts:?}");
    assert!(tested.report.lost().contains("cannot be switched off"));
    tested.station(|station| {
        assert!(station.fastest < 1_000.0, "{} °/s", station.fastest);
        assert_eq!(station.motors.first().drive().mode(), Mode::Stopped);
    });
}

fn mutants() -> Vec<Mutant> {
    let mut mutants = off_and_on();
    mutants.extend(torque_and_speed());
    mutants.extend(four());
    mutants
}

fn off_and_on() -> Vec<Mutant> {
    let ignored =
        |ignored: u8| commands(move |_, data| (data[0] == ignored).then_some(Some(*data)));
    vec![
        mutant("off_is_ignored", "RMD-80-02", ignored(0x80)),
        mutant("off_is_a_stop", "RMD-80-03", taken_for(0x80, 0x81)),
        mutant("stop_is_ignored", "RMD-81-02", ignored(0x81)),
        mutant("stop_is_off", "RMD-81-03", taken_for(0x81, 0x80)),
        mutant("run_is_ignored", "RMD-88-02", ignored(0x88)),
        mutant("run_stops", "RMD-88-03", {
            commands(|motors, data| {
                let stopped = motors.first().drive().mode() == Mode::Stopped;
                (data[0] == 0x88 && !stopped).then(|| {
                    let mut done = *data;
                    done[0] = 0x81;
                    obey(motors, data, done)
                })
            })
        }),
        mutant("a_stop_needs_a_run", "RMD-88-02", {
            commands(|motors, data| {
                let stopped = motors.first().drive().mode() == Mode::Stopped;
                let moves = data[0] == 0xA2;
                (stopped && moves).then(|| {
                    let mut reply = motors.ask(Command::encode(&ReadMotionStatus));
                    reply[0] = data[0];
                    Some(reply)
                })
            })
        }),
    ]
}

fn torque_and_speed() -> Vec<Mutant> {
    let torque = |change: fn(i16) -> i16| {
        requests(move |data| {
            if code(data) == Code::SetTorque {
                let torque = u16_at(data, 4) as i16;
                put_u16(data, 4, change(torque) as u16);
            }
        })
    };
    let speed = |change: fn(&mut [u8; 8])| {
        requests(move |data| {
            if code(data) == Code::SetSpeed {
                change(data);
            }
        })
    };
    vec![
        mutant("torque_in_hundredths_of_an_ampere", "RMD-A1-02", torque(|t| t / 8 * 5)),
        mutant("torque_without_its_sign", "RMD-A1-01", torque(i16::saturating_abs)),
        mutant("torque_in_data_2", "RMD-A1-01", {
            requests(|data| {
                if code(data) == Code::SetTorque {
                    (data[4], data[5]) = (data[2], data[3]);
                }
            })
        }),
        mutant("torque_is_answered_as_status_2", "RMD-A1-05", {
            on(Code::SetTorque, |data| data[0] = 0x9C)
        }),
        mutant("torque_is_answered_with_another_temperature", "RMD-A1-06", {
            on(Code::SetTorque, |data| data[1] += 50)
        }),
        mutant("torque_is_answered_with_speed_first", "RMD-A1-07", {
            on(Code::SetTorque, |data| put_u16(data, 2, 100))
        }),
        mutant("speed_in_degrees", "RMD-A2-02", speed(|d| put_i32(d, i32_at(d) * 100))),
        mutant("speed_high_byte_first", "RMD-A2-01", speed(|data| data[4..].reverse())),
        mutant("speed_with_a_current_limit_as_lk", "RMD-A2-01", {
            speed(|data| {
                if data[2..4] == [0, 0] {
                    put_i32(data, 0);
                }
            })
        }),
        mutant("speed_is_answered_with_a_raw_position", "RMD-A2-09", {
            on(Code::SetSpeed, |data| put_u16(data, 6, (u16_at(data, 6) + 1_000) % 0x4000))
        }),
        mutant("speed_is_answered_twice", "RMD-A2-05", {
            frames(|_, reply| vec![reply; 1 + usize::from(reply.data()[0] == 0xA2)])
        }),
        mutant("speed_is_answered_with_another_speed", "RMD-A2-08", {
            on(Code::SetSpeed, |data| put_u16(data, 4, 6_000))
        }),
    ]
}

fn four() -> Vec<Mutant> {
    vec![
        mutant(
            "four_torques_are_answered_highest_id_first",
            "RMD-280-06",
            reordered(|replies| {
                replies.reverse();
            }),
        ),
        mutant("four_torques_are_answered_by_one", "RMD-280-05", reordered(|r| r.truncate(1))),
        mutant(
            "four_torques_are_answered_twice",
            "RMD-280-05",
            reordered(|replies| {
                replies.extend_from_within(..);
            }),
        ),
        mutant(
            "four_torques_are_answered_as_status_2",
            "RMD-280-07",
            reordered(|replies| {
                for reply in replies {
                    let (id, mut data) =
                        reply.eight_bytes().map(|(id, data)| (id, *data)).expect("a reply");
                    data[0] = 0x9C;
                    *reply = CanFrame::new(id, data);
                }
            }),
        ),
        mutant(
            "four_torques_from_the_other_end",
            "RMD-280-02",
            torques(|data| {
                let [a, b, c, d, e, f, g, h] = *data;
                *data = [g, h, e, f, c, d, a, b];
            }),
        ),
        mutant(
            "four_torques_high_byte_first",
            "RMD-280-02",
            torques(|data| {
                data.chunks_mut(2).for_each(<[u8]>::reverse);
            }),
        ),
        mutant(
            "four_torques_in_eighths",
            "RMD-280-03",
            torques(|data| {
                for first in [0, 2, 4, 6] {
                    let torque = u16_at(data, first) as i16;
                    put_u16(data, first, (torque / 8) as u16);
                }
            }),
        ),
        mutant(
            "four_torques_in_7_bytes",
            "RMD-280-01",
            Box::new(|motors, event| match event {
                Event::Frame(frame) if frame.id() == 0x280 && frame.len() == 7 => {
                    motors.pass(Event::Frame(&CanFrame::new(0x280, [0; 8])))
                }
                event => motors.pass(event),
            }),
        ),
        Mutant {
            id: 7,
            ..mutant(
                "four_torques_reach_motor_7",
                "RMD-280-04",
                Box::new(|motors, event| {
                    let mut replies = Vec::new();
                    if let Event::Frame(frame) = &event
                        && frame.id() == 0x280
                        && frame.eight_bytes().is_some()
                    {
                        let reply = motors.ask([0xA1, 0, 0, 0, 0, 0, 0, 0]);
                        replies.push(CanFrame::new(motors.first_id().can_id(), reply));
                    }
                    replies.extend(motors.pass(event));
                    replies
                }),
            )
        },
    ]
}

/// Changes the replies to 0x280.
fn reordered(change: impl Fn(&mut Vec<CanFrame>) + Send + 'static) -> Behaviour {
    Box::new(move |motors, event| {
        let four = matches!(&event, Event::Frame(frame) if frame.id() == 0x280);
        let mut replies = motors.pass(event);
        if four {
            change(&mut replies);
        }
        replies
    })
}

/// Changes the torques of 0x280.
fn torques(change: impl Fn(&mut [u8; 8]) + Send + 'static) -> Behaviour {
    Box::new(move |motors, event| {
        if let Event::Frame(frame) = &event
            && let Some((0x280, data)) = frame.eight_bytes()
        {
            let mut data = *data;
            change(&mut data);
            return motors.pass(Event::Frame(&CanFrame::new(0x280, data)));
        }
        motors.pass(event)
    })
}
