//! Encoder, offset, zero and angles (0x90, 0x91, 0x19, 0x92, 0x94).

use motorlink_proto::rmd::*;
use motorlink_proto::units::{CentiDegrees, SpeedLimit};

use super::case::case;
use super::frames::{filled, null_bytes_are_0, request};
use super::harness::Harness;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{R4, R8, R9, R19, R20, R26, R31};

/// Maximum difference between two readings of a rotor at rest, degrees.
const JITTER: f64 = 0.5;

pub(super) fn cases() -> Vec<Case<Harness>> {
    let mut cases = readings();
    cases.extend(offset());
    cases.extend(zero());
    cases.push(
        case("the_multi_turn_angle_falls_below_0", &["RMD-92-03", "RMD-92-04"], |harness| {
            below_0(harness)
        })
        .needs(&[Need::Spin]),
    );
    cases
}

fn readings() -> Vec<Case<Harness>> {
    vec![
        case(
            "the_position_is_the_original_position_minus_the_offset",
            &["RMD-90-05", "RMD-90-04", "RMD-90-06", "RMD-90-07"],
            |harness| {
                let encoder = harness.read(ReadEncoder)?;
                let Encoder { position, raw, offset } = encoder;
                let due = (i32::from(raw) - i32::from(offset)).rem_euclid(harness.turn());
                let words = format!("position {due}, that is {raw} - {offset}");
                harness.require(i32::from(position) == due, words)
            },
        ),
        case(
            "encoder_values_are_within_the_encoders_width",
            &["RMD-90-08", "RMD-280-08", "RMD-9C-06"],
            |harness| {
                let Encoder { position, raw, offset } = harness.read(ReadEncoder)?;
                within_turn(harness, &[position, raw, offset])?;
                let encoder = harness.read(ReadMotionStatus)?.encoder;
                within_turn(harness, &[encoder])
            },
        ),
        case("status_2_has_the_encoder_position", &["RMD-9C-06", "RMD-90-04"], |harness| {
            let position = harness.read_position()?;
            let read = harness.degrees(position);
            let encoder = harness.read(ReadMotionStatus)?.encoder;
            near(harness, harness.degrees(encoder), read, "the position that 0x90 reads")
        }),
        case("the_single_turn_angle_is_0_to_35999", &["RMD-94-04", "RMD-94-06"], |harness| {
            let angle = harness.read(ReadSingleTurnAngle)?.angle;
            harness.require(angle.0 < FULL_TURN, "an angle of 0 to 35999")
        }),
        case(
            "the_single_turn_angle_is_that_of_the_encoder",
            &["RMD-94-05", "RMD-94-04"],
            |harness| {
                let position = harness.read_position()?;
                let position = harness.degrees(position);
                let angle = harness.read(ReadSingleTurnAngle)?.angle.degrees();
                near(harness, angle, position, "the angle of the encoder position in 0x90")
            },
        )
        .reading(R31),
        case(
            "the_multi_turn_angle_within_the_turn_is_the_single_turn_angle",
            &["RMD-94-06", "RMD-92-05", "RMD-92-03"],
            |harness| {
                let circle = harness.read(ReadSingleTurnAngle)?.angle.degrees();
                let multi = harness.read(ReadMultiTurnAngle)?.angle.degrees();
                near(harness, multi, circle, "modulo 360° the angle that 0x94 reads")
            },
        )
        .reading(R20),
    ]
}

fn offset() -> Vec<Case<Harness>> {
    vec![
        case(
            "a_written_offset_applies_at_once",
            &["RMD-91-02", "RMD-91-01", "RMD-91-04", "RMD-91-05", "RMD-91-06", "RMD-2-07"],
            |harness| {
                let offset = harness.another_offset()?;
                let data = harness.ask_once(WriteEncoderOffsetRom(offset).encode())?;
                null_bytes_are_0(harness, Code::WriteEncoderOffsetRom, &data)?;
                let reply = EncoderOffset::decode(&data);
                harness.require(reply == offset, format!("the new offset {}", offset.offset))?;
                offset_is(harness, offset).read_as(R8)
            },
        )
        .needs(&[Need::Rom]),
        case("null_bytes_of_an_offset_are_ignored", &["RMD-91-05", "RMD-91-01"], |harness| {
            let offset = harness.another_offset()?;
            let code = Code::WriteEncoderOffsetRom;
            let sent = filled(WriteEncoderOffsetRom(offset).encode(), code, 0xA5);
            let reply = harness.ask(sent)?;
            null_bytes_are_0(harness, code, &reply)?;
            offset_is(harness, offset)
        })
        .needs(&[Need::Rom])
        .reading(R4),
        case("an_offset_beyond_the_encoder_is_cut", &["RMD-91-03"], |harness| {
            if harness.turn() > i32::from(u16::MAX) {
                return Err(Stop::Skipped("an encoder of 16 bits accepts every value".into()));
            }
            harness.keep_offset()?;
            let EncoderOffset { offset } =
                harness.read(WriteEncoderOffsetRom(EncoderOffset { offset: u16::MAX }))?;
            within_turn(harness, &[offset])?;
            offset_is(harness, EncoderOffset { offset })
        })
        .needs(&[Need::Rom])
        .reading(R19),
        case("a_written_offset_is_kept_over_a_power_cycle", &["RMD-91-07"], |harness| {
            let offset = harness.another_offset()?;
            harness.read(WriteEncoderOffsetRom(offset))?;
            harness.power_cycle()?;
            offset_is(harness, offset)
        })
        .needs(&[Need::Rom, Need::PowerCycle])
        .reading(R8),
        case("a_held_position_does_not_move_with_the_offset", &["RMD-91-02"], |harness| {
            harness.gently()?;
            let angle = CentiDegrees(harness.angle_in_reach()?);
            harness.command(SetPositionLimited { max_speed: SpeedLimit(30), angle })?;
            let before = harness.keep_offset()?.raw;
            let offset = harness.another_offset()?;
            harness.read(WriteEncoderOffsetRom(offset))?;
            harness.watch(500, |_| false)?;
            let after = harness.read(ReadEncoder)?.raw;
            let (after, before) = (harness.degrees(after), harness.degrees(before));
            near(harness, after, before, "the original position as it was")
        })
        .needs(&[Need::Spin, Need::Rom])
        .reading(R26),
    ]
}

fn zero() -> Vec<Case<Harness>> {
    vec![
        case(
            "a_new_zero_is_the_present_position",
            &["RMD-19-05", "RMD-19-03", "RMD-19-06", "RMD-19-07", "RMD-19-01", "RMD-2-08"],
            |harness| {
                // At the zero position the old offset would also fit.
                let elsewhere = harness.another_offset()?;
                harness.read(WriteEncoderOffsetRom(elsewhere))?;
                let raw = harness.keep_offset()?.raw;
                let code = Code::WriteZeroRom;
                let stale = harness.ask_once(filled(request(code), code, 0xA5)).map(drop);
                harness.note(R4, stale)?;
                let reply = harness.ask_once(request(code))?;
                null_bytes_are_0(harness, code, &reply)?;
                let offset = EncoderOffset::decode(&reply).offset;
                let (offset, raw) = (harness.degrees(offset), harness.degrees(raw));
                near(harness, offset, raw, "the original position that 0x90 read")
            },
        )
        .needs(&[Need::Rom]),
        case("a_new_zero_does_not_act_before_power_on", &["RMD-19-02"], |harness| {
            let offset = harness.another_offset()?;
            harness.read(WriteEncoderOffsetRom(offset))?;
            let before = harness.read(ReadEncoder)?;
            harness.read(WriteZeroRom)?;
            let after = harness.read(ReadEncoder)?;
            let shown = harness.require(after.offset == before.offset, "the offset as before");
            harness.note(R9, shown)?;
            let (after, before) =
                (harness.degrees(after.position), harness.degrees(before.position));
            near(harness, after, before, "the position as before")
        })
        .needs(&[Need::Rom]),
        case("a_new_zero_acts_from_power_on", &["RMD-19-02", "RMD-19-03"], |harness| {
            let offset = harness.another_offset()?;
            harness.read(WriteEncoderOffsetRom(offset))?;
            let zero = harness.read(WriteZeroRom)?;
            harness.power_cycle()?;
            offset_is(harness, zero)
        })
        .needs(&[Need::Rom, Need::PowerCycle]),
    ]
}

/// Moves to an angle just below zero, which is negative.
fn below_0(harness: &mut Harness) -> Result<(), Stop> {
    const NEAR: i64 = 36_000;
    const TARGET: i32 = -1_000;
    let angle = harness.angle()?;
    if angle.abs() > NEAR {
        return Err(Stop::Skipped(format!(
            "the motor is at {}°: cycle its power to reset the number of turns",
            angle / 100
        )));
    }
    harness.gently()?;
    harness
        .command(SetPositionLimited { max_speed: SpeedLimit(180), angle: CentiDegrees(TARGET) })?;
    let arrived = harness.watch(8_000, |seen| seen.angle < -500)?;
    harness.require(arrived, "an angle that falls to -10°")
}

impl Harness {
    /// Number of values in a turn of the encoder, as in a frame.
    pub(super) fn turn(&self) -> i32 {
        1 << self.options.encoder.bits().min(16)
    }

    pub(super) fn degrees(&self, counts: u16) -> f64 {
        self.options.encoder.degrees(counts)
    }

    fn read_position(&mut self) -> Result<u16, Stop> {
        Ok(self.read(ReadEncoder)?.position)
    }

    /// An offset other than the present one and the present position. Records the present offset.
    fn another_offset(&mut self) -> Result<EncoderOffset, Stop> {
        let turn = self.turn();
        let Encoder { raw, offset, .. } = self.keep_offset()?;
        let other = |share: i32| (i32::from(offset) + turn / share) % turn;
        let apart = (other(8) - i32::from(raw)).rem_euclid(turn);
        let far = (turn / 32..turn - turn / 32).contains(&apart);
        Ok(EncoderOffset { offset: if far { other(8) } else { other(4) } as u16 })
    }
}

fn offset_is(harness: &mut Harness, EncoderOffset { offset }: EncoderOffset) -> Result<(), Stop> {
    let read = harness.read(ReadEncoder)?;
    harness.require(read.offset == offset, format!("the offset {offset}"))?;
    let due = (i32::from(read.raw) - i32::from(offset)).rem_euclid(harness.turn());
    harness.require(i32::from(read.position) == due, format!("the position {due}"))
}

fn within_turn(harness: &Harness, values: &[u16]) -> Result<(), Stop> {
    let turn = harness.turn();
    let within = values.iter().all(|value| i32::from(*value) < turn);
    let bits = harness.options.encoder.bits();
    harness.require(within, format!("values of 0 to {} with {bits} bits (--encoder)", turn - 1))
}

/// Two angles, in degrees, that are the same within the turn.
fn near(harness: &Harness, one: f64, other: f64, expected: &str) -> Result<(), Stop> {
    let apart = (one - other + 180.0).rem_euclid(360.0) - 180.0;
    let words = format!("{expected}, {other:.2}° within {JITTER}°; not {one:.2}°");
    harness.require(apart.abs() <= JITTER, words)
}
