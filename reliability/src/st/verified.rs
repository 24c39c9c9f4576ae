//! Plain writes compared with verified ones: the reported result, and the register's value.

use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::st::{
    ExchangeError, RegisterId, Request, Unverified, VERIFY_ATTEMPTS, VerifiedWrite,
};

use super::bench::{self, Setup, StRun};
use super::drive::MOTORS;
use super::traffic::{self, Ask, SETTINGS};
use crate::tally::Violation;

/// The results of writes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Writes {
    pub writes: u64,
    /// Number of writes reported as done.
    pub done: u64,
    /// Number of writes reported as done while the register has another value.
    pub wrong: u64,
    /// Number of writes that changed another register, with any result.
    pub beside: u64,
}

impl Writes {
    pub fn add(&mut self, other: &Writes) {
        self.writes += other.writes;
        self.done += other.done;
        self.wrong += other.wrong;
        self.beside += other.beside;
    }
}

/// Writes `count` random values to settings. If `verified`, each register is read back and the
/// write is repeated.
pub fn run(setup: Setup, faults: &Faults, verified: bool, count: u64) -> Result<Writes, Violation> {
    let mut bench = bench::bench(setup, faults, false);
    let mut rng = Rng::with_seed(faults.seed ^ 0x5EED);
    let mut writes = Writes { writes: count, ..Writes::default() };
    for exchange in 0..count {
        let motor = rng.u8(1..=MOTORS);
        let register = SETTINGS[rng.usize(..SETTINGS.len())];
        let shape = register.shape().expect("a setting is in the table");
        let value = shape.ty(setup.profile).fit(rng.i32(..));
        let mut expected = bench.ends.drive.banks;
        expected[usize::from(motor - 1)][usize::from(register.0)] = value;
        let done = if verified {
            write_verified(&mut bench, setup, motor, register, value)
        } else {
            bench.exchange(&traffic::write(motor, setup.profile, register, value)).is_ok()
        };
        if let Some(what) = bench.violation.take() {
            return Err(Violation { exchange, what, trace: Vec::new() });
        }
        let kept = bench.ends.drive.banks[usize::from(motor - 1)][usize::from(register.0)];
        writes.done += u64::from(done);
        writes.wrong += u64::from(done && kept != value);
        expected[usize::from(motor - 1)][usize::from(register.0)] = kept;
        writes.beside += u64::from(expected != bench.ends.drive.banks);
    }
    Ok(writes)
}

fn write_verified(
    bench: &mut StRun,
    setup: Setup,
    motor: u8,
    register: RegisterId,
    value: i32,
) -> bool {
    let write = VerifiedWrite::new::<ExchangeError>(setup.profile, register, value);
    let exchange = |request: &Request<'_>| {
        let payload = bench.exchange(&Ask::of(motor, request))?;
        Ok(register.decode(setup.profile, payload))
    };
    let is_final = |error: &ExchangeError| matches!(error, ExchangeError::Refused(_));
    let result: Result<u8, Unverified<ExchangeError>> =
        write.and_then(|write| write.run(VERIFY_ATTEMPTS, exchange, is_final));
    result.is_ok()
}
