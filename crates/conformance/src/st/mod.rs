//! Drives that speak ST's Motor Control Protocol.

mod clauses;
mod commands;
mod explore;
mod faults;
mod found;
mod frames;
mod harness;
mod messages;
mod motion;
mod motors;
mod registers;
mod restore;
mod safety;
mod sizes;
mod timing;
mod undo;
mod units;
mod values;

use motorlink_proto::st::Profile;

use crate::case::Case;
use crate::markdown::markdown;

pub use clauses::CLAUSES;
pub use harness::{Harness, Options};
pub use safety::may_start;

/// The cases of a drive of this profile: from frames to messages, then cases that turn the motor or
/// need help.
pub fn suite(profile: Profile) -> Vec<Case<Harness>> {
    let topics = [
        frames::cases,
        timing::cases,
        motors::cases,
        registers::cases,
        sizes::cases,
        commands::cases,
        messages::cases,
        motion::cases,
        units::cases,
        faults::cases,
    ];
    topics.into_iter().flat_map(|cases| cases(profile)).collect()
}

/// Every clause and its tests in either profile, as a Markdown table.
pub fn table() -> String {
    let suites = [Profile::Spec, Profile::Mcsdk54].map(suite);
    markdown(CLAUSES, suites.iter().flatten())
}
