//! Reading again and again at instants that do not drift, without the interpreter.

use std::time::{Duration, Instant};

use motorlink::{Clock, LOOK};
use motorlink_proto::time;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::invalid_value;
use crate::number::span;

/// More rows than this need more memory than a machine has.
const MOST: f64 = 1e8;

/// When to sample.
pub(crate) struct Plan {
    period: Duration,
    instants: u64,
}

impl Plan {
    /// `rate` instants a second, from the first one for `seconds`; `None`: without end.
    pub(crate) fn new(py: Python<'_>, rate: f64, seconds: Option<f64>) -> PyResult<Self> {
        let period = span(py, "a time between samples", 1.0 / rate)?;
        let Some(seconds) = seconds else {
            return Ok(Plan { period, instants: u64::MAX });
        };
        let instants = (span(py, "a time", seconds)?.as_secs_f64() * rate + 1e-6).floor().max(1.0);
        if instants > MOST {
            return Err(invalid_value(py, format_args!("{instants} samples are too many at once")));
        }
        Ok(Plan { period, instants: instants as u64 })
    }
}

/// Rows, instant by instant. A row is a time in s and values of eight bytes, as NumPy reads them.
pub(crate) struct Rows {
    plan: Plan,
    /// The time of the first instant.
    began: Option<Duration>,
    /// The instant after the current one.
    next: u64,
    /// Time from the first instant to the first request of the current row, s.
    time: f64,
    /// The instant after that of the last row.
    expected: u64,
    taken: Taken,
}

/// Rows that were not taken before.
#[derive(Default)]
pub(crate) struct Taken {
    bytes: Vec<u8>,
    rows: u64,
    /// Instants before or between these rows that have none.
    skipped: u64,
}

impl Taken {
    /// The rows and the skipped instants, for Python.
    pub(crate) fn into_python(self, py: Python<'_>) -> (Bound<'_, PyByteArray>, u64) {
        (PyByteArray::new(py, &self.bytes), self.skipped)
    }
}

impl Rows {
    pub(crate) fn new(plan: Plan) -> Self {
        Rows { plan, began: None, next: 0, time: 0.0, expected: 0, taken: Taken::default() }
    }

    /// How long to wait at this time; zero begins a row, and `None` is the end. The first call is the
    /// first instant. An instant whose period has passed is skipped.
    fn after(&mut self, now: Duration) -> Option<Duration> {
        let since = now.saturating_sub(*self.began.get_or_insert(now));
        let (passed, period) = (since.as_nanos(), self.plan.period.as_nanos());
        let due = period * u128::from(self.next);
        if self.next < self.plan.instants && passed < due {
            return Some(Duration::from_nanos(u64::try_from(due - passed).unwrap_or(u64::MAX)));
        }
        let current = u64::try_from(passed / period).unwrap_or(u64::MAX).max(self.next);
        self.next = current.saturating_add(1);
        self.time = since.as_secs_f64();
        (current < self.plan.instants).then_some(Duration::ZERO)
    }

    /// As [`after`](Self::after) for an event loop, in s.
    pub(crate) fn after_seconds(&mut self, py: Python<'_>, now: f64) -> PyResult<Option<f64>> {
        let now = Duration::try_from_secs_f64(now)
            .map_err(|_| invalid_value(py, format_args!("{now} s is not a time of a clock")))?;
        Ok(self.after(now).map(|wait| wait.as_secs_f64()))
    }

    /// Ends the current row.
    pub(crate) fn push(&mut self, values: &[[u8; 8]]) {
        self.taken.bytes.extend_from_slice(&self.time.to_ne_bytes());
        self.taken.bytes.extend_from_slice(values.as_flattened());
        self.taken.rows += 1;
        self.taken.skipped += self.next - 1 - self.expected;
        self.expected = self.next;
    }

    /// The rows since the last call.
    pub(crate) fn take(&mut self) -> Taken {
        std::mem::take(&mut self.taken)
    }

    /// Calls `row` at each instant, until the end or until there are `most` rows. `look` is called now
    /// and then; an error of it ends the sampling.
    pub(crate) fn run(
        &mut self,
        clock: &Clock,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        most: Option<u64>,
        mut row: impl FnMut(&mut Self) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut looked = Instant::now();
        while most != Some(self.taken.rows) {
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                Python::attach(|py| py.check_signals().and_then(|()| look(py)))?;
            }
            match self.after(clock.now().since(time::Instant(0)).into()) {
                None => break,
                Some(Duration::ZERO) => row(self)?,
                Some(wait) => pass(clock, wait.min(LOOK)),
            }
        }
        Ok(())
    }
}

/// Waits by a port's clock; a signal's handler may raise an exception.
pub(crate) fn pause(py: Python<'_>, clock: &Clock, seconds: f64) -> PyResult<()> {
    let wait = span(py, "a time", seconds)?;
    py.detach(|| pass(clock, wait));
    py.check_signals()
}

/// A time of a clock that counts s.
pub(crate) fn instant(now: f64) -> time::Instant {
    time::Instant((now * 1e6).ceil() as u64)
}

/// A span in s.
pub(crate) fn seconds(span: time::Micros) -> f64 {
    Duration::from(span).as_secs_f64()
}

/// Lets time pass.
fn pass(clock: &Clock, span: Duration) {
    // A part of a microsecond is one: virtual time would never pass it.
    let micros = span.as_nanos().div_ceil(1000);
    clock.wait(clock.now() + time::Micros(micros.try_into().unwrap_or(u64::MAX)));
}

/// A value of a row: a float, or an integer where digits are wanted.
pub(crate) fn cell(raw: bool, digits: i64, value: f64) -> [u8; 8] {
    if raw { digits.to_ne_bytes() } else { value.to_ne_bytes() }
}
