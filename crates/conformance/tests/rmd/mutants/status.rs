//! Temperature, voltage, errors, currents.

use motorlink_proto::rmd::*;

use super::{Mutant, are_caught, code, commands, mutant, on, put_u16, replies, swap, u16_at};
use crate::drive::Behaviour;

#[test]
fn mutants_of_status_and_errors_are_caught() {
    are_caught(mutants());
}

fn mutants() -> Vec<Mutant> {
    use Code::{ClearErrors, ReadMotionStatus, ReadPhaseCurrents, ReadStatus};
    vec![
        mutant("temperature_in_data_2", "RMD-9A-03", on(ReadStatus, |data| swap(data, 1))),
        mutant("temperature_in_fahrenheit", "RMD-9C-03", on(ReadMotionStatus, |data| data[1] = 77)),
        mutant("voltage_in_millivolts", "RMD-9A-04", on(ReadStatus, in_millivolts)),
        mutant("voltage_high_byte_first", "RMD-9A-04", on(ReadStatus, |data| swap(data, 3))),
        mutant("voltage_in_volts_after_clear", "RMD-9B-05", {
            on(ClearErrors, |data| put_u16(data, 3, u16_at(data, 3) / 10))
        }),
        mutant("a_null_byte_of_status_1_is_not_0", "RMD-9A-06", on(ReadStatus, |d| d[5] = 1)),
        mutant("a_null_byte_after_clear_is_not_0", "RMD-9B-07", on(ClearErrors, |d| d[6] = 1)),
        mutant("errors_in_data_6", "RMD-9A-05", on(ReadStatus, |data| swap(data, 6))),
        mutant("errors_in_other_bits", "RMD-9A-07", on(ReadStatus, |data| data[7] <<= 1)),
        mutant("the_reply_to_clear_has_a_code_of_its_own", "RMD-9B-03", {
            on(ClearErrors, |data| data[0] = 0x9C)
        }),
        mutant("errors_go_while_their_cause_lasts", "RMD-9B-11", forgetful()),
        mutant("clear_says_nothing_of_a_lasting_error", "RMD-9B-06", {
            on(ClearErrors, |data| data[7] = 0)
        }),
        mutant("errors_cannot_be_cleared", "RMD-9B-02", stubborn()),
        mutant("motion_commands_overcome_errors", "RMD-9A-10", overcoming()),
        mutant("torque_current_in_milliamperes", "RMD-9C-04", {
            on(ReadMotionStatus, |data| put_u16(data, 2, u16_at(data, 2).wrapping_mul(16)))
        }),
        mutant("speed_in_rpm", "RMD-9C-05", {
            on(ReadMotionStatus, |data| put_u16(data, 4, (u16_at(data, 4) as i16 / 6) as u16))
        }),
        mutant("phase_currents_in_milliamperes", "RMD-9D-05", {
            on(ReadPhaseCurrents, |data| {
                for first in [2, 4, 6] {
                    put_u16(data, first, u16_at(data, first).wrapping_mul(16));
                }
            })
        }),
        mutant(
            "two_phase_currents",
            "RMD-9D-04",
            on(ReadPhaseCurrents, |data| put_u16(data, 6, 0)),
        ),
        mutant("phase_currents_high_byte_first", "RMD-9D-04", {
            on(ReadPhaseCurrents, |data| [2, 4, 6].into_iter().for_each(|first| swap(data, first)))
        }),
        mutant(
            "a_null_byte_of_status_3_is_not_0",
            "RMD-9D-03",
            on(ReadPhaseCurrents, |d| d[1] = 25),
        ),
    ]
}

fn in_millivolts(data: &mut [u8; 8]) {
    put_u16(data, 3, u16_at(data, 3) * 100);
}

/// Clears errors whose cause is present.
fn forgetful() -> Behaviour {
    let forgotten = std::cell::Cell::new(false);
    replies(move |request, reply| match code(request) {
        Code::ClearErrors => {
            forgotten.set(reply[7] != 0);
            reply[7] = 0;
        }
        Code::ReadStatus if forgotten.get() => reply[7] = 0,
        _ => {}
    })
}

/// Never clears errors.
fn stubborn() -> Behaviour {
    commands(|motors, data| {
        (code(data) == Code::ClearErrors).then(|| {
            let mut asked = *data;
            asked[0] = 0x9A;
            Some(motors.ask(asked))
        })
    })
}

/// Turns while a protection is active.
fn overcoming() -> Behaviour {
    commands(|motors, data| {
        if code(data) == Code::SetSpeed {
            motors.first_mut().motor_mut().release_faults(Errors::LOW_VOLTAGE);
            motors.ask(Command::encode(&ClearErrors));
        }
        None
    })
}
