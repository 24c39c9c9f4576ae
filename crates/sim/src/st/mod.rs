//! A drive with ST's Motor Control Protocol: one to seven motors on one serial line.
//!
//! The drive's firmware runs on the [plant](crate::plant): currents, observers and the over-current
//! comparator each period of the pulse width modulation, everything else each millisecond.
//!
//! | each period ([currents](foc)) | each millisecond |
//! |---|---|
//! | samples of two phase currents, less the offsets of OFFSET_CALIB | speed; causes of faults; state machine |
//! | observers: currents, back-EMF, angle | ramps; speed and position regulators; flux weakening |
//! | Park, regulators of Iq and Id, feed-forward, circle, inverse Park | rev-up, alignment, switch-over |
//! | BREAK_IN when a phase's current is beyond the trip level | bus: PFC's voltage regulator, the board's own power |
//! | the PFC's current regulator | |
//!
//! It knows the motor's values as they are in its configuration, not how they are now: the
//! resistance of a warm winding, a load's inertia or a changed voltage are news to it. Signals are
//! digits of s16 that are quantised where they are measured and rounded where they are read. Where
//! the document and the field notes are silent this drive does as follows.
//!
//! * START goes to what was commanded last: RAMP_FINAL_SPEED within the last ramp's duration, the
//!   current references, or a position. Commands before RUN only replace it.
//! * A ramp beyond MAX_APP_SPEED ends there. Currents are held to the rated current, Id first.
//! * OFFSET_CALIB measures both currents without current; ALIGNMENT drives a current along phase A,
//!   which turns there from a quarter turn before, and takes where the rotor comes to rest as the
//!   encoder's zero. Friction leaves it some electrical degrees off.
//! * A build without position sensor revs up in the direction that it is commanded to run in: the
//!   current of its rev-up table in a frame that turns with the table's speed, a quarter turn more
//!   in the first half of the first phase. At the table's end it is a START_UP fault unless the
//!   observer has seen the rotor for 20 ms within 15 % of the forced speed, no slower than
//!   MIN_APP_SPEED. In SWITCH_OVER the observer's frame takes over: the current stays what it is,
//!   and what of it is flux current goes in a straight line.
//! * A build with position sensor aligns at its first start after power-on, and on ENCODER_ALIGN.
//! * SPEED_FDBK: more than 1.2 times MAX_APP_SPEED; without sensor, 30 ms without the
//!   [observer] seeing the rotor, so that a drive without sensor cannot reverse through
//!   rest; with an encoder, a fifth of the rated current for half a second without a quarter of
//!   MIN_APP_SPEED, except in a position move.
//! * In ANY_STOP and in a fault the bridge is open: the rotor coasts, diodes conduct while the
//!   back-EMF is above the bus. WAIT_STOP_MOTOR ends when the terminals show no back-EMF.
//! * s16A: 32767 is the full scale of the current sensors. s16V: 32767 is the greatest phase voltage
//!   in a circle, the bus voltage over √3, also where the bus is not nominal. s16degree: 65536 is an
//!   electrical turn. s16speed: 0.1 Hz of mechanical speed, which is also the unit of the speed
//!   regulator's gains. s16V²: the product of two s16V over 32768.
//! * Gains are numerators. SPEED_KP_DIV divides SPEED_KP and KD, SPEED_KI_DIV divides KI, once a
//!   millisecond. 1024 divides KP and KD of the current regulators, 16384 their KI, once a period.
//!   32768 divides FLUXWK_KP and KI: s16A from `(limit² − |v|²) / 32768`. POSITION_KP, KI and KD are
//!   sixteenths and give rad/s for rad. The [observer] and the [PFC](pfc) say theirs.
//! * Gains at power-on come from the motor's values by [rules](tuning).
//! * Feed-forward, with n as s16speed and references of the currents: `FF_VQ = n (FF_2 + FF_1Q Id /
//!   32768) / 1024` and `FF_VD = -n FF_1D Iq / 32768 / 1024` at the nominal bus voltage, which is the
//!   voltage of the configured source; more or less where the bus is lower or higher.
//! * PFC_STATUS is a [`PfcState`]; PFC_FAULTS is laid out as FLAGS with [`pfc_fault`] bits.
//!   PFC_ACBUS_RMS is the peak of the mains, as the document's words have it.
//! * MOTOR_POWER is the mean electrical power into the motor over about 20 ms.

mod config;
mod control;
mod drive;
mod encoder;
pub mod foc;
mod motor;
pub mod observer;
pub mod pfc;
mod readings;
mod registers;
mod scale;
mod slow;
mod state;
mod station;
pub mod tuning;
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
