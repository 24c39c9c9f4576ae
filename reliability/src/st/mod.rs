//! ST's Motor Control Protocol.

mod bench;
mod drive;
pub mod theory;
mod traffic;
pub mod twice;
pub mod verified;

use motorlink::time::Duration;
use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::st::Error;

use bench::Bench;
pub use bench::Setup;

use crate::life::Life;
use crate::tally::{Tally, Trouble, Violation};

/// Runs `count` exchanges of the mix. Those from `traced` on are written down in a violation.
pub fn run(
    setup: Setup,
    faults: &Faults,
    beyond: bool,
    count: u64,
    traced: u64,
) -> Result<Tally, Violation> {
    let mut bench = Bench::new(setup, faults, beyond);
    let mut rng = Rng::with_seed(faults.seed ^ 0x5EED);
    let mut trouble = Trouble::default();
    for exchange in 0..count {
        if exchange == traced {
            bench.trace();
        }
        if setup.life == Life::Short && rng.bool() {
            if rng.bool() {
                let killed = traffic::next(setup.profile, &mut rng);
                bench.killed_in(&killed, Duration(rng.u64(..1_500_000)));
            }
            bench.rest(Duration(rng.u64(..50_000)));
            bench.next_program();
        }
        let ask = traffic::next(setup.profile, &mut rng);
        let failed = matches!(bench.exchange(&ask), Err(Error::Failed(_)));
        let now = bench.now;
        trouble.note(&mut bench.tally, now, failed);
        if let Some(what) = bench.violation.take() {
            return Err(Violation { exchange, what, trace: bench.traced() });
        }
        // Most programs ask at once; some pause for shorter or longer than any silence.
        match rng.u8(..10) {
            0 => bench.rest(Duration(rng.u64(..60_000))),
            1 | 2 => bench.rest(Duration(rng.u64(..5_000))),
            _ => {}
        }
    }
    let mut tally = bench.tally;
    tally.exchanges = count;
    Ok(tally)
}

/// How many damaged messages the checksum should have let through.
pub fn expected(setup: Setup, faults: &Faults, tally: &Tally) -> f64 {
    if (Faults { flip: 0.0, ..*faults }) != Faults::NONE {
        return tally.judged as f64 / 256.0;
    }
    let (request, reply) = theory::undetected(setup.profile, faults.flip);
    tally.requests as f64 * request + tally.answers as f64 * reply
}
