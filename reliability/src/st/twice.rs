//! Programs that read four registers where replies come twice, as `motorlink st get A B C D` does.

use std::iter::Sum;

use motorlink::fault::{Faults, Rng};
use motorlink::time::Duration;
use motorlink_proto::stmcp::{Profile, Recovery, RegisterId, Request, question_behind};

use super::bench::{Bench, Setup};
use super::traffic::Ask;
use crate::plan::Life;

/// Values of one, two and four bytes.
const READ: [RegisterId; 6] = [
    RegisterId::STATUS,
    RegisterId::BUS_VOLTAGE,
    RegisterId::TORQUE_MEAS,
    RegisterId::SPEED_KP,
    RegisterId::SPEED_MEAS,
    RegisterId::FLAGS,
];

/// What became of the reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Batches {
    pub count: u64,
    /// A read or the confirmation behind it failed.
    pub detected: u64,
    /// A value was another register's, and no read failed.
    pub wrong: u64,
    /// Of those, the confirmation did not fail.
    pub slipped: u64,
}

impl Sum for Batches {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Batches::default(), |sum, part| Batches {
            count: sum.count + part.count,
            detected: sum.detected + part.detected,
            wrong: sum.wrong + part.wrong,
            slipped: sum.slipped + part.slipped,
        })
    }
}

pub fn run(share: f64, count: u64, seed: u64) -> Batches {
    let setup = Setup { profile: Profile::Spec, recovery: Recovery::Drain, life: Life::Short };
    let mut bench = Bench::new(setup, &Faults { seed, ..Faults::NONE }, true);
    bench.repeat(share, seed);
    let mut rng = Rng::with_seed(seed ^ 0x5EED);
    let mut batches = Batches { count, ..Batches::default() };
    for _ in 0..count {
        bench.rest(Duration(rng.u64(..50_000)));
        bench.next_program();
        let before = bench.tally.misplaced;
        let mut last = None;
        let is_read = (0..4).all(|_| {
            let register = READ[rng.usize(..READ.len())];
            let reply = bench.exchange(&Ask::of(1, &Request::GetRegister(register)));
            last = reply.as_ref().ok().map(|payload| payload.len());
            reply.is_ok()
        });
        let is_wrong = is_read && bench.tally.misplaced > before;
        let (register, size) = question_behind(last);
        let answer = bench.exchange(&Ask::of(0, &Request::GetRegister(register)));
        let is_confirmed = answer.is_ok_and(|payload| payload.len() == size);
        batches.detected += u64::from(!is_read || !is_confirmed);
        batches.wrong += u64::from(is_wrong);
        batches.slipped += u64::from(is_wrong && is_confirmed);
    }
    batches
}
