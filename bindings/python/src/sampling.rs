//! Reading again and again at instants that do not drift, without the interpreter.

use std::time::{Duration, Instant};

use motorlink::{Clock, LOOK};
use motorlink_proto::time;
use pyo3::prelude::*;

use crate::error::invalid_value;
use crate::number::span;

/// Rows beyond which something must be wrong with the arguments.
const MOST: f64 = 1e8;

/// When to sample.
pub(crate) struct Plan {
    period: Duration,
    instants: u32,
}

impl Plan {
    /// `rate` times a second, from the first instant on for `seconds`.
    pub(crate) fn new(py: Python<'_>, rate: f64, seconds: f64) -> PyResult<Self> {
        let period = span(py, "a time between samples", 1.0 / rate)?;
        let instants = (span(py, "a time", seconds)?.as_secs_f64() * rate + 1e-6).floor().max(1.0);
        if instants > MOST {
            return Err(invalid_value(py, format_args!("{instants} samples are too many at once")));
        }
        Ok(Plan { period, instants: instants as u32 })
    }

    /// Calls `take` at each instant with the time since the first one, s. `look` is called now and then;
    /// an error of it ends the sampling.
    pub(crate) fn run(
        self,
        clock: &Clock,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        mut take: impl FnMut(f64) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut instants = Instants::new(self);
        let mut looked = Instant::now();
        let began = clock.now();
        loop {
            let since = Duration::from(clock.now().since(began));
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                Python::attach(|py| py.check_signals().and_then(|()| look(py)))?;
            }
            match instants.after(since) {
                None => return Ok(()),
                Some(Duration::ZERO) => take(since.as_secs_f64())?,
                Some(wait) => pass(clock, wait.min(LOOK)),
            }
        }
    }
}

/// Lets time pass.
fn pass(clock: &Clock, span: Duration) {
    // A part of a microsecond is one: virtual time would never pass it.
    let micros = span.as_nanos().div_ceil(1000);
    clock.wait(clock.now() + time::Micros(micros.try_into().unwrap_or(u64::MAX)));
}

/// The instants of a plan, one after the other. One whose period has passed is left out.
struct Instants {
    plan: Plan,
    next: u32,
}

impl Instants {
    fn new(plan: Plan) -> Self {
        Instants { plan, next: 0 }
    }

    /// How long to wait at this time since the first instant; nothing of it is an instant, and `None`
    /// is the end.
    fn after(&mut self, since: Duration) -> Option<Duration> {
        let Plan { period, instants } = self.plan;
        let due = period * self.next;
        if self.next < instants && since < due {
            return Some(due - since);
        }
        let current = since.as_nanos() / period.as_nanos();
        let current = u32::try_from(current).unwrap_or(u32::MAX).max(self.next);
        self.next = current.saturating_add(1);
        (current < instants).then_some(Duration::ZERO)
    }
}

/// A sampling by an event loop: instants, and rows that are taken step by step.
pub(crate) struct Stepped {
    instants: Instants,
    /// When the row's first request left.
    time: f64,
    pub(crate) rows: Rows,
}

impl Stepped {
    pub(crate) fn new(plan: Plan) -> Self {
        Stepped { instants: Instants::new(plan), time: 0.0, rows: Rows::default() }
    }

    /// As [`Instants::after`], in s; a row begins where that is 0.
    pub(crate) fn after(&mut self, py: Python<'_>, since: f64) -> PyResult<Option<f64>> {
        let passed = Duration::try_from_secs_f64(since).map_err(|_| {
            invalid_value(py, format_args!("{since} s is no time since the first instant"))
        })?;
        self.time = since;
        Ok(self.instants.after(passed).map(|wait| wait.as_secs_f64()))
    }

    /// Ends the row.
    pub(crate) fn push(&mut self, values: &[[u8; 8]]) {
        self.rows.push(self.time, values);
    }
}

/// Rows of a time in s and values of eight bytes, as NumPy reads them.
#[derive(Default)]
pub(crate) struct Rows(pub(crate) Vec<u8>);

impl Rows {
    pub(crate) fn push(&mut self, time: f64, values: &[[u8; 8]]) {
        self.0.extend_from_slice(&time.to_ne_bytes());
        values.iter().for_each(|value| self.0.extend_from_slice(value));
    }
}

/// A value of a row: a float, or an integer where digits are wanted.
pub(crate) fn cell(raw: bool, digits: i64, value: f64) -> [u8; 8] {
    if raw { digits.to_ne_bytes() } else { value.to_ne_bytes() }
}
