//! Settings of ST drives: registers and the phases of the rev-up.

use motorlink_link::printable;
use motorlink_proto::st::register::Unit;
use motorlink_proto::st::{
    BoardInfo, ErrorCode, Feature, FirmwareVersion, MotorNumber, OwnedRequest, Profile, RegisterId,
    Request, RevupPhase, Setting as Id, Status, VerifiedWrite,
};
use motorlink_proto::units::Scale;

use super::{Answer, Ask, Block, Kind, NotASetting, Setting, StepError, Tunable, Tuning, Writing};
use crate::st::{Error, Motor};

/// The heading of the phases of the rev-up.
const REVUP: &str = "Rev-up: speed and Iq at the end of each phase, and its length";
/// The heading of divisors, which cannot be written.
const DIVISORS: &str = "Divisors of the gains, of the firmware; they cannot be written";
/// The heading of registers that every drive has.
const CORE: &str = "Registers of every drive";

/// The settings of a motor of an ST drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StTuning {
    /// The motor.
    pub motor: MotorNumber,
    /// The profile of the drive.
    pub profile: Profile,
}

impl Tuning for StTuning {
    type Id = Id;
    /// The number of a motor, 0 for the drive, and the message to it.
    type Request = (u8, OwnedRequest);

    fn kind(&self) -> Kind {
        let profile = Some(self.profile.name());
        Kind { protocol: "st", profile, motor: self.motor.number() }
    }

    /// The board, and the firmware.
    fn identity(&self) -> u8 {
        2
    }

    fn blocks(&self) -> Vec<Block<Id>> {
        Id::all(self.profile).map(|id| self.block(id)).collect()
    }

    fn not_a_setting(&self, name: &str) -> Option<NotASetting> {
        RegisterId::named(name)?.not_a_setting(self.profile)
    }

    fn request(&self, ask: &Ask<Id>) -> (u8, OwnedRequest) {
        let bytes;
        let request = match ask {
            Ask::Identity(0) => return (0, Request::GetBoardInfo.into()),
            Ask::Identity(_) => return (0, Request::GetFirmwareVersion.into()),
            Ask::Motion => Request::GetRegister(RegisterId::STATUS),
            Ask::Read(Id::Register(register)) => Request::GetRegister(*register),
            Ask::Read(Id::RevupPhase(phase)) => Request::GetRevupData(*phase),
            // No setting of ST's protocol is permanent.
            Ask::Write(Id::Register(register), digits)
            | Ask::Keep(Id::Register(register), digits) => {
                bytes = bits(digits).to_le_bytes();
                let size = usize::from(register.write_size(self.profile));
                Request::SetRegister { register: *register, value: &bytes[..size.min(bytes.len())] }
            }
            Ask::Write(Id::RevupPhase(phase), digits)
            | Ask::Keep(Id::RevupPhase(phase), digits) => {
                Request::SetRevupData(*phase, revup(digits))
            }
        };
        (self.motor.number(), request.into())
    }

    fn answer(&self, ask: &Ask<Id>, reply: &[u8]) -> Option<Answer> {
        let text = |text| Answer { text, ..Answer::default() };
        let read = |digits| Answer { digits, ..Answer::default() };
        Some(match ask {
            Ask::Identity(0) => {
                let board = BoardInfo::decode(reply)?;
                let ([major, minor, patch], name) = (board.version, printable(board.name));
                text(Some(format!("board: {name} {major}.{minor}.{patch}")))
            }
            Ask::Identity(_) => {
                let firmware = FirmwareVersion::decode(reply);
                let [name, version] = [firmware.name, firmware.version].map(printable);
                text(Some(format!("firmware: {name} {version}")))
            }
            Ask::Motion => {
                let state = Status::from(RegisterId::STATUS.decode(self.profile, reply)? as u8);
                text((!is_at_rest(state)).then(|| format!("is in {state}")))
            }
            Ask::Read(Id::Register(register)) => {
                read(vec![register.decode(self.profile, reply)?.into()])
            }
            Ask::Read(Id::RevupPhase(_)) => read(digits(RevupPhase::decode(reply)?)),
            Ask::Write(..) | Ask::Keep(..) => Answer::default(),
        })
    }

    fn expected(&self, block: Id, written: Vec<i64>) -> Vec<i64> {
        match block {
            Id::Register(register) => {
                match VerifiedWrite::new::<()>(self.profile, register, bits(&written)) {
                    Ok(write) => vec![write.expected().into()],
                    // A divisor, which is never written.
                    Err(_) => written,
                }
            }
            Id::RevupPhase(_) => digits(revup(&written).expected(self.profile)),
        }
    }
}

/// Whether new settings cannot change how a motor moves.
fn is_at_rest(state: Status) -> bool {
    matches!(state, Status::Idle | Status::FaultNow | Status::FaultOver | Status::IclWait)
}

impl Tunable for Motor<'_> {
    type Tuning = StTuning;
    type Error = Error;

    fn tuning(&self) -> StTuning {
        StTuning { motor: self.number(), profile: self.client().profile() }
    }

    fn ask(&self, ask: &Ask<Id>) -> Result<Answer, Error> {
        let tuning = self.tuning();
        let (motor, request) = tuning.request(ask);
        self.client().exchange(motor, &request.request(), |reply| tuning.answer(ask, reply))
    }

    fn check(&self, ask: &Ask<Id>) -> Result<(), Error> {
        let (motor, request) = self.tuning().request(ask);
        self.client().check(motor, &request.request())
    }

    fn confirm(&self) -> Result<(), Error> {
        self.client().confirm()
    }
}

impl StepError for Error {
    fn is_refusal(&self) -> bool {
        matches!(self, Error::Refused { code, .. } if *code != ErrorCode::BadMotorSelected)
    }

    fn is_line_failure(&self) -> bool {
        self.is_line_failure()
    }

    fn is_interruption(&self) -> bool {
        matches!(self, Error::Port(error) if error.is_interruption())
    }
}

impl StTuning {
    /// A block with its names.
    fn block(&self, id: Id) -> Block<Id> {
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
                    scale: register.scale(self.profile).expect("settings are integers"),
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
