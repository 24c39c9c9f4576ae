//! Simulated drives that answer both protocols, on virtual time.
//!
//! | to | use |
//! |---|---|
//! | simulate an ST drive with one to seven motors: bytes in, bytes out | [`st::StStation`] |
//! | simulate a CAN bus with RMD motors: frames in, frames out | [`rmd::RmdBus`] |
//! | simulate a motor with its mechanics, supply, power stage, sensors and heat | [`plant::Plant`] |
//! | choose the values of a real motor | [`preset`] |
//! | change load, supply or temperature, lock the rotor | `plant_mut` of [`st::StMotor`] and [`rmd::RmdMotor`] |
//! | inject faults, read the true state | `inject` and `truth` of the same |
//! | compare two states | [`hash::fingerprint`] |
//!
//! Time is an argument: each drive advances in steps of fixed length to the given
//! [`Instant`](motorlink_proto::time::Instant). It reads no clock, and noise depends only on a seed
//! and the step. So the same commands at the same times give the same bytes and the same
//! [fingerprint](hash::fingerprint), for any division of the time.
//!
//! # Conventions
//!
//! * SI units in `f32`, which a Cortex-M4F computes in hardware; other units are in the name. A value that
//!   changes little is stored as a difference, to keep its precision: the bus voltage as its sag.
//! * Positive torque and current turn towards growing angles, which RMD calls clockwise. Positive
//!   power goes from the supply into the motor and from the motor into the load.
//! * Phase quantities are amplitudes: the Clarke transform keeps them (alpha is phase A). So torque is
//!   `1.5 p (ψ iq + (Ld − Lq) id iq)`, back-EMF is `p ψ ω`, power is `1.5 (vd id + vq iq)`.
//! * The d axis is that of the magnet; q is a quarter of an electrical turn ahead. At the electrical
//!   angle 0 the d axis is on phase A's axis.
//! * Angles are binary where they are exact ([`angle`]): 2^32 a turn, over all turns in an `i64`.
//! * The maximum phase voltage is the bus voltage over the square root of three.
//! * Values in front of a gear refer to the rotor, unless their name says output or load.
//!
//! ```
//! use motorlink_proto::{st::{Command, Frame, Profile, Request}, time::Instant};
//! use motorlink_sim::st::{StDrive, StStation};
//!
//! let mut station = StStation::new(Profile::Spec, StDrive::demo(Instant(0)));
//! let mut frame = [0; 131];
//! let start = Request::ExecuteCommand(Command::StartMotor);
//! let start = Frame::command(1, &start, &mut frame).unwrap();
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
pub mod control;
pub mod hash;
pub mod plant;
pub mod preset;
pub mod rmd;
pub mod st;
pub mod vector;
