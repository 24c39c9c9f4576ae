//! ST's serial Motor Control Protocol, both ends.
//!
//! Paragraph numbers are those of the document "Motor Control Protocol"; where it is silent or
//! contradicts itself, `docs/SPEC-NOTES.md` has the reading (`S1`, `S2`, …).
//!
//! * [`Frame`] turns bytes into header, payload and checksum and back (chapter 3).
//! * [`Request`] and the reply types of [`message`] are the messages (chapter 4).
//! * [`register`] is table 3 as typed constants, [`RegisterId`] the same by number.
//! * [`Master`] conducts one exchange at a time; [`Slave`] answers for a [`Drive`].

mod code;
mod drive;
mod failure;
mod frame;
mod master;
pub mod message;
pub mod register;
mod slave;

pub use code::{
    Command, ControlMode, ErrorCode, Flags, FrameCode, HEADER_ACK, HEADER_ATR, HEADER_NACK,
    Profile, Status,
};
pub use drive::{Drive, Motor, Version};
pub use failure::{Error, Failure};
pub use frame::{Bad, Frame, MAX_FRAME, MAX_PAYLOAD, OVERHEAD, Parse, checksum};
pub use master::{Config, Counters, Line, Master, Output, Recovery, RequestError, TIMEOUT};
pub use message::{
    BoardInfo, CurrentReference, FirmwareVersion, PositionMove, REVUP_PHASES, Ramp, Request,
    RevupPhase, TorqueRamp,
};
pub use register::{Feature, Features, RegisterId};
pub use slave::{RECEPTION_TIMEOUT, SEGMENT_REGISTERS, SEGMENTS, Slave};
