//! Gains and acceleration (0x30 to 0x34).

use motorlink_proto::rmd::*;
use motorlink_proto::units::DpsPerSecond;

use super::case::case;
use super::harness::Harness;
use crate::case::{Case, Need, Stop};
use crate::reading::{R24, R37};

pub(super) fn cases() -> Vec<Case<Harness>> {
    vec![
        case(
            "gains_in_ram_are_read_as_they_were_written",
            &["RMD-31-02", "RMD-31-01", "RMD-30-04", "RMD-30-05", "RMD-30-06", "RMD-30-07"],
            |harness| {
                let gains = others(harness.keep_gains()?);
                write(harness, gains)?;
                gains_are(harness, gains)
            },
        ),
        case("gains_in_ram_are_lost_at_power_off", &["RMD-31-03"], |harness| {
            harness.power_cycle()?;
            let rom = harness.keep_gains()?;
            write(harness, others(rom))?;
            harness.power_cycle()?;
            gains_are(harness, rom)
        })
        .needs(&[Need::PowerCycle]),
        case("gains_in_rom_are_kept_over_a_power_cycle", &["RMD-32-02", "RMD-32-01"], |harness| {
            let gains = others(harness.keep_rom_gains()?);
            harness.ask(WritePidRom(gains).encode())?;
            harness.power_cycle()?;
            gains_are(harness, gains)
        })
        .needs(&[Need::Rom, Need::PowerCycle]),
        case(
            "the_acceleration_is_read_as_it_was_written",
            &["RMD-34-02", "RMD-34-01", "RMD-33-04"],
            |harness| accelerations_are_kept(harness, &[0x012C, 0x07D0]),
        ),
        case(
            "any_acceleration_is_read_as_it_was_written",
            &["RMD-34-02", "RMD-34-01", "RMD-33-04"],
            |harness| accelerations_are_kept(harness, &[1, 0x0102_0304]),
        )
        .reading(R37),
        case("no_acceleration_limit_can_be_written", &["RMD-34-02"], |harness| {
            accelerations_are_kept(harness, &[0, -1])
        })
        .reading(R24),
        case("the_acceleration_is_lost_at_power_off", &["RMD-34-04"], |harness| {
            harness.power_cycle()?;
            let rom = harness.keep_acceleration()?;
            accelerate(harness, rom.0 ^ 0x40)?;
            harness.power_cycle()?;
            acceleration_is(harness, rom.0)
        })
        .needs(&[Need::PowerCycle]),
    ]
}

/// Six different gains. Each differs from the present one.
fn others(gains: Pid) -> Pid {
    Pid {
        position_kp: gains.position_kp ^ 1,
        position_ki: gains.position_ki ^ 2,
        speed_kp: gains.speed_kp ^ 4,
        speed_ki: gains.speed_ki ^ 8,
        torque_kp: gains.torque_kp ^ 16,
        torque_ki: gains.torque_ki ^ 32,
    }
}

pub(super) fn write(harness: &mut Harness, gains: Pid) -> Result<(), Stop> {
    harness.keep_gains()?;
    harness.ask(WritePidRam(gains).encode()).map(|_| ())
}

fn gains_are(harness: &mut Harness, gains: Pid) -> Result<(), Stop> {
    let data = harness.ask(ReadPid.encode())?;
    let bytes = gains.encode_as(Code::ReadPid);
    harness.require(data[2..] == bytes[2..], format!("gains {:02X?} in DATA[2] on", &bytes[2..]))
}

pub(super) fn accelerate(harness: &mut Harness, digits: i32) -> Result<(), Stop> {
    harness.keep_acceleration()?;
    let acceleration = DpsPerSecond(digits);
    harness.ask(WriteAccelerationRam(Acceleration { acceleration }).encode()).map(|_| ())
}

fn accelerations_are_kept(harness: &mut Harness, values: &[i32]) -> Result<(), Stop> {
    for &digits in values {
        accelerate(harness, digits)?;
        acceleration_is(harness, digits)?;
    }
    Ok(())
}

fn acceleration_is(harness: &mut Harness, digits: i32) -> Result<(), Stop> {
    let data = harness.ask(ReadAcceleration.encode())?;
    let bytes = digits.to_le_bytes();
    harness.require(data[4..] == bytes, format!("{digits} °/s², {bytes:02X?} in DATA[4] on"))
}
