//! Motors that speak the RMD protocol V1.62.
//!
//! The motor must not turn unless [`Need::Spin`](crate::Need::Spin) is permitted. Without it, 0x88,
//! motion commands and 0x280 are not sent, not even with value 0, because a motor under current may
//! move. 0x80 and 0x81 are sent to a motor at rest. A motor that holds a load without showing
//! current then releases it. Moves are slow, from a few degrees to a turn, and end with the motor
//! off.
//!
//! Command bytes of related protocols must be unknown to the motor. They are sent only if both
//! [`Need::Spin`](crate::Need::Spin) and [`Need::Rom`](crate::Need::Rom) are permitted: firmware
//! that knows them may move, or write its ROM.
//!
//! Gains in ROM cannot be read without a power cycle. If power cycling is unavailable, the gains in
//! RAM are assumed to be the same: use [`Need::Rom`](crate::Need::Rom) on a motor that was just
//! switched on.

mod case;
mod clauses;
mod encoder;
mod frames;
mod harness;
mod kept;
mod many;
mod motion;
mod position;
mod power;
mod restore;
mod settings;
mod speed;
mod spin;
mod status;
mod torque;
mod words;

use crate::case::Case;
use crate::markdown::markdown;

pub use clauses::CLAUSES;
pub use harness::{Harness, Options};

/// The cases of a motor: first those without effect on it, then whether it can be switched off.
pub fn suite() -> Vec<Case<Harness>> {
    let topics = [
        frames::cases(),
        settings::cases(),
        status::cases(),
        power::cases(),
        encoder::cases(),
        motion::cases(),
        torque::cases(),
        speed::cases(),
        position::cases(),
        many::cases(),
    ];
    topics.into_iter().flatten().collect()
}

/// Every clause and its tests, as a Markdown table.
pub fn table() -> String {
    markdown(CLAUSES, suite().iter())
}
