//! Sampling values of motors, all of them at the same instants.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink::rmd::{Asked, Client, Error, MotorId};
use motorlink::time::{self, Micros};
use motorlink_telemetry::line::{LineError, RmdLine, RmdOver, RmdRelay};
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::signal::{Motor, Quantity, Signal, Source};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use super::gear::gear;
use super::request::motor_id;
use crate::error::{invalid_value, line_error, rmd_error};
use crate::sampling::{self, Column, Ending, Next, Plan, Sampler, Taken, wait_seconds};

/// How a pending exchange ended.
pub(crate) struct Sampled {
    pub(crate) result: Result<[u8; 8], Error>,
    /// Whether the replies up to it went to their own requests, if it [`judges`] them.
    pub(crate) confirmed: Result<(), Error>,
    /// How often the client has lost the motor.
    pub(crate) losses: u32,
    /// When the request was sent.
    pub(crate) sent: time::Instant,
}

/// Whether the end of an exchange says something about the replies before it.
pub(crate) fn judges(asked: Asked, result: &Result<[u8; 8], Error>) -> bool {
    match result {
        Ok(_) => asked == Asked::Confirmation,
        Err(Error::Quarantined { .. }) => false,
        Err(_) => true,
    }
}

/// How long a motor in quarantine is waited for.
const PATIENCE: Micros = Micros::from_millis(2_000);
/// The time between two attempts to ask it. Other users of the bus have it in between.
const RETRY: Micros = Micros::from_millis(1);

/// A motor in quarantine, whose exchange stays pending.
#[derive(Debug, Clone, Copy)]
struct Rest {
    since: time::Instant,
    until: time::Instant,
}

/// A motor's ID, its quantities and its gear ratio.
pub(crate) type Wanted = (i64, Vec<String>, Option<f64>);

/// Rows of quantities. A blocking client calls [`RmdSampling::run`]. An event loop calls `next`, and
/// carries out what is pending.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdSampling {
    sampler: Mutex<Sampler>,
    relay: RmdRelay,
    resting: Mutex<BTreeMap<MotorId, Rest>>,
    port: Arc<str>,
    clock: Clock,
}

impl RmdSampling {
    /// Quantities of motors.
    pub(crate) fn new(
        py: Python<'_>,
        (port, clock): (&str, Clock),
        motors: Vec<Wanted>,
        plan: Plan,
        raw: bool,
    ) -> PyResult<Self> {
        let mut columns = Vec::new();
        for (id, names, gear_ratio) in motors {
            let (id, gear) = (motor_id(py, id)?, gear(py, gear_ratio)?);
            for name in names {
                let quantity = Quantity::named(&name);
                let quantity = quantity.map_err(|unknown| invalid_value(py, unknown))?;
                let source = Source::Quantity(quantity);
                let scale = gear.map(|gear| gear.scale(quantity.read().1.scale));
                columns.push(Column { signal: Signal { motor: Motor::Rmd(id), source }, scale });
            }
        }
        Ok(RmdSampling {
            sampler: Mutex::new(Sampler::new(plan, columns, raw)),
            relay: RmdRelay::default(),
            resting: Mutex::default(),
            port: port.into(),
            clock,
        })
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows in each case. With
    /// `skip` a motor that does not reply costs only rows. So does a signal handler that uses the bus.
    pub(crate) fn run(
        &self,
        bus: &Client,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        skip: bool,
        most: Option<u64>,
    ) -> (Taken, PyResult<()>) {
        self.begin_rows(most);
        let step = || self.next_step(skip, most);
        let outcome = sampling::run(&self.clock, &look, step, || self.carry_out(bus, &look));
        (self.lock().take(), outcome)
    }

    /// The pending exchanges, in one cycle.
    fn carry_out(&self, bus: &Client, look: &impl Fn(Python<'_>) -> PyResult<()>) -> PyResult<()> {
        let ready: BTreeMap<_, _> = self.ready().collect();
        let asked: Vec<_> = ready.iter().map(|(id, asked)| (*id, *asked)).collect();
        let mut results = Vec::with_capacity(asked.len());
        let cycle = bus.ask_each(&asked, |id, result| results.push((id, result)));
        for (id, result) in results {
            let confirmed = if judges(ready[&id], &result) { bus.confirmed(id) } else { Ok(()) };
            let (losses, sent) = (bus.losses(id), bus.sent(id));
            self.ended(id, Sampled { result, confirmed, losses, sent });
        }
        let Err(error) = cycle else { return Ok(()) };
        match &error {
            // A signal handler used the bus. The row is lost.
            Error::Port(PortError::Overtaken { .. }) => {
                self.lock().gave_up();
                Python::attach(look)
            }
            Error::Port(port) if port.is_interruption() => {
                Err(Python::attach(|py| rmd_error(py, &error)))
            }
            _ => {
                self.fail_pending(&error);
                Ok(())
            }
        }
    }

    /// The port was lost, with the pending exchanges.
    fn fail_pending(&self, why: &Error) {
        self.lock().doubt(why.clone().into());
        for (id, _) in self.relay.pending() {
            let sent = self.clock.now();
            self.relay.ended(id, RmdOver { result: Err(why.clone()), losses: None, sent });
        }
    }

    /// The pending exchanges that can be carried out now.
    fn ready(&self) -> impl Iterator<Item = (MotorId, Asked)> {
        let (now, resting) = (self.clock.now(), self.resting().clone());
        let is_ready =
            move |id: &MotorId| resting.get(id).is_none_or(|rest: &Rest| rest.until <= now);
        self.relay.pending().into_iter().filter(move |(id, _)| is_ready(id))
    }

    /// What is pending for a motor.
    pub(crate) fn pending(&self, id: MotorId) -> Option<Asked> {
        self.ready().find_map(|(of, asked)| (of == id).then_some(asked))
    }

    /// Lets a motor in quarantine rest; false if it was waited for too long.
    fn rest(&self, id: MotorId) -> bool {
        let now = self.clock.now();
        let mut resting = self.resting();
        let rest = resting.entry(id).or_insert(Rest { since: now, until: now });
        rest.until = now + RETRY;
        now.since(rest.since) < PATIENCE
    }

    /// What was pending for a motor is over, or is repeated if the motor is in quarantine.
    pub(crate) fn ended(&self, id: MotorId, over: Sampled) {
        let Sampled { result, confirmed, losses, sent } = over;
        if matches!(result, Err(Error::Quarantined { .. })) && self.rest(id) {
            return;
        }
        self.resting().remove(&id);
        let error = result.as_ref().err().filter(|error| error.is_line_failure());
        if let Some(error) = error.or(confirmed.as_ref().err()) {
            self.lock().doubt(error.clone().into());
        }
        self.relay.ended(id, RmdOver { result, losses: Some(losses), sent });
    }

    fn begin_rows(&self, most: Option<u64>) {
        self.lock().begin(most, || {
            let (port, clock) = (Arc::clone(&self.port), self.clock.clone());
            Box::new(RmdLine::relayed(self.relay.clone(), port, clock))
        });
    }

    fn next_step(&self, skip: bool, most: Option<u64>) -> PyResult<Next> {
        let next = self.lock().next(most, skip, || self.ready().next().is_some());
        match next {
            Ok(Next::Wait(wait)) if !self.relay.pending().is_empty() => {
                Ok(Next::Wait(wait.min(RETRY.into())))
            }
            Ok(next) => Ok(next),
            Err(ending) => Err(Python::attach(|py| self.raised(py, &ending))),
        }
    }

    fn raised(&self, py: Python<'_>, ending: &Ending) -> PyErr {
        match ending {
            Ending::Absent(_, Absent::Refused(error)) => line_error(py, error),
            Ending::Absent(_, Absent::Implausible(why)) => line_error(py, &(*why).into()),
            Ending::Doubtful(Motor::Rmd(motor)) => {
                let (port, motor) = (Arc::clone(&self.port), *motor);
                rmd_error(py, &Error::Unconfirmed { port, motor })
            }
            Ending::Doubtful(Motor::St(_)) => line_error(py, &LineError::Protocol),
            Ending::Failed(error) => line_error(py, error),
        }
    }

    fn resting(&self) -> MutexGuard<'_, BTreeMap<MotorId, Rest>> {
        self.resting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock(&self) -> MutexGuard<'_, Sampler> {
        self.sampler.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl RmdSampling {
    /// Begins to read `most` rows, or all. Later calls go on after a pause.
    fn begin(&self, most: Option<u64>) {
        self.begin_rows(most);
    }

    /// The wait of an event loop, s. 0: exchanges are pending, `None`: there are enough rows.
    fn next(&self, skip: bool, most: Option<u64>) -> PyResult<Option<f64>> {
        Ok(wait_seconds(&self.next_step(skip, most)?))
    }

    /// The motors with a pending exchange.
    #[getter]
    fn motors(&self) -> Vec<u32> {
        self.ready().map(|(id, _)| id.number().into()).collect()
    }

    /// The port could not be used for what is pending.
    fn fail(&self) {
        self.fail_pending(&PortError::Closed { port: self.port.to_string() }.into());
    }

    /// The new rows, each a time in s and values of eight bytes, and the skipped instants.
    fn take<'py>(&self, py: Python<'py>) -> (Bound<'py, PyByteArray>, u64) {
        self.lock().take().into_python(py)
    }
}

/// The names that can be sampled.
#[pyfunction]
pub(crate) fn rmd_quantities() -> Vec<String> {
    Quantity::all().map(Quantity::name).collect()
}
