//! Reading again and again at instants that do not drift, without the interpreter.

use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::clock::Clock;
use crate::error::bad_value;
use crate::number::span;

/// How often a program's other wishes are looked for.
const LOOK: Duration = Duration::from_millis(50);
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
            return Err(bad_value(py, format_args!("{instants} samples are too many at once")));
        }
        Ok(Plan { period, instants: instants as u32 })
    }

    /// Calls `take` at each instant with the time since the first one, s. An instant whose period
    /// has passed before `take` came back is left out. `look` is called now and then; an error of it
    /// ends the sampling.
    pub(crate) fn run(
        &self,
        clock: &dyn Clock,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        mut take: impl FnMut(f64) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut looked = Instant::now();
        let began = clock.now();
        let mut next = 0;
        while next < self.instants {
            let since = clock.now() - began;
            let due = self.period * next;
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                Python::attach(|py| py.check_signals().and_then(|()| look(py)))?;
            }
            if since < due {
                clock.pass((due - since).min(LOOK));
                continue;
            }
            let current = since.as_nanos() / self.period.as_nanos();
            next = u32::try_from(current).unwrap_or(u32::MAX).max(next);
            if next < self.instants {
                take(since.as_secs_f64())?;
            }
            next = next.saturating_add(1);
        }
        Ok(())
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
