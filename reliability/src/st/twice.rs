//! Programs that read four registers on lines with duplicate replies, like `motorlink st get A B C
//! D`.

use std::iter::Sum;

use motorlink::time::Micros;
use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::st::{RegisterId, Request, question_behind};

use super::bench::{self, Setup, StRun};
use super::traffic::Ask;
use crate::life::Life;
use crate::plan::SPEC;

/// Values of one, two and four bytes.
const READ: [RegisterId; 6] = [
    RegisterId::STATUS,
    RegisterId::BUS_VOLTAGE,
    RegisterId::TORQUE_MEAS,
    RegisterId::SPEED_KP,
    RegisterId::SPEED_MEAS,
    RegisterId::FLAGS,
];

/// The results of the reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Batches {
    pub count: u64,
    /// Number of failed reads or confirmations.
    pub detected: u64,
    /// Number of values that belong to another register, without a failure.
    pub wrong: u64,
}

impl Sum for Batches {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Batches::default(), |sum, part| Batches {
            count: sum.count + part.count,
            detected: sum.detected + part.detected,
            wrong: sum.wrong + part.wrong,
        })
    }
}

/// Reads four registers `count` times, each time with a new program, on a line with `faults`.
/// `share` is the fraction of duplicate replies. `confirms` is whether each value is confirmed.
pub fn run(share: f64, faults: &Faults, confirms: bool, count: u64) -> Batches {
    let setup = Setup { life: Life::Short, ..SPEC };
    let mut bench = bench::bench(setup, faults, true);
    bench.repeat(share, faults.seed);
    let mut rng = Rng::with_seed(faults.seed ^ 0x5EED);
    let mut batches = Batches { count, ..Batches::default() };
    for _ in 0..count {
        bench.rest(Micros(rng.u64(..50_000)));
        bench.next_program();
        let (mut is_wrong, mut turn) = (false, false);
        let is_read = (0..4).all(|_| {
            let register = READ[rng.usize(..READ.len())];
            let value = bench.ends.drive.banks[0][usize::from(register.0)].to_le_bytes();
            let reply = bench.exchange(&Ask::of(1, &Request::GetRegister(register)));
            let size = reply.as_ref().ok().map(|payload| payload.len());
            is_wrong |= reply.is_ok_and(|payload| !value.starts_with(payload));
            turn = !turn;
            size.is_some() && (!confirms || confirm(&mut bench, size, turn))
        });
        batches.detected += u64::from(!is_read);
        batches.wrong += u64::from(is_read && is_wrong);
    }
    batches
}

/// Like `Client::confirm`.
fn confirm(bench: &mut StRun, last: Option<usize>, turn: bool) -> bool {
    let (question, size) = question_behind(last, turn);
    let answer = bench.exchange(&Ask::of(0, &question));
    answer.is_ok_and(|payload| payload.len() == size)
}
