//! A host under test: adversarial drives that it is put in front of, and what a correct host makes of
//! them.
//!
//! A [`Scenario`] is a drive with a script ([`st::ScriptedDrive`], [`rmd::ScriptedMotors`]). It is a served station
//! like any other, so it tests a host behind a pty as well as one in this process on virtual time. A
//! host is asked to read a value a few times. Every reading has a value of its own, so what the host
//! says afterwards tells which reply it took for which. The drive writes a [`Journal`] of what it
//! sent truly, what falsely and what the host did on the wire; [`Scenario::judge`] holds what the host
//! [`Said`] against it.

mod journal;
mod judge;
mod outbox;
pub mod rmd;
mod scenario;
mod script;
pub mod st;

pub use journal::Journal;
pub use judge::{Reading, Said};
pub use scenario::{Demand, READINGS, Scenario, Task};
