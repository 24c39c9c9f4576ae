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

use std::collections::HashSet;

use motorlink_proto::st::Profile;

use crate::case::Case;
use crate::markdown::markdown;
use crate::report::Report;

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

/// Fewer failures than this do not show which profile a drive follows.
const TELLING: usize = 5;

/// The other profile, if most failures are of cases that only this profile has. How many they are.
pub fn other_profile(profile: Profile, report: &Report) -> Option<(Profile, usize)> {
    let other = profile.other();
    let others: HashSet<String> =
        suite(other).into_iter().map(|case| case.name.into_owned()).collect();
    let failures = report.failed().count();
    let own = report.failed().filter(|outcome| !others.contains(&outcome.name)).count();
    (failures >= TELLING && 2 * own > failures).then_some((other, own))
}

/// Every clause and its tests in either profile, as a Markdown table.
pub fn table() -> String {
    let suites = [Profile::Spec, Profile::Mcsdk54].map(suite);
    markdown(CLAUSES, suites.iter().flatten())
}
