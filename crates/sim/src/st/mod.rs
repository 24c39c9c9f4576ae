//! A drive with ST's Motor Control Protocol: one to seven motors behind one serial line.
//!
//! The drive's firmware runs once a millisecond: state machine, ramps, speed regulator. Its current
//! loops are ideal: Iq and Id follow their references within about a millisecond. Where the
//! document and the field notes are silent this drive does as follows.
//!
//! * START goes to what was commanded last: RAMP_FINAL_SPEED within the last ramp's duration, the
//!   current references, or a position. Commands before RUN only replace it.
//! * A ramp beyond MAX_APP_SPEED ends there. Currents are held to the rated current and to what
//!   the bus voltage can drive against the back-EMF.
//! * A build without position sensor revs up in the direction that it is commanded to run in, by
//!   the phases of its rev-up table. It is a START_UP fault when the rotor is then below four
//!   fifths of the last speed, or that speed is below MIN_APP_SPEED.
//! * A build with position sensor aligns at its first start after power-on, and on ENCODER_ALIGN.
//! * SPEED_FDBK: more than 1.2 times MAX_APP_SPEED, or a fifth of the rated current for half a
//!   second without a quarter of MIN_APP_SPEED, except in a position move.
//! * s16A: 32767 is the full-scale current. s16V: 32767 is the greatest phase voltage. s16degree:
//!   65536 is an electrical turn. s16speed: 0.1 Hz of mechanical speed, which is also the unit of
//!   the speed regulator's gains. s16V²: the product of two s16V over 32768.
//! * Gains are numerators; SPEED_KP_DIV divides Kp and Kd, SPEED_KI_DIV divides Ki, once a
//!   millisecond. POSITION_KP, KI and KD are sixteenths and give rad/s for rad.
//! * Feed-forward, with n as s16speed: `FF_VQ = n (FF_2 + FF_1Q Id / 32768) / 1024` and
//!   `FF_VD = -n FF_1D Iq / 32768 / 1024`.
//! * PFC_STATUS is a [`PfcState`]; PFC_FAULTS is laid out as FLAGS with [`pfc_fault`] bits.

mod config;
mod control;
mod drive;
mod encoder;
mod foc;
mod motor;
mod observer;
mod pfc;
mod readings;
mod registers;
mod scale;
mod slow;
mod state;
mod station;
mod tuning;
mod world;

pub use config::{
    BuildConfig, DurationConfig, MotorConfig, MotorPreset, RevupConfig, ThresholdConfig,
};
pub use drive::StDrive;
pub use motor::StMotor;
pub use pfc::{PfcState, fault as pfc_fault};
pub use registers::Registers;
pub use station::StStation;
pub use world::Truth;
