//! The RMD motor control protocol over CAN, V1.62: host and drive.
//!
//! A bus has up to 32 motors. The request and the reply of a motor have the same identifier, eight
//! bytes, and the same command code in the first byte (chapter 1). One other frame carries torque
//! currents for motors 1 to 4 (chapter 4).
//!
//! | to | use |
//! |---|---|
//! | send requests to motors and match their replies | [`Host`] |
//! | answer as a motor, in firmware or a simulator | [`Drive`] with your [`MotorControl`] |
//! | build a request, read a reply | the types that implement [`Command`], such as [`SetSpeed`] |
//! | command four torques in one frame | [`SetTorque4`], [`Host::set_torque4`] |
//! | list all commands with their values and units | [`COMMANDS`] |
//! | limit currents, speeds and angles | [`Limits`], [`Host::set_limits`] |
//! | convert angles and speeds to the output shaft of a gear | [`GearRatio`] |
//! | wait until a move has arrived | [`ArrivalWatch`] |
//! | print a frame as text | [`describe`] |
//!
//! docs/SPEC-NOTES.md explains how this crate reads unclear passages of the document. Comments
//! refer to its rows as R1, R2 and so on.
//!
//! ```
//! use motorlink_proto::{can::CanFrame, rmd::*, time::Instant, units::*};
//!
//! let motor = MotorId::new(1).unwrap();
//! let mut host = Host::new();
//! host.trust(MotorSet::ALL); // No other host used this bus.
//! let turn = SetPositionLimited { max_speed: SpeedLimit(360), angle: CentiDegrees::from_degrees(90.0) };
//! host.request(Instant(0), motor, turn.encode())?;
//! let Output::Transmit(frame) = host.poll(Instant(0)) else { unreachable!() };
//! assert_eq!(frame.data(), [0xA4, 0x00, 0x68, 0x01, 0x28, 0x23, 0x00, 0x00]);
//!
//! host.receive(Instant(800), &CanFrame::new(0x141, [0xA4, 25, 0, 4, 90, 0, 0, 0x10]));
//! let Output::Done { result: Ok(reply), .. } = host.poll(Instant(800)) else { unreachable!() };
//! let status = MotionStatus::decode(&reply);
//! assert_eq!(status.iq.amps(), 16.5);
//! assert_eq!(EncoderBits::default().degrees(status.encoder), 90.0);
//! # Ok::<(), RequestError>(())
//! ```

mod arrival;
mod command;
mod describe;
mod drive;
mod encoder;
mod gear;
mod host;
mod limits;
mod message;
mod motor;
mod outcome;
mod payload;
mod reply;
mod reply_trust;
mod slot;
mod way;

pub use arrival::{
    ARRIVAL_TIMEOUT, ARRIVAL_TOLERANCE, AbortReason, ArrivalSampler, ArrivalWatch, Arrived,
    NotArrived,
};
pub use command::*;
pub use describe::{Described, Direction, Subject, describe};
pub use drive::{Drive, DriveConfig, Ignored, Mode, MotorControl, Sense, Settings};
pub use encoder::{EncoderBits, FULL_TURN};
pub use gear::{GearRatio, InvalidGearRatio};
pub use host::{DEFAULT_QUARANTINE, Host};
pub use limits::{Exceeded, Limits};
pub use message::*;
pub use motor::{Dialect, IDENTIFIERS, MOTOR_BASE, MotorId, MotorSet, TORQUE4_ID};
pub use outcome::{Counters, Failure, Output, RequestError};
pub use payload::{Field, Meaning, Payload};
pub use reply::*;
pub use reply_trust::question_behind;
pub use slot::DEFAULT_TIMEOUT;
pub use way::Target;
