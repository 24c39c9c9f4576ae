//! ST's Motor Control Protocol.

mod bench;
mod drive;
pub mod theory;
mod traffic;
pub mod twice;
pub mod verified;

use motorlink_link::fault::Faults;

pub use bench::Setup;

use crate::tally::{Tally, Violation};

/// Runs `count` exchanges of the mix. From exchange `traced` on, they are recorded for a violation.
pub fn run(
    setup: Setup,
    faults: &Faults,
    beyond: bool,
    count: u64,
    traced: u64,
) -> Result<Tally, Violation> {
    bench::bench(setup, faults, beyond).run(setup.life, faults.seed, count, traced)
}

/// The expected number of damaged messages that pass the checksum.
pub fn expected(setup: Setup, faults: &Faults, tally: &Tally) -> f64 {
    if (Faults { flip: 0.0, ..*faults }) != Faults::NONE {
        return tally.judged as f64 / 256.0;
    }
    let (request, reply) = theory::undetected(setup.profile, faults.flip);
    tally.requests as f64 * request + tally.answers as f64 * reply
}
