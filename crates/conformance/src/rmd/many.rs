//! Torque for motors 1 to 4 in one frame (0x280).

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::units::IqCommand;

use super::case::case;
use super::harness::Harness;
use super::torque::{pulses, torque, torque_is_an_ampere};
use crate::case::{Case, Need, Stop};
use crate::reading::R11;

pub(super) fn cases() -> Vec<Case<Harness>> {
    vec![
        case(
            "four_torques_are_answered_once_by_each_motor",
            &["RMD-280-05", "RMD-280-01", "RMD-280-04"],
            |harness| {
                let (motors, replies) = ask_all(harness)?;
                let mut ids: Vec<u32> = replies.iter().map(CanFrame::id).collect();
                ids.sort_unstable();
                let usable = replies.iter().all(|reply| reply.eight_bytes().is_some());
                let due: Vec<u32> = motors.map(|motor| motor.can_id().into()).collect();
                harness.require(usable && ids == due, format!("a reply on each of {due:#05x?}"))
            },
        ),
        case("four_torques_are_answered_lowest_id_first", &["RMD-280-06"], |harness| {
            let (motors, replies) = ask_all(harness)?;
            if motors.len() < 2 {
                return Err(Stop::Skipped("needs two of the motors 1 to 4".to_owned()));
            }
            harness.require(replies.is_sorted_by_key(CanFrame::id), "the smallest ID first")
        }),
        case("four_torques_are_answered_as_a_torque_command", &["RMD-280-07"], |harness| {
            let (_, replies) = ask_all(harness)?;
            for reply in &replies {
                let data = harness.in_form(reply)?;
                harness.require(data[0] == 0xA1, "replies with DATA[0] = A1")?;
                // Only the width of this motor's encoder is known.
                if harness.is_own(reply) {
                    harness.plausible(&MotionStatus::decode(&data))?;
                }
            }
            Ok(())
        }),
        case(
            "each_motor_takes_its_own_of_four_torques",
            &["RMD-280-02", "RMD-280-03"],
            |harness| {
                reach(harness)?;
                let slot = harness.id().index();
                let request = move |_: &Harness, digits| {
                    let mut torques = [IqCommand(0); 4];
                    torques[slot] = IqCommand(digits);
                    frame(torques)
                };
                let amps = pulses(harness, request, torque)?;
                torque_is_an_ampere(harness, amps)
            },
        ),
        case("four_torques_in_another_form_are_ignored", &["RMD-280-01", "RMD-1-06"], |harness| {
            harness.may_move();
            let id = TORQUE4_ID.into();
            let answers = harness.answers(&[
                CanFrame::data_frame(id, false, &[0; 7]),
                CanFrame::data_frame(id, true, &[0; 8]),
                CanFrame::remote_frame(id, false, 8),
            ])?;
            harness.require(answers.is_empty(), "silence")
        })
        .reading(R11),
        case("a_motor_beyond_4_ignores_four_torques", &["RMD-280-04"], |harness| {
            if MotorSet::TORQUE4.contains(harness.id()) {
                return Err(Stop::Skipped("needs a motor with an ID beyond 4".to_owned()));
            }
            harness.may_move();
            let answers = harness.answers(&[frame([IqCommand(0); 4])])?;
            harness.require(answers.is_empty(), "silence")
        }),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

fn frame(torques: [IqCommand; 4]) -> CanFrame {
    CanFrame::new(TORQUE4_ID, SetTorque4(torques).encode())
}

/// Checks that the frame reaches the motor under test.
fn reach(harness: &Harness) -> Result<(), Stop> {
    if MotorSet::TORQUE4.contains(harness.id()) {
        return Ok(());
    }
    Err(Stop::Skipped("needs one of the motors 1 to 4".to_owned()))
}

/// The motors that the frame reaches, and their replies to four torques of 0. Each motor must be at
/// rest, and is switched off afterwards.
fn ask_all(harness: &mut Harness) -> Result<(MotorSet, Vec<CanFrame>), Stop> {
    reach(harness)?;
    let status = ReadMotionStatus.encode();
    let question = |motor: MotorId| CanFrame::new(motor.can_id(), status);
    let there = harness.replies(&MotorSet::TORQUE4.map(question).collect::<Vec<_>>())?;
    let mut motors = MotorSet::EMPTY;
    for (frame, motor) in there.iter().filter_map(|frame| Some((frame, motor(frame)?))) {
        let turns = frame.eight_bytes().is_none_or(|(_, data)| {
            let MotionStatus { speed, iq, .. } = MotionStatus::decode(data);
            speed.0.abs() > 5 || iq.0.abs() > 31
        });
        if turns && motor != harness.id() {
            return Err(Stop::Skipped(format!("motor {motor} on this bus is not at rest")));
        }
        motors.insert(motor);
    }
    harness.may_move();
    harness.may_move_too(motors);
    let mut replies = harness.replies(&[frame([IqCommand(0); 4])])?;
    replies.retain(|frame| motor(frame).is_some());
    Ok((motors, replies))
}

fn motor(frame: &CanFrame) -> Option<MotorId> {
    MotorId::from_can_id(frame.id()).filter(|_| !frame.is_extended())
}
