//! Simulated drives that answer both protocols, on virtual time.
//!
//! * [`st::StStation`] is a drive of one to seven motors behind ST's Motor Control Protocol: bytes
//!   in, bytes out.
//! * [`rmd::RmdBus`] is a CAN bus with RMD motors: frames in, frames out.
//! * [`machine`] and [`heat`] are what both turn and warm up.
//!
//! Time is an argument: each drive advances in steps of fixed length to the
//! [`Instant`](motorlink_proto::time::Instant) that it is given. It reads no clock and draws no
//! random number, so the same commands at the same times give the same bytes, however finely time
//! is cut. Beside the protocol each motor has handles for the world around it (supply, temperature,
//! load, locked rotor, faults) and a snapshot of what is really going on.
//!
//! # Conventions
//!
//! SI units in `f32`; other units are in the name. Positive torque accelerates towards growing
//! angles, which RMD calls clockwise. Phase quantities are amplitudes (the Clarke transform keeps
//! them), so torque is the torque constant times Iq, back-EMF is two thirds of the torque constant
//! times speed, and power is `1.5 (vq iq + vd id)`. The greatest phase voltage is the bus voltage
//! over the square root of three.
//!
//! ```
//! use motorlink_proto::{stmcp::{Command, Profile, Request}, time::Instant};
//! use motorlink_sim::st::{StDrive, StStation};
//!
//! let mut station = StStation::new(Profile::Spec, StDrive::demo(Instant(0)));
//! let mut frame = [0; 131];
//! let start = Request::Execute(Command::StartMotor).encode(1, &mut frame).unwrap();
//! station.receive(Instant(0), start, |reply| assert_eq!(reply, [0xF0, 0x00, 0xF0]));
//! station.advance_to(Instant(3_000_000));
//! let [motor, _] = station.drive().motors() else { unreachable!() };
//! assert!((motor.truth().speed_rpm - 1500.0).abs() < 15.0);
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod angle;
mod clock;
pub mod hash;
pub mod heat;
pub mod machine;
pub mod plant;
pub mod preset;
pub mod rmd;
pub mod st;
mod transform;
pub mod vector;
