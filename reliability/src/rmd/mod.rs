//! The RMD protocol over CAN.

mod bench;
mod motor;
mod traffic;

use motorlink_link::fault::Faults;

use crate::life::Life;
use crate::tally::{Tally, Violation};

/// Runs at least `count` exchanges of the mix, with at most one open exchange for each of four
/// motors. From exchange `traced` on, they are recorded for a violation.
pub fn run(
    life: Life,
    faults: &Faults,
    beyond: bool,
    count: u64,
    traced: u64,
) -> Result<Tally, Violation> {
    bench::bench(faults, beyond).run(life, faults.seed, count, traced)
}

/// The expected number of damaged messages that are accepted: those with a wrong bit outside the
/// command code.
pub fn expected(faults: &Faults, tally: &Tally) -> f64 {
    let right = |bits| (1.0 - faults.corrupt).powi(bits);
    (tally.requests + tally.answers) as f64 * right(8) * (1.0 - right(56))
}
