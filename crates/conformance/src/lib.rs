//! A conformance kit for both protocols: it tests drives and hosts against the documents.
//!
//! | to | use |
//! |---|---|
//! | test an ST drive | [`st::Harness`], [`st::suite`], [`run`] |
//! | test an RMD motor | [`rmd::Harness`], [`rmd::suite`], [`run`] |
//! | test a host with drives that misbehave | the scenarios of [`host`] |
//! | list the demands of a document | [`st::CLAUSES`], [`rmd::CLAUSES`] |
//! | permit motion, ROM writes, faults | [`Need`] in the harness's options, your [`World`] |
//! | read and print results | [`Report`] |
//!
//! A [`Clause`] is one demand of a document, with an id. A [`Case`] is one test of a drive; it
//! names its clauses. A case uses a link: a real port, or a simulated drive on virtual time. So the
//! same cases test a real drive and, in milliseconds, this kit itself.
//!
//! Where a document is unclear or contradicts itself, a case demands our [`Reading`] of it. A drive
//! that differs from a reading has not failed, unless the caller asks for it with
//! [`Report::strict`].
//!
//! Cases restore all settings that they write. A case that may turn a motor, wears a ROM or needs a
//! power cycle declares the [`Need`]; it runs only if the user permits it.

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
