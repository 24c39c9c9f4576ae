//! ST's serial Motor Control Protocol, both ends.
//!
//! Paragraph numbers refer to the document "Motor Control Protocol". Where it is unclear or
//! contradicts itself, `docs/SPEC-NOTES.md` explains how this crate reads it (`S1`, `S2`, …).
//!
//! | to | use |
//! |---|---|
//! | send requests and match their replies | [`Master`] with a [`Request`] |
//! | answer as a drive, in firmware or a simulator | [`Slave`] with your [`MotorControl`] |
//! | name a register with its type and access | the constants of [`register`], such as [`register::SPEED_MEAS`] |
//! | look up a register by number | [`RegisterId`] |
//! | limit speeds and currents | [`Limits`] with an [`Account`] |
//! | write a register and read it back | [`VerifiedWrite`] |
//! | convert between frames and bytes | [`Frame`] |
//! | convert between messages and payloads | [`Request`], [`Reply`], the types of [`message`] |
//!
//! Example: a drive with one motor that has only a speed, as in firmware or in a test.
//!
//! ```
//! use motorlink_proto::st::*;
//! use motorlink_proto::time::Instant;
//!
//! struct Fan { rpm: i32, running: bool }
//!
//! impl MotorControl for Fan {
//!     fn features(&self, _: MotorNumber) -> Features { Features::NONE }
//!     fn version(&self) -> Version<'_> {
//!         Version { name: "Fan", major: 1, minor: 0, patch: 0, pre_release: "" }
//!     }
//!     // All other registers read as 0.
//!     fn get_register(&mut self, _: MotorNumber, register: RegisterId) -> i32 {
//!         match register {
//!             RegisterId::STATUS if self.running => u8::from(Status::Run).into(),
//!             RegisterId::STATUS => u8::from(Status::Idle).into(),
//!             RegisterId::SPEED_REF | RegisterId::SPEED_MEAS => self.rpm,
//!             _ => 0,
//!         }
//!     }
//!     fn set_register(&mut self, _: MotorNumber, _: RegisterId, _: i32) -> Result<(), ErrorCode> {
//!         Err(ErrorCode::WrongSet)
//!     }
//!     fn execute(&mut self, _: MotorNumber, command: Command) {
//!         match command {
//!             Command::StartMotor => self.running = true,
//!             Command::StopMotor => self.running = false,
//!             _ => {}
//!         }
//!     }
//!     fn set_ramp(&mut self, _: MotorNumber, ramp: Ramp) { self.rpm = ramp.speed_rpm; }
//!     fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase { RevupPhase::default() }
//!     fn set_revup_data(&mut self, _: MotorNumber, _: u8, _: RevupPhase) {}
//!     fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {}
//! }
//!
//! let mut fan = Fan { rpm: 0, running: false };
//! let mut slave = Slave::new(Profile::Spec, MotorNumber::FIRST);
//! // For each byte of the UART: send the returned reply. At `deadline`: call `poll`.
//! let mut sent = Vec::new();
//! for byte in [0x07, 0x06, 0xDC, 0x05, 0x00, 0x00, 0xE8, 0x03, 0xDA] {
//!     sent.extend_from_slice(slave.receive(Instant(0), byte, &mut fan).unwrap_or(&[]));
//! }
//! assert_eq!((fan.rpm, &sent[..]), (1500, &[0xF0, 0x00, 0xF0][..]));
//! ```

mod account;
mod arrival;
mod code;
mod command;
mod confirm;
mod drive;
mod effect;
mod failure;
mod frame;
mod full_scale;
mod limits;
mod master;
pub mod message;
#[cfg(feature = "std")]
mod owned;
mod payload;
pub mod register;
mod settings;
mod slave;
mod started;
mod starting;
#[cfg(feature = "std")]
mod value;
mod verified;

pub use account::Account;
pub use arrival::{
    ARRIVAL_SPARE_TIME, ARRIVAL_TOLERANCE_RAD, AbortReason, ArrivalSampler, ArrivalWatch,
    NotArrived,
};
pub use code::{
    Command, ControlMode, ErrorCode, Flags, FrameCode, HEADER_ACK, HEADER_ATR, HEADER_NACK,
    NoSuchProfile, Profile, Status,
};
pub use confirm::{Confirmation, LastExchange};
pub use drive::{MotorControl, MotorNumber};
pub use effect::Effect;
pub use failure::{ExchangeError, Failure};
pub use frame::{Bad, CODE_BITS, Frame, MAX_FRAME, MAX_PAYLOAD, OVERHEAD, Parse, checksum};
pub use full_scale::{FullScale, InvalidFullScale};
pub use limits::{LimitError, Limits};
pub use master::{
    Counters, Master, MasterConfig, Output, Recovery, RequestError, SyncState, TIMEOUT,
    question_behind,
};
pub use message::{
    BoardInfo, CurrentReference, FirmwareVersion, PositionMove, REVUP_PHASES, Ramp, Reply,
    ReplySize, Request, RevupPhase, TorqueRamp, Version,
};
#[cfg(feature = "std")]
pub use owned::OwnedRequest;
pub use register::{Feature, Features, RegisterId, segment_values};
pub use settings::{NotASetting, Setting};
pub use slave::{RECEPTION_TIMEOUT, SEGMENT_REGISTERS, SEGMENTS, Slave};
pub use started::Started;
pub use starting::{NotStarted, Starting};
#[cfg(feature = "std")]
pub use value::{Implausible, Reading, UnknownRegister, ValueError, find_register, parse_value};
pub use verified::{Unverified, VERIFY_ATTEMPTS, VerifiedWrite, Verifying};
