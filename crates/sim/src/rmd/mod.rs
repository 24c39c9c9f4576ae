//! RMD motors on a CAN bus.
//!
//! A motor's loops run four times a millisecond: position gives a speed reference, speed gives a
//! torque current reference, torque current gives a voltage, each by the gains of its two bytes.
//! Gains of 100, as shipped, are tuned for the machine: about 1400 rad/s, 100 rad/s and 20 rad/s of
//! bandwidth in the loops for torque, speed and position; the bytes scale them in proportion.
//! Beyond what the document says this drive does as follows.
//!
//! * A move to a position is planned with the acceleration limit, and in any case with no more than
//!   half of what the greatest torque current can do, so that it ends without swinging.
//! * Without an acceleration limit a speed is gone to as fast as the torque current allows.
//! * Max Angle holds every position command, also 0xA5 and 0xA6, within ± that angle from zero.
//! * References stay below nine tenths of the speed at which the back-EMF takes up the supply.
//! * The loops see the encoder's counts; a position is reached when the encoder reads it.

mod bus;
mod cascade;
mod config;
mod current;
mod motor;
mod node;
mod speed;

pub use bus::RmdBus;
pub use config::RmdConfig;
pub use motor::{RmdMotor, Truth};
pub use node::RmdNode;
