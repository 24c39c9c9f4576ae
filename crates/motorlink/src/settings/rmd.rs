//! Settings of RMD motors: gains, acceleration limit, encoder offset.

use motorlink_proto::rmd::{
    Acceleration, EncoderOffset, Payload, Pid, WriteAccelerationRam, WriteEncoderOffsetRom,
    WritePidRam, WritePidRom,
};

use super::{Block, Kind, Setting, Tunable, Writing};
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

impl Tunable for Motor<'_> {
    type Id = RmdBlock;
    type Error = Error;

    fn kind(&self) -> Kind {
        Kind { protocol: "rmd", profile: None, motor: self.id().number() }
    }

    /// Nothing: a motor of V1.62 has no name that can be read.
    fn identity(&self) -> Result<Vec<String>, Error> {
        Ok(Vec::new())
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

    fn read(&self, block: RmdBlock) -> Result<Vec<i64>, Error> {
        Ok(match block {
            RmdBlock::Gains => digits(&self.pid()?),
            RmdBlock::Acceleration => digits(&Acceleration { acceleration: self.acceleration()? }),
            RmdBlock::EncoderOffset => digits(&EncoderOffset { offset: self.encoder()?.offset }),
        })
    }

    /// Nothing: no limit of the client is about settings.
    fn check(&self, _: RmdBlock, _: &[i64]) -> Result<(), Error> {
        Ok(())
    }

    fn write(&self, block: RmdBlock, digits: &[i64]) -> Result<(), Error> {
        match block {
            RmdBlock::Gains => self.ask(WritePidRam(payload(digits))).map(drop),
            RmdBlock::Acceleration => self.ask(WriteAccelerationRam(payload(digits))).map(drop),
            RmdBlock::EncoderOffset => self.ask(WriteEncoderOffsetRom(payload(digits))).map(drop),
        }
    }

    fn keep(&self, block: RmdBlock, digits: &[i64]) -> Result<(), Error> {
        match block {
            RmdBlock::Gains => self.ask(WritePidRom(payload(digits))).map(drop),
            RmdBlock::Acceleration | RmdBlock::EncoderOffset => Ok(()),
        }
    }

    fn expected(&self, _: RmdBlock, digits: Vec<i64>) -> Vec<i64> {
        digits
    }

    /// A motor that holds its angle is at rest, too: the protocol cannot read what it was commanded.
    fn motion(&self) -> Result<Option<String>, Error> {
        let speed = self.motion_status()?.speed;
        Ok((speed.0 != 0).then(|| format!("turns at {speed}")))
    }

    fn confirm(&self) -> Result<(), Error> {
        self.bus().confirm(self.id())
    }

    /// Never: a motor that does not know a command is silent.
    fn is_refusal(_: &Error) -> bool {
        false
    }

    fn is_line_failure(error: &Error) -> bool {
        error.is_line_failure()
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
