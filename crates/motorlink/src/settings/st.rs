//! Settings of ST drives: registers and the phases of the rev-up.

use motorlink_proto::st::register::Unit;
use motorlink_proto::st::{
    ErrorCode, Feature, Request, RevupPhase, Setting as Id, Status, VerifiedWrite,
};
use motorlink_proto::units::Scale;

use super::{Block, Kind, Setting, Tunable, Writing};
use crate::st::{Error, Motor};

/// The heading of the phases of the rev-up.
const REVUP: &str = "Rev-up: speed and Iq at the end of each phase, and its length";
/// The heading of divisors, which cannot be written.
const DIVISORS: &str = "Divisors of the gains, of the firmware; they cannot be written";
/// The heading of registers that every drive has.
const CORE: &str = "Registers of every drive";

impl Tunable for Motor<'_> {
    type Id = Id;
    type Error = Error;

    fn kind(&self) -> Kind {
        let profile = Some(self.client().profile().name());
        Kind { protocol: "st", profile, motor: self.number().number() }
    }

    fn identity(&self) -> Result<Vec<String>, Error> {
        let board = self.client().board_info()?;
        let [major, minor, patch] = board.version;
        let mut lines = vec![format!("board: {} {major}.{minor}.{patch}", board.name)];
        match self.client().firmware_version() {
            Ok(firmware) => lines.push(format!("firmware: {} {}", firmware.name, firmware.version)),
            // Firmware 5.0 does not know the frame code.
            Err(error) if error.is_refusal() => {}
            Err(error) => return Err(error),
        }
        Ok(lines)
    }

    fn blocks(&self) -> Vec<Block<Id>> {
        Id::all(self.client().profile()).map(|id| self.block(id)).collect()
    }

    fn read(&self, block: Id) -> Result<Vec<i64>, Error> {
        Ok(match block {
            Id::Register(register) => vec![self.get_raw(register)?.into()],
            Id::RevupPhase(phase) => digits(self.revup_data(phase)?),
        })
    }

    fn check(&self, block: Id, digits: &[i64]) -> Result<(), Error> {
        let number = self.number().number();
        match block {
            Id::Register(register) => {
                let bytes = bits(digits).to_le_bytes();
                let size = usize::from(register.write_size(self.client().profile()));
                let value = &bytes[..size.min(bytes.len())];
                self.client().check(number, &Request::SetRegister { register, value })
            }
            Id::RevupPhase(phase) => {
                self.client().check(number, &Request::SetRevupData(phase, revup(digits)))
            }
        }
    }

    fn write(&self, block: Id, digits: &[i64]) -> Result<(), Error> {
        match block {
            Id::Register(register) => {
                let size = register.write_size(self.client().profile());
                self.set_raw(register, bits(digits), size)
            }
            Id::RevupPhase(phase) => self.set_revup_data(phase, revup(digits)),
        }
    }

    /// Nothing: no setting of ST's protocol is permanent.
    fn keep(&self, _: Id, _: &[i64]) -> Result<(), Error> {
        Ok(())
    }

    fn expected(&self, block: Id, written: Vec<i64>) -> Vec<i64> {
        let profile = self.client().profile();
        match block {
            Id::Register(register) => {
                match VerifiedWrite::new::<()>(profile, register, bits(&written)) {
                    Ok(write) => vec![write.expected().into()],
                    // A divisor, which is never written.
                    Err(_) => written,
                }
            }
            Id::RevupPhase(_) => digits(revup(&written).expected(profile)),
        }
    }

    fn motion(&self) -> Result<Option<String>, Error> {
        let status = self.status()?;
        let is_at_rest =
            matches!(status, Status::Idle | Status::FaultNow | Status::FaultOver | Status::IclWait);
        Ok((!is_at_rest).then(|| format!("is in {status}")))
    }

    fn confirm(&self) -> Result<(), Error> {
        self.client().confirm()
    }

    fn is_refusal(error: &Error) -> bool {
        matches!(error, Error::Refused { code, .. } if *code != ErrorCode::BadMotorSelected)
    }

    fn is_line_failure(error: &Error) -> bool {
        error.is_line_failure()
    }
}

impl Motor<'_> {
    /// A block with its names.
    fn block(&self, id: Id) -> Block<Id> {
        let profile = self.client().profile();
        let (settings, heading, writing) = match id {
            Id::Register(register) => {
                let (shape, text) = (register.shape(), register.text());
                let is_divisor = register.is_divisor();
                let heading = match shape.map(|shape| shape.feature) {
                    _ if is_divisor => DIVISORS,
                    Some(Feature::Core) | None => CORE,
                    Some(feature) => feature.name(),
                };
                let setting = Setting {
                    name: register.to_string(),
                    scale: register.scale(profile).expect("settings are integers"),
                    doc: text.map_or("", |text| text.doc),
                };
                let writing = if is_divisor { Writing::Fixed } else { Writing::Volatile };
                (vec![setting], heading, writing)
            }
            Id::RevupPhase(phase) => {
                let value = |name: &str, scale| Setting {
                    name: format!("REVUP_{phase}_{name}"),
                    scale,
                    doc: "",
                };
                let speed = scale(Unit::Rpm, i32::MIN.into(), i32::MAX.into());
                let torque = scale(Unit::S16A, i16::MIN.into(), i16::MAX.into());
                let duration = scale(Unit::Millisecond, 0, u16::MAX.into());
                let settings = vec![
                    value("SPEED", speed),
                    value("TORQUE", torque),
                    value("DURATION", duration),
                ];
                (settings, REVUP, Writing::Volatile)
            }
        };
        Block { id, settings, writing, heading }
    }
}

/// The unit of a value of a rev-up phase.
fn scale(unit: Unit, least: i64, most: i64) -> Scale {
    Scale { symbol: unit.symbol(), ..Scale::plain(least, most) }
}

/// The value of a register that was written as digits.
fn bits(digits: &[i64]) -> i32 {
    digits.first().copied().unwrap_or_default() as i32
}

fn digits(phase: RevupPhase) -> Vec<i64> {
    let RevupPhase { speed_rpm, torque_s16a, duration_ms } = phase;
    vec![speed_rpm.into(), torque_s16a.into(), duration_ms.into()]
}

fn revup(digits: &[i64]) -> RevupPhase {
    let [speed_rpm, torque_s16a, duration_ms] =
        [0, 1, 2].map(|place| digits.get(place).copied().unwrap_or_default());
    RevupPhase {
        speed_rpm: speed_rpm as i32,
        torque_s16a: torque_s16a as i16,
        duration_ms: duration_ms as u16,
    }
}
