//! Sampling values of motors, all of them at the same instants.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink::rmd::{Asked, Client, Error, MotorId};
use motorlink_telemetry::line::owner::{Carried, RETRY, RmdOwner};
use motorlink_telemetry::line::{LineError, RmdLine};
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::signal::{Motor, Quantity, Signal, Source};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use super::gear::gear;
use super::request::motor_id;
use crate::error::{invalid_value, line_error, rmd_error};
use crate::sampling::{self, Column, Ending, Next, Plan, Sampler, Taken, wait_seconds};

/// A motor's ID, its quantities and its gear ratio.
pub(crate) type Wanted = (i64, Vec<String>, Option<f64>);

/// Rows of quantities. A blocking client calls [`RmdSampling::run`]. An event loop calls `next`, and
/// carries out what is pending.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdSampling {
    sampler: Mutex<Sampler>,
    owner: RmdOwner,
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
            owner: RmdOwner::new(clock.clone()),
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
        let doubt = |error: &Error| self.lock().doubt(error.clone().into());
        let Err(error) = self.owner.carry_out(bus, doubt) else { return Ok(()) };
        match &error {
            // A signal handler used the bus. The row is lost.
            Error::Port(PortError::Overtaken(..)) => {
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
        self.owner.fail_pending(why);
    }

    /// What is pending for a motor.
    pub(crate) fn pending(&self, id: MotorId) -> Option<Asked> {
        self.owner.ready().find_map(|(of, asked)| (of == id).then_some(asked))
    }

    /// What was pending for a motor is over, or is repeated if the motor is in quarantine.
    pub(crate) fn ended(&self, id: MotorId, carried: Carried) {
        if let Some(error) = self.owner.ended(id, carried) {
            self.lock().doubt(error.into());
        }
    }

    fn begin_rows(&self, most: Option<u64>) {
        self.lock().begin(most, || {
            let (port, clock) = (Arc::clone(&self.port), self.clock.clone());
            Box::new(RmdLine::relayed(self.owner.relay().clone(), port, clock))
        });
    }

    fn next_step(&self, skip: bool, most: Option<u64>) -> PyResult<Next> {
        let next = self.lock().next(most, skip, || self.owner.ready().next().is_some());
        match next {
            Ok(Next::Wait(wait)) if !self.owner.relay().pending().is_empty() => {
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
        self.owner.ready().map(|(id, _)| id.number().into()).collect()
    }

    /// The port could not be used for what is pending.
    fn fail(&self) {
        self.fail_pending(&PortError::Closed(self.port.to_string()).into());
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
