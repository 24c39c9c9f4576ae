//! The RMD protocol over CAN.

mod bench;
mod motor;
mod traffic;

use motorlink_link::fault::Faults;

use crate::life::Life;
use crate::tally::{Tally, Violation};

/// Runs at least `count` exchanges of the mix, one to each of four motors at most at a time. Those
/// from `traced` on are written down in a violation.
pub fn run(
    life: Life,
    faults: &Faults,
    beyond: bool,
    count: u64,
    traced: u64,
) -> Result<Tally, Violation> {
    bench::bench(faults, beyond).run(life, faults.seed, count, traced)
}

/// How many damaged messages should have passed: those with a wrong bit, though none in the command
/// code.
pub fn expected(faults: &Faults, tally: &Tally) -> f64 {
    let right = |bits| (1.0 - faults.corrupt).powi(bits);
    (tally.requests + tally.answers) as f64 * right(8) * (1.0 - right(56))
}
