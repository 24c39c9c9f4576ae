//! Limits that the caller sets; they are checked before a frame leaves.

use motorlink_proto::stmcp::{RegisterId, Request};

/// What no request may exceed, whatever call or raw frame it comes from. `None` is unlimited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// Highest speed in either direction, rpm.
    pub speed_rpm: Option<u32>,
    /// Highest Iq or Id reference in either direction, s16A digits.
    pub current_s16a: Option<u16>,
}

/// A request that does not keep the limits; it was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// It exceeds a limit.
    #[error("{value} {unit} is over the limit of {limit} {unit} that was set; nothing was sent")]
    Exceeded {
        /// What was asked for.
        value: i64,
        /// What the caller allows.
        limit: i64,
        /// Unit of both.
        unit: &'static str,
    },
    /// It writes a part of a limited register, the rest of which is not known.
    #[error("a part of {0} cannot be written while it is limited; nothing was sent")]
    Part(RegisterId),
}

impl Limits {
    /// Whether `request` keeps the limits.
    pub fn check(&self, request: &Request<'_>) -> Result<(), LimitError> {
        match *request {
            Request::Ramp(ramp) => self.speed(ramp.speed_rpm),
            Request::SetRevupData(_, phase) => {
                self.speed(phase.speed_rpm)?;
                self.current(phase.torque_s16a.into())
            }
            Request::CurrentReference(reference) => {
                self.current(reference.iq_s16a.into())?;
                self.current(reference.id_s16a.into())
            }
            Request::TorqueRamp(ramp) => self.current(ramp.torque_s16a),
            Request::SetRegister { register, value } => match register {
                RegisterId::RAMP_FINAL_SPEED => self.speed(whole(register, value)?),
                RegisterId::TORQUE_REF | RegisterId::FLUX_REF | RegisterId::IQ_SPEEDMODE => {
                    self.current(whole(register, value)?)
                }
                _ => Ok(()),
            },
            _ => Ok(()),
        }
    }

    fn speed(&self, rpm: i32) -> Result<(), LimitError> {
        within(rpm, self.speed_rpm, "rpm")
    }

    fn current(&self, digits: i32) -> Result<(), LimitError> {
        within(digits, self.current_s16a.map(u32::from), "s16A")
    }
}

/// The value that a drive takes from these bytes: it cuts what is too long.
fn whole(register: RegisterId, value: &[u8]) -> Result<i32, LimitError> {
    let size = register.shape().map_or(0, |shape| usize::from(shape.ty.size()));
    value.get(..size).and_then(|value| register.decode(value)).ok_or(LimitError::Part(register))
}

fn within(value: i32, limit: Option<u32>, unit: &'static str) -> Result<(), LimitError> {
    match limit {
        Some(limit) if value.unsigned_abs() > limit => {
            Err(LimitError::Exceeded { value: value.into(), limit: limit.into(), unit })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::stmcp::{CurrentReference, Ramp};

    #[test]
    fn limits_hold_in_both_directions_and_for_registers() {
        let limits = Limits { speed_rpm: Some(1000), current_s16a: Some(500) };
        let ramp = |speed_rpm| Request::Ramp(Ramp { speed_rpm, duration_ms: 0 });
        assert!(limits.check(&ramp(-1000)).is_ok());
        assert!(limits.check(&ramp(-1001)).is_err());
        assert!(limits.check(&ramp(i32::MIN)).is_err());
        let currents = CurrentReference { iq_s16a: 0, id_s16a: -501 };
        assert!(limits.check(&Request::CurrentReference(currents)).is_err());
        let write = Request::SetRegister { register: RegisterId::TORQUE_REF, value: &[0xF5, 0x01] };
        let exceeded = LimitError::Exceeded { value: 501, limit: 500, unit: "s16A" };
        assert_eq!(limits.check(&write), Err(exceeded));
        let torque = |value| Request::SetRegister { register: RegisterId::TORQUE_REF, value };
        assert_eq!(limits.check(&torque(&[0xF5, 0x01, 0x00])), Err(exceeded));
        let part = Err(LimitError::Part(RegisterId::TORQUE_REF));
        assert_eq!(limits.check(&torque(&[0xFF])), part);
        assert!(Limits::default().check(&ramp(i32::MIN)).is_ok());
    }
}
