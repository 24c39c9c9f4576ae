//! A CAN bus with RMD motors, for event loops.

use std::sync::Arc;

use motorlink::port::PortName;
use motorlink::rmd::{Asked, Error, EventClient, MotorId, ScanResult, StopAction};
use motorlink::{Clock, LinkState};
use motorlink_proto::rmd::{Command, ReadStatus, SetTorque};
use motorlink_telemetry::line::owner::{Carried, judges};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{Driven, fileno, outcome, seconds};
use crate::can::{CanPort, Threads};
use crate::error::{invalid_value, rmd_error};
use crate::rmd::{
    Gears, LimitChange, RmdOptions, RmdRequest, RmdSampling, RmdWanted, four_currents, motor_id,
    motor_ids, not_stopped, scan_result,
};
use crate::sampling::Plan;
use crate::shared::ending;

/// A CAN bus with one exchange per motor at a time. Call `ask`. Then call `advance` when the
/// descriptor is readable and when the returned time has passed.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdEventClient {
    driven: Driven<Motors>,
    clock: Clock,
    gears: Gears,
    /// The threads of a bus of python-can.
    threads: Option<Threads>,
}

struct Motors {
    bus: EventClient,
    /// The request of each motor.
    asked: [ReplyKind; MotorId::COUNT],
}

/// What is opened: a bus of python-can, or a port by its name.
#[derive(FromPyObject)]
enum CanBus {
    Port(Py<CanPort>),
    Name(String),
}

/// Completed exchanges: ID, and the value or the exception.
type Over = Vec<(u8, Py<PyAny>)>;

/// The kind of value that a reply becomes.
#[derive(Clone)]
enum ReplyKind {
    Value(RmdRequest),
    /// Nothing: only whether it went well matters.
    Nothing,
    /// The result of a scan for this ID.
    ScanResult,
    /// A step of a sampling, which takes the reply.
    Sampling(Arc<Py<RmdSampling>>, Asked),
}

impl RmdEventClient {
    fn new(
        mut bus: EventClient,
        port: String,
        options: &RmdOptions,
        threads: Option<Threads>,
    ) -> Self {
        options.geared.iter().for_each(|(id, limits)| bus.set_limits(*id, *limits));
        let clock = bus.clock();
        let motors = Motors { bus, asked: [const { ReplyKind::ScanResult }; MotorId::COUNT] };
        RmdEventClient { driven: Driven::new(motors, port), clock, gears: options.gears, threads }
    }
}

/// What a step of a sampling has become.
fn sampled(
    bus: &mut EventClient,
    id: MotorId,
    asked: Asked,
    result: Result<[u8; 8], Error>,
) -> Carried {
    let confirmed = if judges(asked, &result) { bus.confirmed(id) } else { Ok(()) };
    Carried { result, confirmed, losses: bus.losses(id), sent: bus.sent(id) }
}

#[pymethods]
impl RmdEventClient {
    /// Opens a port by its name, or a bus of python-can. This may wait. Sends nothing.
    #[staticmethod]
    fn open(py: Python<'_>, port: CanBus, options: &RmdOptions) -> PyResult<Self> {
        match port {
            CanBus::Port(port) => {
                let port = port.get();
                let threads = port.start()?;
                let mut links = threads.links();
                let open = Box::new(move || Ok(Box::new(links()) as _));
                let bus = EventClient::open_with(port.name(), open, options.options);
                let bus = bus.map_err(|error| rmd_error(py, &error))?;
                Ok(Self::new(bus, port.name().to_owned(), options, Some(threads)))
            }
            CanBus::Name(port) => {
                let name: PortName = port.parse().map_err(|error| invalid_value(py, error))?;
                let wanted = options.options;
                let bus = py.detach(|| EventClient::open(&name, wanted));
                let bus = bus.map_err(|error| rmd_error(py, &error))?;
                Ok(Self::new(bus, name.to_string(), options, None))
            }
        }
    }

    /// Whether the port is open.
    #[getter]
    fn is_open(&self, py: Python<'_>) -> PyResult<bool> {
        self.driven.step(py, |motors| motors.bus.link_state() == LinkState::Open)
    }

    /// Opens the port if it is closed and its back-off is over. This may wait.
    fn reopen(&self, py: Python<'_>) -> PyResult<()> {
        let opened = self.driven.detached(py, |motors| motors.bus.reopen())?;
        opened.map_err(|error| rmd_error(py, &error))
    }

    /// The descriptor to watch; `None` without one.
    fn fileno(&self, py: Python<'_>) -> PyResult<Option<i32>> {
        self.driven.step(py, |motors| fileno(motors.bus.descriptor()))
    }

    /// Begins an exchange with a motor that has none under way. If the motor is in quarantine, it
    /// waits if `patient`, and is an error otherwise.
    #[pyo3(signature = (id, request, *, patient = true))]
    fn ask(&self, py: Python<'_>, id: i64, request: &RmdRequest, patient: bool) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let begun = self.driven.step(py, |motors| {
            let asked = Asked::Request(request.data());
            if patient { motors.bus.ask(id, asked) } else { motors.bus.begin(id, asked) }?;
            motors.expect(id, ReplyKind::Value(request.clone()));
            Ok(())
        })?;
        begun.map_err(|error| rmd_error(py, &error))
    }

    /// Begins the exchange that confirms a motor's replies.
    fn begin_confirmation(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let begun = self.driven.step(py, |motors| {
            motors.bus.ask(id, Asked::Confirmation)?;
            motors.expect(id, ReplyKind::Nothing);
            Ok(())
        })?;
        begun.map_err(|error| rmd_error(py, &error))
    }

    /// Checks, after the exchange of `begin_confirmation`, that a motor's replies matched their requests.
    fn confirmed(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let confirmed = self.driven.step(py, |motors| motors.bus.confirmed(id))?;
        confirmed.map_err(|error| rmd_error(py, &error))
    }

    /// A sampling of quantities of motors `(id, quantities, gear_ratio)`.
    fn sampling(
        &self,
        py: Python<'_>,
        motors: Vec<RmdWanted>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<RmdSampling> {
        let plan = Plan::new(py, rate, seconds)?;
        RmdSampling::new(py, (self.port(), self.clock.clone()), motors, plan, raw)
    }

    /// Begins what is pending in a sampling for a motor. The sampling takes the reply, also an error
    /// that is not the port's; the value is `None`.
    fn ask_sampling(&self, py: Python<'_>, id: i64, sampling: Py<RmdSampling>) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let begun = self.driven.step(py, |motors| {
            let Some(asked) = sampling.get().pending(id) else { return Ok(()) };
            match motors.bus.begin(id, asked) {
                Ok(()) => motors.expect(id, ReplyKind::Sampling(Arc::new(sampling), asked)),
                Err(error @ Error::Port(_)) => return Err(error),
                Err(error) => {
                    let over = sampled(&mut motors.bus, id, asked, Err(error.clone()));
                    sampling.get().ended(id, over);
                    return Err(error);
                }
            }
            Ok(())
        })?;
        begun.map_err(|error| rmd_error(py, &error))
    }

    /// Begins the scan for one ID. Its value is the result, `None` if nothing replies.
    fn look_for(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let begun = self.driven.step(py, |motors| {
            motors.bus.ask(id, Asked::Request(ReadStatus.encode()))?;
            motors.expect(id, ReplyKind::ScanResult);
            Ok(())
        })?;
        begun.map_err(|error| rmd_error(py, &error))
    }

    /// Begins exchanges with the motors 1 to 4 that must reply: torque currents for all four in one
    /// frame, A.
    fn set_torque4(&self, py: Python<'_>, iq_amps: [f64; 4], expect: Vec<i64>) -> PyResult<()> {
        let (torques, expect) = (four_currents(py, iq_amps)?, motor_ids(py, expect)?);
        let begun = self.driven.step(py, |motors| {
            motors.bus.set_torque4(torques, expect)?;
            for id in expect {
                let request = RmdRequest::of(SetTorque::default(), self.gears.of(id));
                motors.expect(id, ReplyKind::Value(request));
            }
            Ok(())
        })?;
        begun.map_err(|error| rmd_error(py, &error))
    }

    /// Does what it can without waiting. Returns the time until the next step in s, `None` without
    /// an exchange, and the completed exchanges: ID, and the value or the exception.
    fn advance(&self, py: Python<'_>) -> PyResult<(Option<f64>, Over)> {
        let (wait, over) = self.driven.step(py, |Motors { bus, asked }| {
            let mut over = Vec::new();
            let wait = bus.advance(|id, result| {
                over.push((id, asked[id.index()].clone(), result));
            });
            for (id, asked, result) in &mut over {
                if let ReplyKind::Sampling(sampling, asked) = asked {
                    let result = std::mem::replace(result, Ok([0; 8]));
                    sampling.get().ended(*id, sampled(bus, *id, *asked, result));
                }
            }
            (wait, over)
        })?;
        let wait = wait.map_err(|error| rmd_error(py, &error))?;
        let value = |(id, asked, result)| {
            let value = match asked {
                ReplyKind::Sampling(..) => Ok(py.None()),
                ReplyKind::ScanResult => match result {
                    Err(error @ Error::Port(_)) => Err(rmd_error(py, &error)),
                    result => ScanResult::of(id, result)
                        .map_or_else(|| Ok(py.None()), |found| scan_result(py, found)),
                },
                ReplyKind::Nothing => match result {
                    Ok(_) => Ok(py.None()),
                    Err(error) => Err(rmd_error(py, &error)),
                },
                ReplyKind::Value(request) => result
                    .map_err(|error| rmd_error(py, &error))
                    .and_then(|reply| request.value(py, &reply)),
            };
            (id.number(), outcome(py, value))
        };
        Ok((seconds(wait), over.into_iter().map(value).collect()))
    }

    /// Abandons the exchange with a motor, if there is one.
    fn cancel(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        let id = motor_id(py, id)?;
        self.driven.step(py, |motors| {
            motors.bus.cancel(id);
        })
    }

    /// Changes the limits that are given. `None` removes a limit.
    #[pyo3(signature = (id, **limits))]
    fn set_limits(
        &self,
        py: Python<'_>,
        id: i64,
        limits: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let id = motor_id(py, id)?;
        let change = LimitChange::new(py, limits, self.gears.of(id))?;
        self.driven.step(py, |motors| {
            motors.bus.change_limits(id, |limits| change.of(limits));
        })
    }

    /// Refuses a request with angles or speeds of another shaft than those of its motor.
    fn check_gear(&self, py: Python<'_>, id: i64, request: &RmdRequest) -> PyResult<()> {
        self.gears.check(py, motor_id(py, id)?, request)
    }

    /// The gear ratio of a motor.
    fn gear_ratio(&self, py: Python<'_>, id: i64) -> PyResult<Option<f64>> {
        self.gears.ratio(py, id)
    }

    /// Checks a request against the limits of a motor. Sends nothing.
    fn check_limits(&self, py: Python<'_>, id: i64, request: &RmdRequest) -> PyResult<()> {
        let (id, data) = (motor_id(py, id)?, request.data());
        let checked = self.driven.step(py, |motors| motors.bus.check_limits(id, &data))?;
        checked.map_err(|error| rmd_error(py, &error))
    }

    /// Motors that were commanded and neither stopped nor switched off.
    #[getter]
    fn moving(&self, py: Python<'_>) -> PyResult<Vec<u32>> {
        self.driven
            .detached(py, |motors| motors.bus.moving().map(|id| id.number().into()).collect())
    }

    /// What a share or a node does with the motors when this client leaves: the arguments of `close`.
    #[pyo3(signature = (*, stop, off))]
    fn end_with(&self, py: Python<'_>, stop: bool, off: bool) -> PyResult<()> {
        self.driven.detached(py, |motors| motors.bus.end_with(ending(stop, off)))
    }

    /// Closes the port, which may wait. `stop` first stops the moving motors, `off` switches them
    /// off. Returns the motors that did not acknowledge it, and why. A second call does nothing.
    #[pyo3(signature = (*, stop, off))]
    fn close(&self, py: Python<'_>, stop: bool, off: bool) -> Vec<(u8, PyErr)> {
        let action = if off { StopAction::Off } else { StopAction::Stop };
        let stopped = self.driven.close(py, |motors| {
            let bus = motors.bus.into_client();
            let stopped =
                if stop { bus.stop_on_drop().with(action).stop_now() } else { Vec::new() };
            self.threads.iter().for_each(Threads::end);
            stopped
        });
        not_stopped(py, stopped)
    }

    /// The port's name.
    #[getter]
    fn port(&self) -> &str {
        &self.driven.port
    }
}

impl Motors {
    fn expect(&mut self, id: MotorId, asked: ReplyKind) {
        self.asked[id.index()] = asked;
    }
}
