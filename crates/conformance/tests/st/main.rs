//! The kit against simulated ST drives on virtual time: those that are right, and those that are not.

mod clauses;
mod mutants;
mod peer;
mod readings;
#[path = "../shared/mod.rs"]
mod shared;
mod slow;
mod suite;
