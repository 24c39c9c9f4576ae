//! Sampling: rows from the engine of a line, whose exchanges the client of the program carries out.

use std::time::{Duration, Instant};

use motorlink::{Clock, LOOK};
use motorlink_proto::time;
use motorlink_proto::time::Micros;
use motorlink_proto::units::Scale;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{Line, LineError};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Absent, Gap, Item, Row, Rows, Trouble};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Subscription};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::invalid_value;
use crate::number::span;

/// More rows than this need more memory than a machine has.
const MOST: f64 = 1e8;
/// Rows that a program reads one by one are confirmed at least this often, so that they are new.
const LIVE: Micros = Micros::from_millis(10);

/// If other users of a line lose it again and again, so that no row is confirmed for this time, it is an
/// error.
const UNCONFIRMED: Micros = Micros::from_millis(1_000);

/// When to sample.
pub(crate) struct Plan {
    period: Micros,
    instants: u64,
}

/// The time between two of `rate` instants a second.
pub(crate) fn period(py: Python<'_>, rate: f64) -> PyResult<Micros> {
    let period = span(py, "a time between samples", 1.0 / rate)?.as_secs_f64() * 1e6;
    Ok(Micros((period.round() as u64).max(1)))
}

impl Plan {
    /// `rate` instants a second, from the first one for `seconds`; `None`: without end.
    pub(crate) fn new(py: Python<'_>, rate: f64, seconds: Option<f64>) -> PyResult<Self> {
        let period = period(py, rate)?;
        let Some(seconds) = seconds else {
            return Ok(Plan { period, instants: u64::MAX });
        };
        let instants = (span(py, "a time", seconds)?.as_secs_f64() * rate + 1e-6).floor().max(1.0);
        if instants > MOST {
            return Err(invalid_value(py, format_args!("{instants} samples are too many at once")));
        }
        Ok(Plan { period, instants: instants as u64 })
    }

    /// When the instants are over that began with this one.
    fn end(&self, first: time::Instant) -> time::Instant {
        first + Micros(self.period.0.saturating_mul(self.instants))
    }
}

/// A value of a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    pub(crate) signal: Signal,
    /// The scale of the value, if it is not that of the signal.
    pub(crate) scale: Option<Scale>,
}

impl Column {
    fn cell(&self, raw: bool, value: &Result<Sample, Absent>) -> Result<[u8; 8], Absent> {
        match value {
            Ok(sample) if raw => Ok(sample.digits.to_ne_bytes()),
            Ok(sample) => {
                let scaled = self.scale.map(|scale| scale.value(sample.digits));
                Ok(scaled.unwrap_or(sample.value).to_ne_bytes())
            }
            // Digits are what was read, in any profile.
            Err(Absent::Implausible(why)) if raw => Ok(why.read.digits().to_ne_bytes()),
            Err(absent) => Err(absent.clone()),
        }
    }
}

/// Why there are no more rows.
pub(crate) enum Ending {
    /// An exchange failed.
    Failed(LineError),
    /// The values of a motor cannot be confirmed.
    Doubtful(Motor),
    /// A signal has no value.
    Absent(Signal, Absent),
}

/// What to do next.
pub(crate) enum Next {
    /// Carry out the exchanges of the relay.
    CarryOut,
    /// Nothing for this time.
    Wait(Duration),
    /// There are as many rows as were asked for, or no more come.
    Enough,
}

/// Rows that were not taken before. A row is a time in s and values of eight bytes, as NumPy reads
/// them.
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

/// A sampling without its line.
pub(crate) struct Sampler {
    plan: Plan,
    columns: Vec<Column>,
    raw: bool,
    reading: Option<Reading>,
    taken: Taken,
    /// Why the next gap is there.
    doubt: Option<LineError>,
    /// Since when rows are left out without an error.
    gap: Option<time::Instant>,
}

/// The engine, once the first row was asked for.
struct Reading {
    engine: Acquisition,
    subscription: Subscription,
    rows: Rows,
    first: Option<time::Instant>,
    /// The number of the instant after that of the last row.
    expected: u64,
    /// When the last call ended.
    left: Option<time::Instant>,
    /// The time between the calls since the line was read last.
    idle: Micros,
    /// Rows that were read before this are old.
    fresh: time::Instant,
}

impl Sampler {
    pub(crate) fn new(plan: Plan, columns: Vec<Column>, raw: bool) -> Self {
        let taken = Taken::default();
        Sampler { plan, columns, raw, reading: None, taken, doubt: None, gap: None }
    }

    /// Begins to read `most` rows, or all. The first call begins the sampling, on the line that `line`
    /// gives. A later call, also after a pause, continues with new values.
    pub(crate) fn begin(&mut self, most: Option<u64>, line: impl FnOnce() -> Box<dyn Line>) {
        let period = self.plan.period;
        let Some(reading) = &mut self.reading else {
            let signals: Vec<_> = self.columns.iter().map(|column| column.signal).collect();
            let mut engine = Acquisition::new(line());
            if most.is_some() {
                engine.confirm_every(LIVE);
            }
            // Nothing is dropped: the records are taken after each step.
            let subscription = Subscription::new(usize::MAX, Full::DropNewest);
            let wants: Wants = signals.iter().map(|signal| (*signal, period)).collect();
            engine.subscribe(subscription.clone(), wants);
            let rows = Rows::new(signals);
            self.reading = Some(Reading {
                engine,
                subscription,
                rows,
                first: None,
                expected: 0,
                left: None,
                idle: Micros(0),
                fresh: time::Instant(0),
            });
            return;
        };
        let now = reading.engine.clock().now();
        let pause = reading.left.map_or(Micros(0), |left| now.since(left));
        reading.engine.give_up_polls();
        reading.idle = Micros(reading.idle.0 + pause.0);
        if reading.idle >= period.max(LIVE) {
            reading.fresh = now;
        }
    }

    /// Says why the next gap is there, more exactly than the engine does.
    pub(crate) fn doubt(&mut self, error: LineError) {
        self.doubt = Some(error);
    }

    /// A signal handler used the client, so that what was pending was given up. The rows before cannot be
    /// confirmed.
    pub(crate) fn gave_up(&mut self) {
        if let Some(reading) = &mut self.reading {
            reading.engine.give_up_polls();
        }
    }

    /// Ends a call: the rows since the last one.
    pub(crate) fn take(&mut self) -> Taken {
        if let Some(reading) = &mut self.reading {
            reading.left = Some(reading.engine.clock().now());
        }
        std::mem::take(&mut self.taken)
    }

    /// One step towards `most` rows, or all. With `skip` a line that fails costs only rows.
    /// `is_pending` says whether the relay has exchanges.
    pub(crate) fn next(
        &mut self,
        most: Option<u64>,
        skip: bool,
        is_pending: impl Fn() -> bool,
    ) -> Result<Next, Ending> {
        if self.give(most, skip)? {
            return Ok(Next::Enough);
        }
        let Some(reading) = &mut self.reading else { return Ok(Next::Enough) };
        reading.idle = Micros(0);
        let wait = reading.engine.advance(&mut |_, _| {});
        while let Some(record) = reading.subscription.take() {
            reading.rows.take(&record);
        }
        if self.give(most, skip)? {
            return Ok(Next::Enough);
        }
        if is_pending() {
            return Ok(Next::CarryOut);
        }
        let Some(reading) = &mut self.reading else { return Ok(Next::Enough) };
        let (now, first) = (reading.engine.clock().now(), reading.engine.first_instant());
        let end = self.plan.end(first.unwrap_or(now));
        if now < end {
            let left: Duration = end.since(now).into();
            return Ok(Next::Wait(wait.map_or(left, |wait| wait.min(left))));
        }
        if !reading.rows.is_pending_before(end) {
            return Ok(Next::Enough);
        }
        // The next instant confirms the last rows.
        reading.engine.confirm_every(Micros(0));
        Ok(Next::Wait(wait.unwrap_or_default()))
    }

    /// Takes rows that are known; whether they are enough.
    fn give(&mut self, most: Option<u64>, skip: bool) -> Result<bool, Ending> {
        while most != Some(self.taken.rows) {
            let Some(reading) = &mut self.reading else { return Ok(true) };
            if reading.expected >= self.plan.instants {
                return Ok(true);
            }
            match reading.rows.next_item() {
                Some(Item::Row(row)) => self.push(&row)?,
                Some(Item::Gap(gap)) => self.gap(gap, skip)?,
                Some(Item::Lost(_)) => {}
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    fn push(&mut self, row: &Row) -> Result<(), Ending> {
        let Some(reading) = &mut self.reading else { return Ok(()) };
        let first = reading.engine.first_instant().unwrap_or(row.instant);
        let first = *reading.first.get_or_insert(first.min(row.instant));
        // On a slow line instants are rarer than asked. There is one row at most for each that was asked.
        // A data segment is configured at the first instant, which may take longer than a period.
        let number = match row.instant > first {
            true => row.requested.since(first).0 / self.plan.period.0,
            false => 0,
        };
        if row.requested < reading.fresh || number < reading.expected {
            return Ok(());
        }
        let skipped = number - reading.expected;
        reading.expected = number + 1;
        if number >= self.plan.instants {
            return Ok(());
        }
        let mut cells = Vec::with_capacity(row.values.len());
        for (column, value) in self.columns.iter().zip(&row.values) {
            let cell = column.cell(self.raw, value);
            cells.push(cell.map_err(|absent| Ending::Absent(column.signal, absent))?);
        }
        // The first instant is when the request of its row was sent.
        let since = if number == 0 { Micros(0) } else { row.requested.since(first) };
        self.taken.bytes.extend_from_slice(&seconds(since).to_ne_bytes());
        self.taken.bytes.extend_from_slice(cells.as_flattened());
        self.taken.rows += 1;
        self.gap = None;
        self.taken.skipped += skipped;
        Ok(())
    }

    fn gap(&mut self, gap: Gap, skip: bool) -> Result<(), Ending> {
        let error = match (self.doubt.take(), gap.why) {
            (Some(error), _) => error,
            (None, Trouble::Failed(error)) => (*error).clone(),
            // Another user of the line has lost it.
            (None, Trouble::Doubtful(motor)) => {
                let since = *self.gap.get_or_insert(gap.time);
                return match !skip && gap.time.since(since) >= UNCONFIRMED {
                    true => Err(Ending::Doubtful(motor)),
                    false => Ok(()),
                };
            }
        };
        match skip && error.is_line_failure() {
            true => Ok(()),
            false => Err(Ending::Failed(error)),
        }
    }
}

/// Takes steps until there are enough rows, and carries their exchanges out. `look` is called now and
/// then; an error of it ends the sampling.
pub(crate) fn run(
    clock: &Clock,
    look: impl Fn(Python<'_>) -> PyResult<()>,
    mut step: impl FnMut() -> PyResult<Next>,
    mut carry_out: impl FnMut() -> PyResult<()>,
) -> PyResult<()> {
    let mut looked = Instant::now();
    loop {
        if looked.elapsed() >= LOOK {
            looked = Instant::now();
            Python::attach(|py| py.check_signals().and_then(|()| look(py)))?;
        }
        match step()? {
            Next::Enough => return Ok(()),
            Next::CarryOut => carry_out()?,
            Next::Wait(wait) => pass(clock, wait.min(LOOK)),
        }
    }
}

/// The wait of a step for an event loop, s; 0: there are exchanges to carry out, `None`: enough.
pub(crate) fn wait_seconds(next: &Next) -> Option<f64> {
    match next {
        Next::CarryOut => Some(0.0),
        // Never zero, which would be an exchange to carry out.
        Next::Wait(wait) => Some(wait.as_secs_f64().max(1e-6)),
        Next::Enough => None,
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
