//! The RMD protocol over CAN.

mod bench;
mod motor;
mod traffic;

use motorlink::time::Duration;
use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::rmd::MotorId;

use bench::{Bench, MOTORS};

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
    let mut bench = Bench::new(faults, beyond);
    let mut rng = Rng::with_seed(faults.seed ^ 0x5EED);
    while bench.exchanges < count {
        let exchange = bench.exchanges;
        if exchange >= traced {
            bench.trace();
        }
        if life == Life::Short && rng.bool() {
            if rng.bool() {
                let id = MotorId::new(rng.u8(1..=MOTORS as u8)).expect("1 to 4");
                bench.killed_in(id, traffic::next(&mut rng), Duration(rng.u64(..300_000)));
            }
            bench.rest(Duration(rng.u64(..50_000)));
            bench.next_program();
        }
        match rng.u8(..10) {
            0 => bench.set_torque4(traffic::torques(&mut rng)),
            1..4 => bench.cycle(std::array::from_fn(|_| traffic::next(&mut rng))),
            _ => {
                let id = MotorId::new(rng.u8(1..=MOTORS as u8)).expect("1 to 4");
                bench.ask(id, traffic::next(&mut rng));
            }
        }
        if let Some(what) = bench.violation.take() {
            return Err(Violation { exchange, what, trace: bench.traced() });
        }
        // Most programs ask at once; some pause for shorter or longer than any timeout.
        match rng.u8(..10) {
            0 => bench.rest(Duration(rng.u64(..200_000))),
            1 | 2 => bench.rest(Duration(rng.u64(..2_000))),
            _ => {}
        }
    }
    let mut tally = bench.tally;
    tally.exchanges = bench.exchanges;
    Ok(tally)
}

/// How many damaged messages should have passed: those with a wrong bit, though none in the command
/// code.
pub fn expected(faults: &Faults, tally: &Tally) -> f64 {
    let right = |bits| (1.0 - faults.corrupt).powi(bits);
    (tally.requests + tally.answers) as f64 * right(8) * (1.0 - right(56))
}
