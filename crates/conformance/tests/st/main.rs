//! Tests of the kit with simulated ST drives on virtual time, with and without deviations.

mod clauses;
mod mutants;
mod peer;
mod readings;
#[path = "../shared/mod.rs"]
mod shared;
mod slow;
mod suite;
mod words;
