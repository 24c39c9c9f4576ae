//! Tests of a host: scripted drives that misbehave, and the reaction of a correct host.
//!
//! A [`Scenario`] is a drive with a script ([`st::ScriptedDrive`], [`rmd::ScriptedMotors`]). It is
//! a served station like any other, so it tests a host behind a pty, or a host in this process on
//! virtual time. The host is asked to read a value a few times. Every reading has a unique value,
//! so the host's output shows which reply it matched to which request. The drive records a
//! [`Journal`]: the true and the false values that it sent, and the host's transfers.
//! [`Scenario::judge`] compares the output of the host, [`HostOutput`], with the journal.

mod journal;
mod judge;
mod outbox;
pub mod rmd;
mod scenario;
mod script;
pub mod st;

pub use journal::Journal;
pub use judge::{HostOutput, Reading};
pub use scenario::{Demand, READINGS, Scenario, Task};
