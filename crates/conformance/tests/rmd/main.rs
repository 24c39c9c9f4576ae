//! Tests of the kit for RMD motors, with simulated motors.

mod clauses;
mod conditions;
mod drive;
mod mutants;
mod readings;
#[path = "../shared/mod.rs"]
mod shared;
mod suite;
