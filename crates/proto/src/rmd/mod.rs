//! The RMD motor control protocol over CAN, V1.62: host and drive.
//!
//! A bus has up to 32 motors. Request and reply of a motor have the same identifier, always eight
//! bytes, and the same command code in the first (chapter 1); one frame more carries torque
//! currents for motors 1 to 4 at once (chapter 4).
//!
//! * [`Host`] sends requests to many motors and finds the reply to each.
//! * [`Drive`] answers, and tells a [`MotorControl`] what to do.
//! * [`COMMANDS`] is the list of commands with the place and unit of each value; there is a type
//!   for each request and reply, which [`Command`] ties together.
//! * [`describe`] puts a frame into words.
//!
//! Where the document leaves something open, docs/SPEC-NOTES.md says how it is read here; comments
//! cite its rows as R1, R2 and so on.
//!
//! ```
//! use motorlink_proto::{can::CanFrame, rmd::*, time::Instant, units::*};
//!
//! let motor = MotorId::new(1).unwrap();
//! let mut host = Host::new();
//! host.trust(MotorSet::ALL); // No other host spoke to these motors.
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

mod command;
mod describe;
mod doubt;
mod drive;
mod encoder;
mod host;
mod limits;
mod message;
mod motor;
mod outcome;
mod payload;
mod reply;

pub use command::*;
pub use describe::{Described, Direction, describe};
pub use drive::{Drive, DriveConfig, Ignored, Mode, MotorControl, Sense, Settings};
pub use encoder::{EncoderBits, FULL_TURN};
pub use host::{DEFAULT_QUARANTINE, DEFAULT_TIMEOUT, Host, question_behind};
pub use limits::{Exceeded, Limits};
pub use message::*;
pub use motor::{Dialect, IDENTIFIERS, MOTOR_BASE, MotorId, MotorSet, TORQUE4_ID};
pub use outcome::{Counters, Failure, Output, RequestError};
pub use payload::{Field, Meaning, Payload};
pub use reply::*;
