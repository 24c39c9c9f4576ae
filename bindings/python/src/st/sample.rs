//! Sampling registers: through data segments if the drive has them, otherwise one by one.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink::st::{Client, Error, Failure, MotorNumber, Profile, Target};
use motorlink_telemetry::line::{StLine, StOver, StRelay, StStep};
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::signal::{Motor, Signal, Source};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use super::profile;
use super::request::no_such_motor;
use super::scale::{Scale, register};
use crate::error::{line_error, st_error};
use crate::sampling::{self, Column, Ending, Next, Plan, Sampler, Taken, wait_seconds};

/// What is sampled of one motor: number, registers, full scale of current in A.
pub(crate) type Wanted<'py> = (i64, Vec<Bound<'py, PyAny>>, Option<f64>);

/// Rows of registers. A blocking client calls [`StSampling::run`]. An event loop calls `next`, and
/// carries out what is pending.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StSampling {
    sampler: Mutex<Sampler>,
    relay: StRelay,
    port: Arc<str>,
    clock: Clock,
    profile: Profile,
    segments: Vec<u8>,
}

impl StSampling {
    /// Registers of motors, each motor in one of `segments` if possible.
    pub(crate) fn new(
        py: Python<'_>,
        (port, clock): (&str, Clock),
        profile: &str,
        motors: Vec<Wanted<'_>>,
        segments: Vec<u8>,
        plan: Plan,
        raw: bool,
    ) -> PyResult<Self> {
        let mut columns = Vec::new();
        for (motor, names, full_scale_amps) in motors {
            let scale = Scale::new(py, profile, full_scale_amps)?;
            let number = u8::try_from(motor).ok().and_then(MotorNumber::new);
            let number = number.ok_or_else(|| no_such_motor(py, motor))?;
            for name in names {
                let register = register(&name)?;
                let source = Source::Register(register);
                let signal = Signal { motor: Motor::St(number), source };
                columns.push(Column { signal, scale: scale.of_current(register) });
            }
        }
        Ok(StSampling {
            sampler: Mutex::new(Sampler::new(plan, columns, raw)),
            relay: StRelay::default(),
            port: port.into(),
            clock,
            profile: profile::named(py, profile)?,
            segments,
        })
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows in each case. With
    /// `skip` a line that fails costs only rows. So does a signal handler that uses it.
    pub(crate) fn run(
        &self,
        client: &Client,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        skip: bool,
        most: Option<u64>,
    ) -> (Taken, PyResult<()>) {
        self.begin_rows(most);
        let step = || self.next_step(skip, most);
        let carry_out = || match self.pending() {
            Some(step) => self.carry_out(client, &step, &look),
            None => Ok(()),
        };
        let outcome = sampling::run(&self.clock, &look, step, carry_out);
        (self.lock().take(), outcome)
    }

    fn carry_out(
        &self,
        client: &Client,
        step: &StStep,
        look: &impl Fn(Python<'_>) -> PyResult<()>,
    ) -> PyResult<()> {
        let over = step.carry_out(client);
        match &over.result {
            // A signal handler used the client. The row is lost.
            Err(Error::Port(PortError::Overtaken(..))) => {
                self.lock().gave_up();
                Python::attach(look)
            }
            Err(error @ Error::Port(port)) if port.is_interruption() => {
                Err(Python::attach(|py| st_error(py, error)))
            }
            _ => {
                self.ended(over);
                Ok(())
            }
        }
    }

    /// What is pending.
    pub(crate) fn pending(&self) -> Option<StStep> {
        self.relay.pending().pop().map(|((), step)| step)
    }

    /// What was pending is over.
    pub(crate) fn ended(&self, over: StOver) {
        if let Some(error) = over.result.as_ref().err().filter(|error| error.is_line_failure()) {
            match error {
                // Another user has lost the line.
                Error::Unconfirmed { why: None, .. } => {}
                Error::Unconfirmed { why: Some(why), .. } if is_timeout(why) => {
                    self.lock().doubt((**why).clone().into());
                }
                error => self.lock().doubt(error.clone().into()),
            }
        }
        self.relay.ended((), over);
    }

    fn begin_rows(&self, most: Option<u64>) {
        self.lock().begin(most, || {
            let (port, clock) = (Arc::clone(&self.port), self.clock.clone());
            let line = StLine::relayed(self.relay.clone(), port, clock, self.profile);
            Box::new(line.using_segments(&self.segments))
        });
    }

    fn next_step(&self, skip: bool, most: Option<u64>) -> PyResult<Next> {
        let next = self.lock().next(most, skip, || self.pending().is_some());
        next.map_err(|ending| Python::attach(|py| self.raised(py, ending)))
    }

    fn raised(&self, py: Python<'_>, ending: Ending) -> PyErr {
        match ending {
            Ending::Absent(signal, Absent::Implausible(why)) => {
                let motor = match signal.motor {
                    Motor::St(motor) => Target(motor.number()),
                    Motor::Rmd(_) => Target(0),
                };
                st_error(py, &Error::Implausible { port: Arc::clone(&self.port), motor, why })
            }
            Ending::Absent(_, Absent::Refused(error)) => line_error(py, &error),
            Ending::Failed(error) => line_error(py, &error),
            Ending::Doubtful(_) => {
                st_error(py, &Error::Unconfirmed { port: Arc::clone(&self.port), why: None })
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Sampler> {
        self.sampler.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn is_timeout(error: &Error) -> bool {
    matches!(error, Error::Failed { failure: Failure::Timeout, .. })
}

#[pymethods]
impl StSampling {
    /// Begins to read `most` rows, or all. Later calls go on after a pause.
    fn begin(&self, most: Option<u64>) {
        self.begin_rows(most);
    }

    /// The wait of an event loop, s. 0: an exchange is pending, `None`: there are enough rows.
    fn next(&self, skip: bool, most: Option<u64>) -> PyResult<Option<f64>> {
        Ok(wait_seconds(&self.next_step(skip, most)?))
    }

    /// The port could not be used for what is pending.
    fn fail(&self) {
        let closed = PortError::Closed(self.port.to_string());
        self.relay.ended((), StOver { result: Err(closed.into()), exchanged: None });
    }

    /// The new rows, each a time in s and values of eight bytes, and the skipped instants.
    fn take<'py>(&self, py: Python<'py>) -> (Bound<'py, PyByteArray>, u64) {
        self.lock().take().into_python(py)
    }
}
