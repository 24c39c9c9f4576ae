//! The payloads of ST's messages, for generators. `motorlink-proto` has them as code; the tests of
//! this module compare both.

use motorlink_proto::st::FrameCode;
use motorlink_proto::st::register::{Type, Unit};

/// A number in a payload. Numbers follow one another without gaps, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Value {
    /// The name, with the unit.
    pub name: &'static str,
    /// The name without the unit.
    pub label: &'static str,
    /// The type on the wire.
    pub ty: Type,
    /// The unit of a digit.
    pub unit: Unit,
}

/// What a payload has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// These numbers, and nothing else.
    Values(&'static [Value]),
    /// The id of a register.
    Register,
    /// The id of a register, and a value of its size.
    RegisterAndValue,
    /// A value of the size of the register that was asked for.
    RegisterValue,
    /// A command of EXECUTE_CMD.
    Command,
    /// These numbers, and ids of registers up to the end.
    Registers(&'static [Value]),
    /// The values of the registers of a data segment, without gaps.
    Segment,
    /// [`BoardInfo`](motorlink_proto::st::BoardInfo).
    BoardInfo,
    /// [`FirmwareVersion`](motorlink_proto::st::FirmwareVersion).
    FirmwareVersion,
    /// Bytes that no document describes.
    Bytes,
}

impl Content {
    /// The numbers at the beginning of the payload, each with its first byte.
    pub fn values(self) -> impl Iterator<Item = (usize, &'static Value)> {
        let values = match self {
            Content::Values(values) | Content::Registers(values) => values,
            _ => &[],
        };
        let mut next = 0;
        values.iter().map(move |value| {
            let first = next;
            next += usize::from(value.ty.size());
            (first, value)
        })
    }
}

const fn value(name: &'static str, label: &'static str, ty: Type, unit: Unit) -> Value {
    Value { name, label, ty, unit }
}

const SPEED: Value = value("speed_rpm", "speed", Type::I32, Unit::Rpm);
const DURATION: Value = value("duration_ms", "duration", Type::U16, Unit::Millisecond);
const PHASE: Value = value("phase", "phase", Type::U8, Unit::None);
const PHASE_TORQUE: Value = value("torque_s16a", "torque", Type::I16, Unit::S16A);
const SEGMENT: Value = value("segment", "segment", Type::U8, Unit::None);

const IQ: Value = value("iq_s16a", "Iq", Type::I16, Unit::S16A);
const ID: Value = value("id_s16a", "Id", Type::I16, Unit::S16A);
const TORQUE: Value = value("torque_s16a", "torque", Type::I32, Unit::S16A);
const ANGLE: Value = value("angle_rad", "angle", Type::F32, Unit::Radian);
const MOVE_DURATION: Value = value("duration_s", "duration", Type::F32, Unit::Second);

/// The payloads of the command with this code and of its acknowledge.
pub fn contents(code: FrameCode) -> (Content, Content) {
    use Content::Values;
    match code {
        FrameCode::SetReg => (Content::RegisterAndValue, Values(&[])),
        FrameCode::GetReg => (Content::Register, Content::RegisterValue),
        FrameCode::ExecuteCmd => (Content::Command, Values(&[])),
        FrameCode::GetBoardInfo => (Values(&[]), Content::BoardInfo),
        FrameCode::SetRamp => (Values(&[SPEED, DURATION]), Values(&[])),
        FrameCode::GetRevupData => (Values(&[PHASE]), Values(&[SPEED, PHASE_TORQUE, DURATION])),
        FrameCode::SetRevupData => (Values(&[PHASE, SPEED, PHASE_TORQUE, DURATION]), Values(&[])),
        FrameCode::SetCurrentRef => (Values(&[IQ, ID]), Values(&[])),
        FrameCode::GetMpInfo => (Content::Bytes, Content::Bytes),
        FrameCode::GetFwVersion => (Values(&[]), Content::FirmwareVersion),
        FrameCode::GetDataElement => (Values(&[SEGMENT]), Content::Segment),
        FrameCode::SetTorqueRamp => (Values(&[TORQUE, DURATION]), Values(&[])),
        FrameCode::ConfigDynStruct => (Content::Registers(&[SEGMENT]), Values(&[])),
        FrameCode::SetPositionCmd => (Values(&[ANGLE, MOVE_DURATION]), Values(&[])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::st::{
        CurrentReference, PositionMove, Profile, Ramp, ReplySize, Request, RevupPhase, TorqueRamp,
    };

    /// The bytes of `contents(code).0` with these numbers.
    fn bytes(code: FrameCode, numbers: &[f64]) -> Vec<u8> {
        let (Content::Values(values) | Content::Registers(values)) = contents(code).0 else {
            panic!("{code:?} has no numbers");
        };
        assert_eq!(values.len(), numbers.len());
        let mut bytes = Vec::new();
        for (value, &number) in values.iter().zip(numbers) {
            let size = usize::from(value.ty.size());
            match value.ty {
                Type::F32 => bytes.extend((number as f32).to_le_bytes()),
                _ => bytes.extend(&(number as i64).to_le_bytes()[..size]),
            }
        }
        bytes
    }

    #[test]
    fn requests_have_their_numbers_where_the_table_says() {
        let phase = RevupPhase { speed_rpm: -70_000, torque_s16a: -2, duration_ms: 65_535 };
        let currents = CurrentReference { iq_s16a: -1, id_s16a: 2 };
        let cases: &[(Request<'_>, &[f64])] = &[
            (
                Request::SetRamp(Ramp { speed_rpm: -70_000, duration_ms: 65_535 }),
                &[-70_000.0, 65_535.0],
            ),
            (Request::GetRevupData(4), &[4.0]),
            (Request::SetRevupData(3, phase), &[3.0, -70_000.0, -2.0, 65_535.0]),
            (Request::SetCurrentReference(currents), &[-1.0, 2.0]),
            (Request::GetSegment(3), &[3.0]),
            (Request::ConfigureSegment { segment: 2, registers: &[] }, &[2.0]),
            (
                Request::SetTorqueRamp(TorqueRamp { torque_s16a: -70_000, duration_ms: 1 }),
                &[-70_000.0, 1.0],
            ),
            (
                Request::SetPosition(PositionMove { angle_rad: -1.5, duration_s: 0.25 }),
                &[-1.5, 0.25],
            ),
            (Request::GetBoardInfo, &[]),
            (Request::GetFirmwareVersion, &[]),
        ];
        for (request, numbers) in cases {
            let mut room = [0; 32];
            let expected = request.payload(&mut room).unwrap();
            assert_eq!(bytes(request.code(), numbers), expected, "{request:?}");
        }
    }

    #[test]
    fn replies_have_the_size_that_a_master_expects() {
        let size = |values: &[Value]| values.iter().map(|value| value.ty.size()).sum();
        for profile in Profile::ALL {
            for &code in FrameCode::ALL {
                let Ok(request) = Request::decode(profile, code.number(), &[0; 16]) else {
                    continue;
                };
                let expected = match contents(request.code()).1 {
                    Content::Values(values) => ReplySize::Exactly(size(values)),
                    Content::RegisterValue => continue,
                    _ => ReplySize::Any,
                };
                assert_eq!(request.reply_size(profile), expected, "{request:?}");
            }
        }
    }
}
