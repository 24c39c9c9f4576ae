//! A serial line with an ST drive, for event loops.

use motorlink::port::PortName;
use motorlink::st::{Confirmation, Error, EventClient, Progress};
use motorlink::{Clock, LinkState};
use motorlink_telemetry::line::{StExchange, StOver};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::{Driven, fileno, outcome, seconds};
use crate::error::{invalid_value, st_error};
use crate::sampling::Plan;
use crate::shared::ending;
use crate::st::{
    Answer, StOptions, StRequest, StSampling, StWanted, frame_code, motor_number, not_stopped,
};

/// A master on a serial line with one exchange at a time. Call `begin`. Then call `advance` when
/// the descriptor is readable and when the returned time has passed, until it is done.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StEventClient {
    driven: Driven<InFlight>,
    clock: Clock,
}

struct InFlight {
    client: EventClient,
    asked: Asked,
}

/// The request of the exchange under way.
enum Asked {
    /// With its motor.
    Request(u8, Py<StRequest>),
    /// A request for bytes, or for nothing.
    Raw,
    Confirmation(Confirmation),
    /// A step of a sampling, which takes the reply.
    Sampling(Py<StSampling>, StExchange),
    /// Such a step is over.
    Sampled,
}

/// A reply that fits its request.
enum Read {
    Answer(u8, Py<StRequest>, Answer),
    Bytes(Vec<u8>),
    Confirmed,
    Sampled,
}

impl InFlight {
    /// Begins what is pending in a sampling. An error is one of the port; the sampling has others.
    fn begin_sampling(&mut self, sampling: Py<StSampling>) -> Result<(), Error> {
        self.asked = Asked::Sampled;
        let Some(step) = sampling.get().pending() else { return Ok(()) };
        match StExchange::begin(&mut self.client, step) {
            Ok(exchange) => self.asked = Asked::Sampling(sampling, exchange),
            Err(error @ Error::Port(_)) => return Err(error),
            Err(error) => {
                let exchanged = Some(self.client.exchanged());
                sampling.get().ended(StOver { result: Err(error), exchanged });
            }
        }
        Ok(())
    }

    fn advance(&mut self, py: Python<'_>) -> Progress<Read> {
        let InFlight { client, asked } = self;
        let progress = match asked {
            Asked::Request(motor, request) => client.advance(|payload| {
                let answer = request.get().understand(payload)?;
                Some(Read::Answer(*motor, request.clone_ref(py), answer))
            }),
            Asked::Raw => client.advance(|payload| Some(Read::Bytes(payload.to_vec()))),
            Asked::Confirmation(confirmation) => match client.advance_confirmation(confirmation) {
                Progress::Done(result) => Progress::Done(result.map(|()| Read::Confirmed)),
                Progress::Wait(wait) => Progress::Wait(wait),
            },
            Asked::Sampled => Progress::Done(Ok(Read::Sampled)),
            Asked::Sampling(sampling, exchange) => match exchange.advance(client) {
                Progress::Wait(wait) => Progress::Wait(wait),
                Progress::Done(result) => {
                    let exchanged = Some(client.exchanged());
                    sampling.get().ended(StOver { result, exchanged });
                    Progress::Done(Ok(Read::Sampled))
                }
            },
        };
        if matches!(progress, Progress::Done(_)) {
            *asked = Asked::Raw;
        }
        progress
    }
}

#[pymethods]
impl StEventClient {
    /// Opens a port, which may wait. Sends nothing.
    #[staticmethod]
    fn open(py: Python<'_>, port: &str, options: &StOptions) -> PyResult<Self> {
        let name: PortName = port.parse().map_err(|error| invalid_value(py, error))?;
        let client = py.detach(|| EventClient::open(&name, options.0));
        let client = client.map_err(|error| st_error(py, &error))?;
        let clock = client.clock();
        let line = InFlight { client, asked: Asked::Raw };
        Ok(StEventClient { driven: Driven::new(line, name.to_string()), clock })
    }

    /// Whether the port is open.
    #[getter]
    fn is_open(&self, py: Python<'_>) -> PyResult<bool> {
        self.driven.step(py, |line| line.client.link_state() == LinkState::Open)
    }

    /// Opens the port if it is closed and its back-off is over. This may wait.
    fn reopen(&self, py: Python<'_>) -> PyResult<()> {
        let opened = self.driven.detached(py, |line| line.client.reopen())?;
        opened.map_err(|error| st_error(py, &error))
    }

    /// The descriptor to watch; `None` without one.
    fn fileno(&self, py: Python<'_>) -> PyResult<Option<i32>> {
        self.driven.step(py, |line| fileno(line.client.descriptor()))
    }

    /// Checks a request against the limits. Sends nothing.
    fn check(&self, py: Python<'_>, motor: i64, request: &StRequest) -> PyResult<()> {
        let motor = motor_number(py, motor)?;
        let checked = self.driven.step(py, |line| line.client.check(motor, &request.request()))?;
        checked.map_err(|error| st_error(py, &error))
    }

    /// Begins an exchange. An exchange under way is abandoned.
    fn begin(&self, py: Python<'_>, motor: i64, request: Py<StRequest>) -> PyResult<()> {
        let motor = motor_number(py, motor)?;
        let begun = self.driven.step(py, |line| {
            line.asked = Asked::Raw;
            line.client.begin(motor, &request.get().request())?;
            line.asked = Asked::Request(motor, request);
            Ok(())
        })?;
        begun.map_err(|error| st_error(py, &error))
    }

    /// Begins an exchange with any frame code and payload; its value is the reply's payload.
    fn begin_raw(&self, py: Python<'_>, motor: i64, code: i64, payload: &[u8]) -> PyResult<()> {
        let (motor, code) = (motor_number(py, motor)?, frame_code(py, code)?);
        let begun = self.driven.step(py, |line| {
            line.asked = Asked::Raw;
            line.client.begin_raw(motor, code, payload)
        })?;
        begun.map_err(|error| st_error(py, &error))
    }

    /// Begins a check that the replies matched their requests; its value is `None`.
    fn begin_confirmation(&self, py: Python<'_>) -> PyResult<()> {
        let begun = self.driven.step(py, |line| {
            line.asked = Asked::Raw;
            line.asked = Asked::Confirmation(line.client.begin_confirmation()?);
            Ok(())
        })?;
        begun.map_err(|error| st_error(py, &error))
    }

    /// A sampling of registers of motors `(motor, registers, full_scale_amps)`, each motor in one of
    /// `segments` if possible.
    fn sampling(
        &self,
        py: Python<'_>,
        profile: &str,
        motors: Vec<StWanted<'_>>,
        segments: Vec<u8>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<StSampling> {
        let plan = Plan::new(py, rate, seconds)?;
        let line = (self.port(), self.clock.clone());
        StSampling::new(py, line, profile, motors, segments, plan, raw)
    }

    /// Begins what is pending in a sampling, which takes the reply; its value is `None`.
    fn begin_sampling(&self, py: Python<'_>, sampling: Py<StSampling>) -> PyResult<()> {
        let begun = self.driven.step(py, |line| line.begin_sampling(sampling))?;
        begun.map_err(|error| st_error(py, &error))
    }

    /// Does what it can without waiting. Returns `(True, value)` or `(True, exception)` for a
    /// completed exchange. Otherwise returns `False` and the time until the next step in s, `None`
    /// without an exchange.
    fn advance(&self, py: Python<'_>) -> PyResult<(bool, Option<Py<PyAny>>)> {
        let progress = self.driven.step(py, |line| line.advance(py))?;
        let result = match progress {
            Progress::Wait(wait) => {
                let wait = seconds(wait).map(|wait| wait.into_py_any(py)).transpose()?;
                return Ok((false, wait));
            }
            Progress::Done(result) => result.map_err(|error| st_error(py, &error)),
        };
        let value = result.and_then(|reply| match reply {
            Read::Answer(motor, request, answer) => {
                let (request, port) = (request.get(), self.port());
                let plausible = request.plausible(port, motor, &answer);
                plausible.map_err(|error| st_error(py, &error))?;
                request.value(py, answer)
            }
            Read::Bytes(bytes) => PyBytes::new(py, &bytes).into_py_any(py),
            Read::Confirmed | Read::Sampled => Ok(py.None()),
        });
        Ok((true, Some(outcome(py, value))))
    }

    /// Abandons the exchange under way, if there is one.
    fn abandon(&self, py: Python<'_>) -> PyResult<()> {
        self.driven.step(py, |line| {
            line.asked = Asked::Raw;
            line.client.abandon();
        })
    }

    /// Motors that were started and not stopped.
    #[getter]
    fn moving(&self, py: Python<'_>) -> PyResult<Vec<u32>> {
        self.driven
            .detached(py, |line| line.client.started().map(|motor| motor.number().into()).collect())
    }

    /// What a share or a node does with the motors when this client leaves: the arguments of `close`.
    #[pyo3(signature = (*, stop))]
    fn end_with(&self, py: Python<'_>, stop: bool) -> PyResult<()> {
        self.driven.detached(py, |line| line.client.end_with(ending(stop, false)))
    }

    /// Closes the port, which may wait. `stop` first stops the started motors. Returns the motors
    /// that did not acknowledge it, and why. A second call does nothing.
    #[pyo3(signature = (*, stop))]
    fn close(&self, py: Python<'_>, stop: bool) -> Vec<(u8, PyErr)> {
        let stopped = self.driven.close(py, |line| {
            let client = line.client.into_client();
            if stop { client.stop_on_drop().stop_now() } else { Vec::new() }
        });
        not_stopped(py, stopped)
    }

    /// The port's name.
    #[getter]
    fn port(&self) -> &str {
        &self.driven.port
    }
}
