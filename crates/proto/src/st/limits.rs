//! Limits of the caller. They are checked before a frame is sent.

use core::fmt;

use super::effect::Limited;
use super::{Frame, FrameCode, MAX_PAYLOAD, Profile, RegisterId, Request};

/// The limits of all requests, typed or raw. `None` means no limit.
///
/// While `speed_rpm` is set, a motor can be started only after the drive acknowledged a speed ramp
/// for it. Without a ramp the drive goes to its own target speed. The ramp is a SET_RAMP or a write
/// of RAMP_FINAL_SPEED. These events make the ramp invalid:
/// * a later ramp that was not acknowledged;
/// * a torque command, a write of CONTROL_MODE, or a RESET;
/// * an identification of the drive, a lost line, or opening the port again.
///
/// Position commands contain no speed and are refused.
///
/// The limits apply to requested values. `speed_rpm` does not limit:
/// * a torque command: the motor turns as fast as its load allows;
/// * the rev-up and the alignment of a sensorless drive, and the motor profiler (SC_START): these
///   speeds are the drive's own. [`Request::SetRevupData`] sets the speeds of the rev-up;
/// * an overshoot of the drive's regulator, and a motor that was already running;
/// * a start after a reset of the drive that is not visible on the line, such as a power cycle
///   between the ramp and the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// Maximum speed in either direction, rpm.
    pub speed_rpm: Option<u32>,
    /// Maximum Iq or Id reference in either direction, s16A digits.
    pub current_s16a: Option<u16>,
}

/// Why a request was refused; it was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LimitError {
    /// A value exceeds its limit.
    Exceeded {
        /// The requested value.
        value: i64,
        /// The limit.
        limit: i64,
        /// Unit of both.
        unit: &'static str,
    },
    /// A write to a part of a limited register. The other part is unknown.
    Part(RegisterId),
    /// The payload is too short for the limited values. Shipped firmware uses old bytes for the
    /// missing ones (docs/SPEC-NOTES.md S18).
    Short(FrameCode),
    /// The payload has 128 bytes. Shipped firmware reads it as several frames (docs/SPEC-NOTES.md
    /// S10).
    Longest,
    /// A position command contains no speed.
    Position {
        /// The speed limit, rpm.
        limit_rpm: u32,
    },
    /// A read of a data segment that was not configured since the port was opened. Shipped firmware
    /// reads its frame as a torque ramp (docs/SPEC-NOTES.md S7, S18). Refused without limits, too.
    NotConfigured {
        /// The segment.
        segment: u8,
    },
    /// A start whose target speed is unknown.
    NoRamp {
        /// The speed limit, rpm.
        limit_rpm: u32,
    },
}

impl Limits {
    /// Checks `request`. [`Account::check`](super::Account::check) also checks the ramp before a
    /// start.
    ///
    /// # Errors
    /// Why the request is refused.
    pub fn check(&self, request: &Request<'_>) -> Result<(), LimitError> {
        match *request {
            Request::SetRamp(ramp) => self.speed(ramp.speed_rpm),
            Request::SetRevupData(_, phase) => {
                self.speed(phase.speed_rpm)?;
                self.current(phase.torque_s16a.into())
            }
            Request::SetCurrentReference(reference) => {
                self.current(reference.iq_s16a.into())?;
                self.current(reference.id_s16a.into())
            }
            Request::SetTorqueRamp(ramp) => self.current(ramp.torque_s16a),
            Request::SetPosition(_) => {
                self.speed_rpm.map_or(Ok(()), |limit_rpm| Err(LimitError::Position { limit_rpm }))
            }
            Request::SetRegister { register, value } => {
                self.size(value.len().saturating_add(1))?;
                self.write(register, value)
            }
            Request::ConfigureSegment { registers, .. } => {
                self.size(registers.len().saturating_add(1))
            }
            Request::GetProfilerInfo(steps) => self.size(steps.len()),
            _ => Ok(()),
        }
    }

    /// Checks a raw frame in every profile, like [`check`](Self::check).
    ///
    /// # Errors
    /// Why the frame is refused.
    pub fn check_frame(&self, frame: &Frame<'_>) -> Result<(), LimitError> {
        self.size(frame.payload.len())?;
        Profile::ALL.into_iter().try_for_each(|profile| match frame.request(profile) {
            Ok(request) => self.check(&request),
            Err(_) => FrameCode::from_number(frame.code(), profile)
                .map_or(Ok(()), |code| self.short(code)),
        })
    }

    fn write(&self, register: RegisterId, value: &[u8]) -> Result<(), LimitError> {
        match register.limited() {
            limited if !self.bound(limited) => Ok(()),
            Limited::Current => self.current(whole(register, value)?),
            _ => self.speed(whole(register, value)?),
        }
    }

    fn size(&self, payload: usize) -> Result<(), LimitError> {
        let is_limited = *self != Limits::default();
        if is_limited && payload >= MAX_PAYLOAD { Err(LimitError::Longest) } else { Ok(()) }
    }

    fn short(&self, code: FrameCode) -> Result<(), LimitError> {
        if self.bound(code.limited()) { Err(LimitError::Short(code)) } else { Ok(()) }
    }

    /// Whether a limit is set for it.
    fn bound(&self, limited: Limited) -> bool {
        match limited {
            Limited::Nothing => false,
            Limited::Speed => self.speed_rpm.is_some(),
            Limited::Current => self.current_s16a.is_some(),
            Limited::Both => *self != Limits::default(),
        }
    }

    fn speed(&self, rpm: i32) -> Result<(), LimitError> {
        within(rpm, self.speed_rpm, "rpm")
    }

    fn current(&self, digits: i32) -> Result<(), LimitError> {
        within(digits, self.current_s16a.map(u32::from), "s16A")
    }
}

/// The value that a drive reads from these bytes: it ignores surplus bytes.
fn whole(register: RegisterId, value: &[u8]) -> Result<i32, LimitError> {
    // Limited registers have the same type in both profiles.
    let profile = Profile::Spec;
    let size = register.shape().map_or(0, |shape| usize::from(shape.ty(profile).size()));
    value
        .get(..size)
        .and_then(|value| register.decode(profile, value))
        .ok_or(LimitError::Part(register))
}

fn within(value: i32, limit: Option<u32>, unit: &'static str) -> Result<(), LimitError> {
    match limit {
        Some(limit) if value.unsigned_abs() > limit => {
            Err(LimitError::Exceeded { value: value.into(), limit: limit.into(), unit })
        }
        _ => Ok(()),
    }
}

impl fmt::Display for LimitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LimitError::Exceeded { value, limit, unit } => write!(
                f,
                "{value} {unit} is over the limit of {limit} {unit} that was set; nothing was sent; ask \
                 for {limit} {unit} at most"
            ),
            LimitError::Part(register) => write!(
                f,
                "a part of {register} cannot be written while it is limited; nothing was sent; write the \
                 whole value"
            ),
            LimitError::Short(code) => write!(
                f,
                "the payload is too short for {}, whose values are limited; nothing was sent; send all \
                 bytes of the message",
                code.name()
            ),
            LimitError::Longest => f.write_str(
                "shipped firmware reads a payload of 128 bytes as further frames, which cannot be \
                 limited; nothing was sent; send 127 bytes at most",
            ),
            LimitError::Position { limit_rpm } => write!(
                f,
                "a position command carries no speed to hold to the limit of {limit_rpm} rpm that was \
                 set; nothing was sent; use speed ramps, or set no speed limit"
            ),
            LimitError::NotConfigured { segment } => write!(
                f,
                "data segment {segment} was not configured since the port was opened. Shipped firmware \
                 reads this request as a torque ramp, so nothing was sent; configure the segment first"
            ),
            LimitError::NoRamp { limit_rpm } => write!(
                f,
                "with a speed limit of {limit_rpm} rpm a start needs a speed ramp within the limit, sent \
                 before through the same connection and to the same motor number; nothing was sent"
            ),
        }
    }
}

impl core::error::Error for LimitError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::st::{CurrentReference, PositionMove, Ramp, RevupPhase, TorqueRamp};

    const SPEED: Limits = Limits { speed_rpm: Some(1000), current_s16a: None };
    const CURRENT: Limits = Limits { speed_rpm: None, current_s16a: Some(500) };

    fn checked(limits: Limits, code: u8, payload: &[u8]) -> Result<(), LimitError> {
        limits.check_frame(&Frame { header: Frame::header(code, 1), payload })
    }

    #[test]
    fn limits_hold_in_both_directions_and_for_registers() {
        let limits = Limits { speed_rpm: Some(1000), current_s16a: Some(500) };
        let ramp = |speed_rpm| Request::SetRamp(Ramp { speed_rpm, duration_ms: 0 });
        assert!(limits.check(&ramp(-1000)).is_ok());
        assert!(limits.check(&ramp(-1001)).is_err());
        assert!(limits.check(&ramp(i32::MIN)).is_err());
        let currents = CurrentReference { iq_s16a: 0, id_s16a: -501 };
        assert!(limits.check(&Request::SetCurrentReference(currents)).is_err());
        let write = Request::SetRegister { register: RegisterId::TORQUE_REF, value: &[0xF5, 0x01] };
        let exceeded = LimitError::Exceeded { value: 501, limit: 500, unit: "s16A" };
        assert_eq!(limits.check(&write), Err(exceeded));
        let torque = |value| Request::SetRegister { register: RegisterId::TORQUE_REF, value };
        assert_eq!(limits.check(&torque(&[0xF5, 0x01, 0x00])), Err(exceeded));
        let part = Err(LimitError::Part(RegisterId::TORQUE_REF));
        assert_eq!(limits.check(&torque(&[0xFF])), part);
        assert!(Limits::default().check(&ramp(i32::MIN)).is_ok());
    }

    #[test]
    fn each_request_with_a_speed_or_a_current_is_limited() {
        let write = |register, value| Request::SetRegister { register, value };
        let phase = |speed_rpm, torque_s16a| {
            Request::SetRevupData(0, RevupPhase { speed_rpm, torque_s16a, duration_ms: 0 })
        };
        let fast = 1001i32.to_le_bytes();
        for request in [
            Request::SetRamp(Ramp { speed_rpm: 1001, duration_ms: 0 }),
            write(RegisterId::RAMP_FINAL_SPEED, &fast),
            phase(-1001, 0),
        ] {
            assert!(SPEED.check(&request).is_err() && CURRENT.check(&request).is_ok());
        }
        let strong = (-501i16).to_le_bytes();
        for request in [
            Request::SetCurrentReference(CurrentReference { iq_s16a: 501, id_s16a: 0 }),
            Request::SetTorqueRamp(TorqueRamp { torque_s16a: -501, duration_ms: 0 }),
            write(RegisterId::TORQUE_REF, &strong),
            write(RegisterId::FLUX_REF, &strong),
            write(RegisterId::IQ_SPEEDMODE, &strong),
            phase(0, -501),
        ] {
            assert!(CURRENT.check(&request).is_err() && SPEED.check(&request).is_ok());
        }
    }

    #[test]
    fn requests_without_a_limit_are_not_refused() {
        let part = |register| Request::SetRegister { register, value: &[0xFF] };
        for register in [RegisterId::TORQUE_REF, RegisterId::RAMP_FINAL_SPEED] {
            assert_eq!(Limits::default().check(&part(register)), Ok(()));
        }
        assert_eq!(SPEED.check(&part(RegisterId::TORQUE_REF)), Ok(()));
        assert_eq!(CURRENT.check(&part(RegisterId::RAMP_FINAL_SPEED)), Ok(()));
        let torque = TorqueRamp { torque_s16a: 32_767, duration_ms: 0 };
        assert_eq!(SPEED.check(&Request::SetTorqueRamp(torque)), Ok(()));
        let turn = PositionMove { angle_rad: 1e9, duration_s: 0.0 };
        assert_eq!(CURRENT.check(&Request::SetPosition(turn)), Ok(()));
        for code in 0..0x20 {
            for payload in [&[][..], &[0xFF; 12], &[0xFF; MAX_PAYLOAD]] {
                assert_eq!(checked(Limits::default(), code, payload), Ok(()), "{code:#04x}");
            }
        }
    }

    #[test]
    fn a_position_command_has_no_speed_to_be_limited() {
        let turn = PositionMove { angle_rad: 0.1, duration_s: 10.0 };
        let refused = Err(LimitError::Position { limit_rpm: 1000 });
        assert_eq!(SPEED.check(&Request::SetPosition(turn)), refused);
        assert_eq!(checked(SPEED, 0x12, &[0; 8]), refused);
    }

    #[test]
    fn a_raw_frame_is_checked_in_every_profile() {
        // A data segment in one profile, a torque ramp to 501 in the other.
        let ramp = [0xF5, 0x01, 0, 0, 0, 0];
        let exceeded = LimitError::Exceeded { value: 501, limit: 500, unit: "s16A" };
        assert_eq!(checked(CURRENT, 0x0D, &ramp), Err(exceeded));
        assert_eq!(checked(SPEED, 0x0D, &ramp), Ok(()));
    }

    #[test]
    fn a_frame_of_any_length_is_checked_or_refused() {
        let exceeded = LimitError::Exceeded { value: 1001, limit: 1000, unit: "rpm" };
        for size in 0..=MAX_PAYLOAD {
            let mut payload = [0; MAX_PAYLOAD];
            payload[..2].copy_from_slice(&[0xE9, 0x03]);
            let ramp = checked(SPEED, 0x07, &payload[..size]);
            match size {
                0..6 => assert_eq!(ramp, Err(LimitError::Short(FrameCode::SetRamp))),
                6..128 => assert_eq!(ramp, Err(exceeded), "{size} bytes"),
                _ => assert_eq!(ramp, Err(LimitError::Longest)),
            }
            // The bytes after the length do not matter while they are one frame.
            let read = checked(SPEED, 0x02, &payload[..size]);
            assert_eq!(read.is_ok(), size < MAX_PAYLOAD, "{size} bytes");
        }
        let ids = [0; MAX_PAYLOAD - 1];
        let longest = Err(LimitError::Longest);
        let write = Request::SetRegister { register: RegisterId::SPEED_KP, value: &ids };
        assert_eq!(CURRENT.check(&write), longest);
        assert_eq!(
            CURRENT.check(&Request::ConfigureSegment { segment: 0, registers: &ids }),
            longest
        );
        assert_eq!(CURRENT.check(&Request::GetProfilerInfo(&[0; MAX_PAYLOAD])), longest);
        assert_eq!(CURRENT.check(&Request::GetProfilerInfo(&ids)), Ok(()));
    }

    #[test]
    fn a_frame_that_firmware_would_complete_from_old_bytes_is_refused() {
        let short = |code: FrameCode| Err(LimitError::Short(code));
        let both = [SPEED, CURRENT];
        for (code, number, limited) in [
            (FrameCode::SetReg, 0x01, both),
            (FrameCode::ExecuteCmd, 0x03, [SPEED; 2]),
            (FrameCode::SetRamp, 0x07, [SPEED; 2]),
            (FrameCode::SetRevupData, 0x09, both),
            (FrameCode::SetCurrentRef, 0x0A, [CURRENT; 2]),
            (FrameCode::SetTorqueRamp, 0x0D, [CURRENT; 2]),
            (FrameCode::SetPositionCmd, 0x12, [SPEED; 2]),
        ] {
            for limits in both {
                let expected = if limited.contains(&limits) { short(code) } else { Ok(()) };
                assert_eq!(checked(limits, number, &[]), expected, "{}", code.name());
            }
        }
        for reads in [0x02, 0x06, 0x08, 0x0B, 0x0C, 0x0E] {
            assert_eq!(checked(SPEED, reads, &[]), Ok(()), "{reads:#04x}");
        }
    }
}
