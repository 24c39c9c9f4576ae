//! Motors that speak the RMD protocol V1.62.
//!
//! Nothing may turn the motor unless [`Need::Spin`](crate::Need::Spin) is allowed: neither 0x88 nor a
//! motion command nor 0x280 is sent, not even with 0, for a motor under current may move. 0x80 and
//! 0x81 are sent, to a motor that is at rest: one that holds a load without showing current is let go
//! of. Moves are slow, from a few degrees to a turn, and end switched off.
//!
//! Command bytes of related protocols, which a motor of this one must not know, are only sent where
//! both [`Need::Spin`](crate::Need::Spin) and [`Need::Rom`](crate::Need::Rom) are allowed: firmware
//! that does know them may move, or write.
//!
//! Gains in ROM cannot be read without a power cycle. Where none is at hand, those in RAM are taken
//! for them: try [`Need::Rom`](crate::Need::Rom) on a motor that was just switched on.

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

/// What a motor is put through: first what leaves it alone, then whether it can be switched off.
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

/// Every clause and what tests it, as a Markdown table.
pub fn table() -> String {
    markdown(CLAUSES, suite().iter())
}
