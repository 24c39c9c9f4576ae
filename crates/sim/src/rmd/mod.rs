//! RMD motors on a CAN bus.
//!
//! A drive runs on a [`Plant`](crate::plant::Plant). Each of its periods (50 µs) the torque loop gives
//! a voltage from the phase currents and the encoder, with Id at 0. Every 250 µs (as many whole
//! periods as fit) position gives a speed reference and speed gives a torque current reference. The
//! encoder is all that they know of the rotor: speed is the difference of its counts through a low
//! pass of 1000 rad/s, and what hosts read of it through one of 50 rad/s.
//!
//! Gains of 100, as shipped, are tuned for the machine without a load: 5000 rad/s of bandwidth in the
//! loop for torque (a quarter of a step a period), 300 rad/s in that for speed, 20 rad/s in that for
//! position; the bytes scale them in proportion. A load's inertia makes the speed loop slower by as
//! much as it outweighs the rotor's. A speed loop that is too slow for its Ki or for the position loop
//! oscillates, up to the torque current limit.
//!
//! Beyond what the document says this drive does as follows.
//!
//! * Angles, speeds and accelerations are those of the motor shaft, where the encoder is
//!   (docs/SPEC-NOTES.md R31); [`Truth::plant`] has the output as well.
//! * A move to a position is planned with the acceleration limit, and in any case with no more than
//!   half of what the greatest torque current can do to the rotor alone.
//! * Without an acceleration limit a speed is gone to as fast as the torque current allows.
//! * Max Angle holds 0xA3 and 0xA4 within ± that angle from zero.
//! * References stay below nine tenths of the speed at which the back-EMF takes up the bus voltage.
//! * No flag names too much current, a motor that is held, or a bus that is too high: references end
//!   at 33 A, which is what feedback can tell; a motor that is held pushes with its limit until it is
//!   too hot; braking raises the bus where neither source nor chopper takes the energy.
//! * Low voltage is that of the bus, whose capacitor holds it for a while without a supply.
//! * Iq is the mean of about ten samples, and 0 while the motor is off. Phase currents are a sample.

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
