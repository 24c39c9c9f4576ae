//! A serial line with an ST drive, blocking.

use std::sync::Arc;

use motorlink::Clock;
use motorlink::port::PortName;
use motorlink::st::{Client, MotorNumber, Stopped};
use motorlink::time;
use motorlink_recording::record::client::Kind;
use motorlink_recording::record::frames::Outlet;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyList};

use super::options::StOptions;
use super::profile;
use super::request::{StRequest, motor_number};
use super::sample::{StSampling, Wanted};
use crate::error::{invalid_value, st_error};
use crate::recording::RecordedClient;
use crate::sampling::{self, Plan, seconds};
use crate::shared::{Shared, ending};
use crate::signals::{Deafness, without_python};
use crate::sim::{Port, SimPort};

/// A master on a serial line. Each call lets other Python threads run while it waits.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StClient {
    client: Arc<Shared<Client>>,
    clock: Clock,
    deafness: Deafness,
    /// Where recordings see its frames.
    outlet: Outlet,
}

#[pymethods]
impl StClient {
    /// Opens a port. Sends nothing.
    #[staticmethod]
    fn open(py: Python<'_>, port: Port<'_>, options: &StOptions) -> PyResult<Self> {
        let options = options.0;
        let (deafness, outlet) = (Deafness::default(), Outlet::default());
        let (client, port, clock) = match port {
            Port::Name(name) => {
                let name: PortName = name.parse().map_err(|error| invalid_value(py, error))?;
                let seen = outlet.clone();
                let wrap = move |link| seen.around_line(link);
                let client = py.detach(|| Client::open_wrapped(&name, wrap, options));
                let client = client.map_err(|error| st_error(py, &error))?;
                let client = client.with_interrupt_hook(deafness.look());
                let clock = client.clock();
                (client, name.to_string(), clock)
            }
            Port::Sim(port) => {
                let client = Client::over(SimPort::NAME, port.line(py)?, options);
                (client, SimPort::NAME.to_owned(), port.clock())
            }
        };
        Ok(StClient { client: Arc::new(Shared::new(client, port)), clock, deafness, outlet })
    }

    /// One exchange. Returns the value of the reply.
    fn exchange(&self, py: Python<'_>, motor: i64, request: &StRequest) -> PyResult<Py<PyAny>> {
        let motor = motor_number(py, motor)?;
        let answer = self.client.exchange(py, |client| {
            client.exchange(motor, &request.request(), |payload| request.understand(payload))
        })?;
        let answer = answer.and_then(|answer| {
            request.plausible(self.client.port(), motor, &answer).map(|()| answer)
        });
        request.value(py, answer.map_err(|error| st_error(py, &error))?)
    }

    /// Checks a request against the limits. Sends nothing.
    fn check(&self, py: Python<'_>, motor: i64, request: &StRequest) -> PyResult<()> {
        let motor = motor_number(py, motor)?;
        let checked = self.client.get(py)?.check(motor, &request.request());
        checked.map_err(|error| st_error(py, &error))
    }

    /// Writes a register and reads it back until it has the value. Returns the number of attempts.
    fn set_verified(
        &self,
        py: Python<'_>,
        motor: i64,
        request: &StRequest,
        attempts: u8,
    ) -> PyResult<u8> {
        let motor = motor_number(py, motor)?;
        let (register, bits) = request.verifiable(py)?;
        let written = self.client.exchange(py, |client| {
            client.motor(motor)?.set_raw_verified(register, bits, attempts)
        })?;
        written.map_err(|error| st_error(py, &error))
    }

    /// The time of the port's clock, s.
    #[getter]
    fn now(&self) -> f64 {
        seconds(self.clock.now().since(time::Instant(0)))
    }

    /// Waits by the port's clock.
    fn pause(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        sampling::pause(py, &self.clock, seconds)
    }

    /// Checks that the replies so far matched their requests.
    fn confirm(&self, py: Python<'_>) -> PyResult<()> {
        self.client.exchange(py, |client| client.confirm())?.map_err(|error| st_error(py, &error))
    }

    /// One exchange with any frame code and payload. Returns the payload of the reply.
    fn raw<'py>(
        &self,
        py: Python<'py>,
        motor: i64,
        code: i64,
        payload: &[u8],
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (motor, code) = (motor_number(py, motor)?, frame_code(py, code)?);
        let reply = self.client.exchange(py, |client| client.raw(motor, code, payload))?;
        Ok(PyBytes::new(py, &reply.map_err(|error| st_error(py, &error))?))
    }

    /// A sampling of registers of motors `(motor, registers, full_scale_amps)`, each motor in one of
    /// `segments` if possible.
    fn sampling(
        &self,
        py: Python<'_>,
        profile: &str,
        motors: Vec<Wanted<'_>>,
        segments: Vec<u8>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<StSampling> {
        let plan = Plan::new(py, rate, seconds)?;
        let line = (self.client.port(), self.clock.clone());
        StSampling::new(py, line, profile, motors, segments, plan, raw)
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows, the instants that were
    /// skipped, and the error.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        sampling: &StSampling,
        skip: bool,
        most: Option<u64>,
    ) -> PyResult<(Bound<'py, PyByteArray>, u64, Option<PyErr>)> {
        let client = self.client.get(py)?;
        let look = |py: Python<'_>| self.client.get(py).map(drop);
        let (taken, outcome) = py.detach(|| sampling.run(&client, look, skip, most));
        let (rows, skipped) = taken.into_python(py);
        Ok((rows, skipped, outcome.err()))
    }

    /// The client for a recording, which may use these data segments.
    fn recorded(
        &self,
        py: Python<'_>,
        profile: &str,
        segments: Vec<u8>,
    ) -> PyResult<RecordedClient> {
        self.client.get(py)?;
        let (profile, shared) = (profile::named(py, profile)?, Arc::clone(&self.client));
        let with = Arc::new(move |act: &mut dyn FnMut(&Client)| {
            without_python(|| shared.lend(act).is_some())
        });
        let kind = Kind::St { profile, segments, with };
        RecordedClient::new(py, self.client.port(), &self.clock, &self.outlet, kind)
    }

    /// Motors that this client started and did not stop.
    #[getter]
    fn moving<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let client = self.client.get(py)?;
        let numbers: Vec<u8> = py.detach(|| client.started().map(MotorNumber::number).collect());
        PyList::new(py, numbers)
    }

    /// What a share or a node does with the motors when this client leaves: the arguments of `close`.
    #[pyo3(signature = (*, stop))]
    fn end_with(&self, py: Python<'_>, stop: bool) -> PyResult<()> {
        let client = self.client.get(py)?;
        py.detach(|| client.end_with(ending(stop, false)));
        Ok(())
    }

    /// Closes the port after the exchanges under way. `stop` first stops the started motors.
    /// Returns the motors that did not acknowledge it, and why. A second call does nothing.
    #[pyo3(signature = (*, stop))]
    fn close(&self, py: Python<'_>, stop: bool) -> Vec<(u8, PyErr)> {
        let halt = |client: &Client| {
            client.abandon();
            let stop_now = || client.stop_on_drop().stop_now();
            if stop { self.deafness.during(stop_now) } else { Vec::new() }
        };
        not_stopped(py, self.client.close(py, halt))
    }

    /// Whether it is closed.
    #[getter]
    fn is_closed(&self) -> bool {
        self.client.is_closed()
    }

    /// The port's name.
    #[getter]
    fn port(&self) -> &str {
        self.client.port()
    }
}

/// The motors that may still turn, and why.
pub(crate) fn not_stopped(py: Python<'_>, stopped: Vec<Stopped>) -> Vec<(u8, PyErr)> {
    let failed = stopped
        .into_iter()
        .filter_map(|one| one.result.err().map(|error| (one.motor.number(), st_error(py, &error))));
    failed.collect()
}

/// A frame code, 5 bits.
pub(crate) fn frame_code(py: Python<'_>, code: i64) -> PyResult<u8> {
    let code = u8::try_from(code).ok().filter(|code| *code < 0x20);
    code.ok_or_else(|| invalid_value(py, "frame codes are 0 to 0x1f"))
}
