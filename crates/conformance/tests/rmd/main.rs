//! The kit for RMD motors, tested on simulated ones.

mod clauses;
mod conditions;
mod drive;
mod mutants;
mod readings;
#[path = "../shared/mod.rs"]
mod shared;
mod suite;
