//! A serial line with an ST drive, for threads that may wait.

use std::sync::{Arc, PoisonError, RwLock};

use motorlink::port::{ByteLink, PortName};
use motorlink::stmcp::{Client, Limits, Motor, Options, Profile, Recovery};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyList};

use super::request::{StRequest, motor_number};
use super::sample::{self, Reading, sample};
use super::scale::Scale;
use crate::clock::{Clock, RealTime};
use crate::error::{bad_value, closed, st_error};
use crate::number::{limit, span};
use crate::sampling::Plan;
use crate::signals::Deafness;
use crate::sim::{Port, SimPort};

/// A master on a serial line. Every call lets other Python threads run while it waits.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StClient {
    client: RwLock<Option<Arc<Client>>>,
    port: String,
    clock: Arc<dyn Clock>,
    deafness: Deafness,
}

impl StClient {
    /// The client; an error once it was closed.
    pub(crate) fn client(&self, py: Python<'_>) -> PyResult<Arc<Client>> {
        let client = self.client.read().unwrap_or_else(PoisonError::into_inner);
        client.clone().ok_or_else(|| closed(py, &self.port))
    }
}

#[pymethods]
impl StClient {
    /// Opens a port. The drive is not asked anything.
    #[staticmethod]
    #[pyo3(signature = (
        port, *, profile = "spec", timeout = 1.0, recovery = "drain", speed_limit = None,
        current_limit = None, full_scale_amps = None,
    ))]
    fn open(
        py: Python<'_>,
        port: Port<'_>,
        profile: &str,
        timeout: f64,
        recovery: &str,
        speed_limit: Option<f64>,
        current_limit: Option<f64>,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::new(py, profile, full_scale_amps)?;
        let limits = limits(py, scale, speed_limit, current_limit)?;
        let options = options(py, scale.profile, timeout, recovery, limits)?;
        let deafness = Deafness::default();
        let (client, port, clock): (_, _, Arc<dyn Clock>) = match port {
            Port::Name(name) => {
                let name: PortName = name.parse().map_err(|error| bad_value(py, error))?;
                let deaf = deafness.clone();
                let wrap = move |link| Box::new(deaf.around(link)) as Box<dyn ByteLink>;
                let client = py.detach(|| Client::open_wrapped(&name, wrap, options));
                let client = client.map_err(|error| st_error(py, &error))?;
                (client, name.to_string(), Arc::new(RealTime::new()))
            }
            Port::Sim(port) => {
                let client = Client::over(SimPort::NAME, port.line(py)?, options);
                (client, SimPort::NAME.to_owned(), port.clock())
            }
        };
        let client = RwLock::new(Some(Arc::new(client)));
        Ok(StClient { client, port, clock, deafness })
    }

    /// One exchange; gives what the request makes of the reply.
    fn perform(&self, py: Python<'_>, motor: i64, request: &StRequest) -> PyResult<Py<PyAny>> {
        let (client, motor) = (self.client(py)?, motor_number(py, motor)?);
        let exchange =
            || client.exchange(motor, &request.request(), |payload| request.understand(payload));
        let answer = py.detach(exchange).map_err(|error| st_error(py, &error))?;
        request.value(py, answer)
    }

    /// Writes, reads back and repeats until the register has the value; gives the number of the
    /// attempt that did it.
    fn write_verified(
        &self,
        py: Python<'_>,
        motor: i64,
        request: &StRequest,
        attempts: u8,
    ) -> PyResult<u8> {
        let (client, motor) = (self.client(py)?, motor_number(py, motor)?);
        let (register, bits) = request.verifiable(py)?;
        let written = || client.motor(motor)?.write_raw_verified(register, bits, attempts);
        py.detach(written).map_err(|error| st_error(py, &error))
    }

    /// One exchange with any frame code and payload; gives the acknowledge's payload.
    fn exchange_raw<'py>(
        &self,
        py: Python<'py>,
        motor: i64,
        code: i64,
        payload: &[u8],
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (client, motor) = (self.client(py)?, motor_number(py, motor)?);
        let code = frame_code(py, code)?;
        let reply = py.detach(|| client.raw(motor, code, payload));
        Ok(PyBytes::new(py, &reply.map_err(|error| st_error(py, &error))?))
    }

    /// Samples registers of motors `(motor, registers, full_scale_amps)`, each in one of `segments`
    /// where that can be done. Gives rows of a time in s and the values, eight bytes each, and what
    /// ended it before its time.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        motors: Vec<sample::Motor<'py>>,
        segments: Vec<u8>,
        rate: f64,
        seconds: f64,
        raw: bool,
        skip: bool,
    ) -> PyResult<(Bound<'py, PyByteArray>, Option<PyErr>)> {
        let client = self.client(py)?;
        let plan = Plan::new(py, rate, seconds)?;
        let reading = Reading::new(py, client.profile(), motors, segments, raw)?;
        let look = |py: Python<'_>| self.client(py).map(drop);
        let clock = &*self.clock;
        let (rows, outcome) = py.detach(|| sample(&client, clock, look, plan, reading, skip));
        Ok((PyByteArray::new(py, &rows.0), outcome.err()))
    }

    /// Motors that this client started and did not stop.
    #[getter]
    fn started<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let client = self.client(py)?;
        let numbers: Vec<u8> = py.detach(|| client.started().map(Motor::number).collect());
        PyList::new(py, numbers)
    }

    /// Stops the motors that this client started; gives those that did not acknowledge it, and why.
    fn stop_started(&self, py: Python<'_>) -> PyResult<Vec<(u8, PyErr)>> {
        let client = self.client(py)?;
        let stopped = py.detach(|| self.deafness.during(|| client.guard().stop_now()));
        let failed = stopped.into_iter().filter_map(|one| {
            one.result.err().map(|error| (one.motor.number(), st_error(py, &error)))
        });
        Ok(failed.collect())
    }

    /// Closes the port, when exchanges that are under way are over. Again is no error.
    fn close(&self, py: Python<'_>) {
        let client = self.client.write().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| drop(client));
    }

    /// Whether it was closed.
    #[getter]
    fn is_closed(&self) -> bool {
        self.client.read().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// The port's name.
    #[getter]
    fn port(&self) -> &str {
        &self.port
    }
}

/// A frame code, 5 bits.
pub(crate) fn frame_code(py: Python<'_>, code: i64) -> PyResult<u8> {
    let code = u8::try_from(code).ok().filter(|code| *code < 0x20);
    code.ok_or_else(|| bad_value(py, "frame codes are 0 to 0x1f"))
}

/// What the arguments of `open` say.
pub(crate) fn options(
    py: Python<'_>,
    profile: Profile,
    timeout: f64,
    recovery: &str,
    limits: Limits,
) -> PyResult<Options> {
    let mut options = Options { profile, limits, ..Options::default() };
    options.line.timeout = span(py, "a timeout", timeout)?.into();
    options.line.recovery = match recovery {
        "drain" => Recovery::Drain,
        "pad" => Recovery::Pad,
        "none" => Recovery::None,
        other => {
            let known = "there are `drain`, `pad` and `none`";
            return Err(bad_value(py, format_args!("there is no recovery `{other}`; {known}")));
        }
    };
    Ok(options)
}

/// Limits in rpm and in the unit that the scale gives currents. A limit is rounded as
/// commands are.
pub(crate) fn limits(
    py: Python<'_>,
    scale: Scale,
    speed: Option<f64>,
    current: Option<f64>,
) -> PyResult<Limits> {
    let (ampere, unit) = scale.current();
    let speed_rpm = speed.map(|speed| limit(py, speed, 1.0, "rpm")).transpose()?;
    let current_s16a = current.map(|current| limit(py, current, ampere, unit)).transpose()?;
    Ok(Limits { speed_rpm, current_s16a })
}
