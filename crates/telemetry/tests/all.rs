//! One program of the tests that need none of their own: each more has to be linked.

mod acquisition;
mod drives;
mod engine;
mod got;
mod lossy;
mod recovery;
mod refused;
mod relayed;
mod runner;
mod saturated;
mod schedule;
