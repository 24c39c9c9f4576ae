//! A serial line with an ST drive, for threads that may wait.

use std::sync::{Arc, PoisonError, RwLock};

use motorlink::stmcp::{Client, Limits, Motor, Options, Recovery};
use motorlink_proto::time::Duration;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::request::{StRequest, motor_number};
use crate::clock::{Clock, RealTime};
use crate::error::{bad_value, closed, st_error};
use crate::number::{digits, span};

/// A master on a serial line. Every call lets other Python threads run while it waits.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StClient {
    client: RwLock<Option<Arc<Client>>>,
    port: String,
    clock: Arc<dyn Clock>,
}

impl StClient {
    /// Over a client that is open, on this clock.
    pub(crate) fn from_client(client: Arc<Client>, port: String, clock: Arc<dyn Clock>) -> Self {
        StClient { client: RwLock::new(Some(client)), port, clock }
    }

    /// The client; an error once it was closed.
    pub(crate) fn client(&self, py: Python<'_>) -> PyResult<Arc<Client>> {
        let client = self.client.read().unwrap_or_else(PoisonError::into_inner);
        client.clone().ok_or_else(|| closed(py, &self.port))
    }

    /// The time that this client lives in.
    pub(crate) fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }
}

#[pymethods]
impl StClient {
    /// Opens a port. The drive is not asked anything.
    #[staticmethod]
    #[pyo3(signature = (
        port, *, profile = "spec", timeout = 1.0, recovery = "drain", speed_limit_rpm = None,
        current_limit_s16a = None,
    ))]
    fn open(
        py: Python<'_>,
        port: &str,
        profile: &str,
        timeout: f64,
        recovery: &str,
        speed_limit_rpm: Option<f64>,
        current_limit_s16a: Option<f64>,
    ) -> PyResult<Self> {
        let options = options(py, profile, timeout, recovery, speed_limit_rpm, current_limit_s16a)?;
        let name = port.parse().map_err(|error| bad_value(py, error))?;
        let client = py.detach(|| Client::open(&name, options));
        let client = Arc::new(client.map_err(|error| st_error(py, &error))?);
        Ok(Self::from_client(client, port.to_owned(), Arc::new(RealTime::new())))
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
        let (register, bits) =
            request.written().ok_or_else(|| bad_value(py, "only a write can be verified"))?;
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
        let code = u8::try_from(code).ok().filter(|code| *code < 0x20);
        let code = code.ok_or_else(|| bad_value(py, "frame codes are 0 to 0x1f"))?;
        let reply = py.detach(|| client.raw(motor, code, payload));
        Ok(PyBytes::new(py, &reply.map_err(|error| st_error(py, &error))?))
    }

    /// Motors that this client started and did not stop.
    #[getter]
    fn started(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        let client = self.client(py)?;
        Ok(py.detach(|| client.started().map(Motor::number).collect()))
    }

    /// Stops the motors that this client started; gives those that did not acknowledge it, and why.
    fn stop_started(&self, py: Python<'_>) -> PyResult<Vec<(u8, PyErr)>> {
        let client = self.client(py)?;
        let stopped = py.detach(|| client.guard().stop_now());
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

/// What the arguments of `open` say.
pub(crate) fn options(
    py: Python<'_>,
    profile: &str,
    timeout: f64,
    recovery: &str,
    speed_limit_rpm: Option<f64>,
    current_limit_s16a: Option<f64>,
) -> PyResult<Options> {
    let mut options = Options { profile: super::profile(py, profile)?, ..Options::default() };
    options.line.timeout = Duration::from(span(py, "a timeout", timeout)?);
    options.line.recovery = match recovery {
        "drain" => Recovery::Drain,
        "pad" => Recovery::Pad,
        "none" => Recovery::None,
        other => {
            let known = "there are `drain`, `pad` and `none`";
            return Err(bad_value(py, format_args!("there is no recovery `{other}`; {known}")));
        }
    };
    let limit = |limit: Option<f64>, unit| -> PyResult<Option<u32>> {
        limit.map(|limit| digits(py, "a limit", limit.floor(), 1.0, unit)).transpose()
    };
    let current = limit(current_limit_s16a, "s16A")?;
    options.limits = Limits {
        speed_rpm: limit(speed_limit_rpm, "rpm")?,
        current_s16a: current.map(|limit| limit.try_into().unwrap_or(u16::MAX)),
    };
    Ok(options)
}
