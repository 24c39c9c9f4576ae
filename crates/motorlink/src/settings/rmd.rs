//! Settings of RMD motors: gains, acceleration limit, encoder offset.

use motorlink_proto::rmd::{
    Acceleration, Command, Encoder, EncoderOffset, MotionStatus, MotorId, Payload, Pid,
    ReadAcceleration, ReadEncoder, ReadMotionStatus, ReadPid, WriteAccelerationRam,
    WriteEncoderOffsetRom, WritePidRam, WritePidRom,
};

use super::{Answer, Ask, Block, Kind, NotASetting, Setting, StepError, Tunable, Tuning, Writing};
use crate::rmd::{Error, Motor};

/// What one request of an RMD motor writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RmdBlock {
    /// The six gains (0x30, 0x31, 0x32).
    Gains,
    /// The acceleration limit (0x33, 0x34).
    Acceleration,
    /// The encoder offset (0x90, 0x91).
    EncoderOffset,
}

/// The settings of an RMD motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RmdTuning {
    /// The motor.
    pub motor: MotorId,
}

impl Tuning for RmdTuning {
    type Id = RmdBlock;
    type Request = [u8; 8];

    fn kind(&self) -> Kind {
        Kind { protocol: "rmd", profile: None, motor: self.motor.number() }
    }

    /// None: a motor of V1.62 has no name that can be read.
    fn identity(&self) -> u8 {
        0
    }

    fn blocks(&self) -> Vec<Block<RmdBlock>> {
        vec![
            Block {
                id: RmdBlock::Gains,
                settings: settings::<Pid>(""),
                writing: Writing::Kept,
                heading: "Gains",
            },
            Block {
                id: RmdBlock::Acceleration,
                settings: settings::<Acceleration>(""),
                writing: Writing::Volatile,
                heading: "Acceleration limit of the motor shaft; 0 is no limit",
            },
            Block {
                id: RmdBlock::EncoderOffset,
                settings: settings::<EncoderOffset>("encoder_"),
                writing: Writing::Permanent,
                heading: "Zero of the encoder in counts, of this one motor; it is in ROM",
            },
        ]
    }

    fn not_a_setting(&self, _: &str) -> Option<NotASetting> {
        None
    }

    fn request(&self, ask: &Ask<RmdBlock>) -> [u8; 8] {
        match ask {
            Ask::Read(RmdBlock::Gains) => ReadPid.encode(),
            Ask::Read(RmdBlock::Acceleration) => ReadAcceleration.encode(),
            Ask::Read(RmdBlock::EncoderOffset) => ReadEncoder.encode(),
            Ask::Write(RmdBlock::Gains, digits) => WritePidRam(payload(digits)).encode(),
            Ask::Keep(RmdBlock::Gains, digits) => WritePidRom(payload(digits)).encode(),
            Ask::Write(RmdBlock::Acceleration, digits)
            | Ask::Keep(RmdBlock::Acceleration, digits) => {
                WriteAccelerationRam(payload(digits)).encode()
            }
            Ask::Write(RmdBlock::EncoderOffset, digits)
            | Ask::Keep(RmdBlock::EncoderOffset, digits) => {
                WriteEncoderOffsetRom(payload(digits)).encode()
            }
            Ask::Motion | Ask::Identity(_) => ReadMotionStatus.encode(),
        }
    }

    fn answer(&self, ask: &Ask<RmdBlock>, reply: &[u8]) -> Option<Answer> {
        let reply = reply.try_into().ok()?;
        let digits = match ask {
            Ask::Read(RmdBlock::Gains) => digits(&Pid::decode(&reply)),
            Ask::Read(RmdBlock::Acceleration) => digits(&Acceleration::decode(&reply)),
            Ask::Read(RmdBlock::EncoderOffset) => {
                digits(&EncoderOffset { offset: Encoder::decode(&reply).offset })
            }
            _ => Vec::new(),
        };
        // A motor that holds its angle is at rest, too: the protocol cannot read what it was commanded.
        let speed = (*ask == Ask::Motion).then(|| MotionStatus::decode(&reply).speed);
        let speed = speed.filter(|speed| speed.0 != 0);
        Some(Answer { digits, text: speed.map(|speed| format!("turns at {speed}")) })
    }

    fn expected(&self, _: RmdBlock, digits: Vec<i64>) -> Vec<i64> {
        digits
    }
}

impl Tunable for Motor<'_> {
    type Tuning = RmdTuning;
    type Error = Error;

    fn tuning(&self) -> RmdTuning {
        RmdTuning { motor: self.id() }
    }

    fn ask(&self, ask: &Ask<RmdBlock>) -> Result<Answer, Error> {
        let reply = self.bus().raw(self.id(), self.tuning().request(ask))?;
        Ok(self.tuning().answer(ask, &reply).unwrap_or_default())
    }

    /// Nothing: no limit of the client is about settings.
    fn check(&self, _: &Ask<RmdBlock>) -> Result<(), Error> {
        Ok(())
    }

    fn confirm(&self) -> Result<(), Error> {
        self.bus().confirm(self.id())
    }
}

impl StepError for Error {
    /// Never: a motor that does not know a command is silent.
    fn is_refusal(&self) -> bool {
        false
    }

    fn is_line_failure(&self) -> bool {
        self.is_line_failure()
    }

    fn is_interruption(&self) -> bool {
        matches!(self, Error::Port(error) if error.is_interruption())
    }
}

/// The fields of a message, with `prefix` before each name.
fn settings<P: Payload>(prefix: &str) -> Vec<Setting> {
    let setting = |name: &str, scale| Setting { name: format!("{prefix}{name}"), scale, doc: "" };
    P::FIELDS.iter().map(|field| setting(field.name, field.scale)).collect()
}

fn digits<P: Payload>(message: &P) -> Vec<i64> {
    let data = message.encode_as(0);
    P::FIELDS.iter().map(|field| field.raw(&data)).collect()
}

/// The message with these digits in its fields.
fn payload<P: Payload>(digits: &[i64]) -> P {
    let mut data = [0; 8];
    for (field, digits) in P::FIELDS.iter().zip(digits) {
        let place = usize::from(field.offset)..usize::from(field.offset + field.len);
        data[place].copy_from_slice(&digits.to_le_bytes()[..usize::from(field.len)]);
    }
    P::decode(&data)
}
