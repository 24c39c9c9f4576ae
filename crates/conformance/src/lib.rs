//! A conformance kit for both protocols: what the documents demand, sentence by sentence, and what
//! tests it.
//!
//! [`st::CLAUSES`] and [`rmd::CLAUSES`] are the sentences, each with an id. [`st::suite`] and
//! [`rmd::suite`] are the cases that a drive is put through; each names the clauses it tests. A case
//! speaks through a link, which is a real port or a simulated drive on virtual time, so the same
//! cases test a drive on the bench and, in milliseconds, this kit itself. [`run`] runs them and gives
//! a [`Report`].
//!
//! Where a document is silent or contradicts itself, a case demands our [`Reading`] of it. A drive that
//! differs from one has not failed, unless the user wants it so: [`Report::strict`].
//!
//! [`host`] is for the other end: drives that misbehave, and what a host makes of them.
//!
//! A drive is left as it was found: cases restore what they write, and nothing that may turn a motor,
//! wears a ROM or needs a hand at the power switch runs unless it is [`Need`]ed and allowed.

mod case;
mod clause;
mod finding;
pub mod host;
mod junit;
mod markdown;
mod reading;
mod report;
pub mod rmd;
pub mod st;
mod world;

pub use case::{Case, Need, Run, Stop, Subject, run};
pub use clause::Clause;
pub use finding::Finding;
pub use markdown::scenario_table;
pub use reading::{READINGS, Reading};
pub use report::{Outcome, Report, Verdict};
pub use world::{Unavailable, World};
