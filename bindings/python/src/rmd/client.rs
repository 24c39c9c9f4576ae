//! A CAN bus with RMD motors, blocking.

use std::sync::Arc;

use motorlink::Clock;
use motorlink::port::PortName;
use motorlink::rmd::{
    Client, Error, IqCommand, MotorId, MotorSet, SCAN_WIDTH, ScanResult, SetTorque4, StopAction,
    Stopped,
};
use motorlink::time;
use motorlink_recording::record::client::Kind;
use motorlink_recording::record::frames::Outlet;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict, PyList};

use super::gears::Gears;
use super::options::{LimitChange, RmdOptions};
use super::request::{RmdRequest, motor_id, said};
use super::sample::{RmdSampling, Wanted};
use crate::can::{AnyPort, Threads};
use crate::error::{invalid_value, rmd_error};
use crate::number::wanted;
use crate::recording::RecordedClient;
use crate::sampling::{self, Plan, seconds};
use crate::shared::{Shared, ending};
use crate::signals::{Deafness, without_python};
use crate::sim::{Port, SimPort};
use crate::values;

/// A CAN bus with RMD motors. Each call lets other Python threads run while it waits.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdClient {
    bus: Arc<Shared<Client>>,
    clock: Clock,
    gears: Gears,
    deafness: Deafness,
    /// Where recordings see its frames.
    outlet: Outlet,
    /// The threads of a bus of python-can.
    threads: Option<Threads>,
}

#[pymethods]
impl RmdClient {
    /// Opens a port. Sends nothing.
    #[staticmethod]
    fn open(py: Python<'_>, port: AnyPort<'_>, options: &RmdOptions) -> PyResult<Self> {
        let RmdOptions { options, gears, ref geared } = *options;
        let (deafness, outlet) = (Deafness::default(), Outlet::default());
        let seen = outlet.clone();
        let mut threads = None;
        let (bus, port) = match port {
            AnyPort::Other(Port::Name(name)) => {
                let name: PortName = name.parse().map_err(|error| invalid_value(py, error))?;
                let wrap = move |link| seen.around_bus(link);
                let bus = py.detach(|| Client::open_wrapped(&name, wrap, options));
                let bus = bus.map_err(|error| rmd_error(py, &error))?;
                (bus.with_interrupt_hook(deafness.look()), name.to_string())
            }
            AnyPort::Other(Port::Sim(port)) => {
                let bus = Client::over(SimPort::NAME, port.can(py)?, options);
                (bus, SimPort::NAME.to_owned())
            }
            AnyPort::Can(port) => {
                let port = port.get();
                let mut links = threads.insert(port.start()?).links();
                let open = Box::new(move || Ok(seen.around_bus(Box::new(links()))));
                let bus = Client::open_with(port.name(), open, options);
                let bus = bus.map_err(|error| rmd_error(py, &error))?;
                (bus.with_interrupt_hook(deafness.look()), port.name().to_owned())
            }
        };
        geared.iter().for_each(|(id, limits)| bus.set_limits(*id, *limits));
        let clock = bus.clock();
        let bus = Arc::new(Shared::new(bus, port));
        Ok(RmdClient { bus, clock, gears, deafness, outlet, threads })
    }

    /// One exchange. Returns the value of the reply.
    fn exchange(&self, py: Python<'_>, id: i64, request: &RmdRequest) -> PyResult<Py<PyAny>> {
        let (id, data) = (motor_id(py, id)?, request.data());
        let reply = self.bus.exchange(py, |bus| bus.raw(id, data))?;
        request.value(py, &reply.map_err(|error| rmd_error(py, &error))?)
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

    /// Checks that a motor's replies matched their requests.
    fn confirm(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        let id = motor_id(py, id)?;
        self.bus.exchange(py, |bus| bus.confirm(id))?.map_err(|error| rmd_error(py, &error))
    }

    /// Overlapping exchanges, one per motor. Returns the value or the exception, by ID.
    fn cycle<'py>(
        &self,
        py: Python<'py>,
        requests: Vec<(i64, PyRef<'py, RmdRequest>)>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut asked: Vec<(MotorId, [u8; 8])> = Vec::with_capacity(requests.len());
        for (id, request) in &requests {
            asked.push((motor_id(py, *id)?, request.data()));
        }
        let mut outcomes: Vec<(MotorId, Result<[u8; 8], Error>)> = Vec::with_capacity(asked.len());
        let cycle = self
            .bus
            .exchange(py, |bus| bus.cycle(&asked, |id, outcome| outcomes.push((id, outcome))))?;
        cycle.map_err(|error| rmd_error(py, &error))?;
        let by_id = PyDict::new(py);
        for ((id, _), (_, request)) in asked.iter().zip(&requests) {
            let outcome = outcomes.iter().find(|(of, _)| of == id);
            let value = match outcome {
                Some((_, Ok(reply))) => request.value(py, reply)?,
                Some((_, Err(error))) => rmd_error(py, error).into_py_any(py)?,
                None => continue,
            };
            by_id.set_item(id.number(), value)?;
        }
        Ok(by_id)
    }

    /// Torque currents for motors 1 to 4 in one frame, A. Returns the replies of `expect`.
    fn set_torque4<'py>(
        &self,
        py: Python<'py>,
        iq_amps: [f64; 4],
        expect: Vec<i64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (torques, expect) = (four_currents(py, iq_amps)?, motor_ids(py, expect)?);
        let replies = self.bus.exchange(py, |bus| bus.set_torque4(torques, expect))?;
        let by_id = PyDict::new(py);
        let replies = replies.map_err(|error| rmd_error(py, &error))?;
        for (reply, id) in replies.into_iter().zip(MotorSet::TORQUE4) {
            let (number, gear) = (id.number(), self.gears.of(id));
            match reply {
                Some(Ok(status)) => {
                    by_id.set_item(number, said(py, "MotionStatus", &status, gear)?)?;
                }
                Some(Err(error)) => by_id.set_item(number, rmd_error(py, &error))?,
                None => {}
            }
        }
        Ok(by_id)
    }

    /// Asks each ID for its status. Returns the replies.
    fn scan(&self, py: Python<'_>, ids: Vec<i64>) -> PyResult<Vec<Py<PyAny>>> {
        let bus = self.bus.get(py)?;
        let mut left = motor_ids(py, ids)?;
        let mut found = Vec::new();
        while !left.is_empty() {
            let some: MotorSet = left.by_ref().take(SCAN_WIDTH).collect();
            // Signal handlers run between the parts.
            py.detach(|| bus.scan(some, |one| found.push(one), |_| {}))
                .map_err(|error| rmd_error(py, &error))?;
            py.check_signals()?;
        }
        found.into_iter().map(|one| scan_result(py, one)).collect()
    }

    /// A sampling of quantities of motors `(id, quantities, gear_ratio)`.
    fn sampling(
        &self,
        py: Python<'_>,
        motors: Vec<Wanted>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<RmdSampling> {
        let plan = Plan::new(py, rate, seconds)?;
        RmdSampling::new(py, (self.bus.port(), self.clock.clone()), motors, plan, raw)
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows, the instants that were
    /// skipped, and the error.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        sampling: &RmdSampling,
        skip: bool,
        most: Option<u64>,
    ) -> PyResult<(Bound<'py, PyByteArray>, u64, Option<PyErr>)> {
        let bus = self.bus.get(py)?;
        let look = |py: Python<'_>| self.bus.get(py).map(drop);
        let (taken, outcome) = py.detach(|| sampling.run(&bus, look, skip, most));
        let (rows, skipped) = taken.into_python(py);
        Ok((rows, skipped, outcome.err()))
    }

    /// Changes the limits that are given. `None` removes a limit.
    #[pyo3(signature = (id, **limits))]
    fn set_limits(
        &self,
        py: Python<'_>,
        id: i64,
        limits: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let (bus, id) = (self.bus.get(py)?, motor_id(py, id)?);
        let change = LimitChange::new(py, limits, self.gears.of(id))?;
        py.detach(|| bus.change_limits(id, |limits| change.of(limits)));
        Ok(())
    }

    /// Refuses a request with angles or speeds of another shaft than those of its motor.
    fn check_gear(&self, py: Python<'_>, id: i64, request: &RmdRequest) -> PyResult<()> {
        self.gears.check(py, motor_id(py, id)?, request)
    }

    /// The gear ratio of a motor.
    fn gear_ratio(&self, py: Python<'_>, id: i64) -> PyResult<Option<f64>> {
        self.gears.ratio(py, id)
    }

    /// The client for a recording.
    fn recorded(&self, py: Python<'_>) -> PyResult<RecordedClient> {
        self.bus.get(py)?;
        let shared = Arc::clone(&self.bus);
        let with = Arc::new(move |act: &mut dyn FnMut(&Client)| {
            without_python(|| shared.lend(act).is_some())
        });
        RecordedClient::new(py, self.bus.port(), &self.clock, &self.outlet, Kind::Rmd { with })
    }

    /// Motors that were commanded and neither stopped nor switched off.
    #[getter]
    fn moving<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let bus = self.bus.get(py)?;
        let numbers: Vec<u8> = py.detach(|| bus.moving().map(MotorId::number).collect());
        PyList::new(py, numbers)
    }

    /// What a share or a node does with the motors when this client leaves: the arguments of `close`.
    #[pyo3(signature = (*, stop, off))]
    fn end_with(&self, py: Python<'_>, stop: bool, off: bool) -> PyResult<()> {
        let bus = self.bus.get(py)?;
        py.detach(|| bus.end_with(ending(stop, off)));
        Ok(())
    }

    /// Closes the port after the exchanges under way. `stop` first stops the moving motors, `off`
    /// switches them off. Returns the motors that did not acknowledge it, and why. A second call
    /// does nothing.
    #[pyo3(signature = (*, stop, off))]
    fn close(&self, py: Python<'_>, stop: bool, off: bool) -> Vec<(u8, PyErr)> {
        let action = if off { StopAction::Off } else { StopAction::Stop };
        let halt = |bus: &Client| {
            bus.abandon();
            let stop_now = || bus.stop_on_drop().with(action).stop_now();
            if stop { self.deafness.during(stop_now) } else { Vec::new() }
        };
        let stopped = self.bus.close(py, halt);
        py.detach(|| self.threads.iter().for_each(Threads::end));
        not_stopped(py, stopped)
    }

    /// Whether it is closed.
    #[getter]
    fn is_closed(&self) -> bool {
        self.bus.is_closed()
    }

    /// The port's name.
    #[getter]
    fn port(&self) -> &str {
        self.bus.port()
    }
}

/// The motors that may still move, and why.
pub(crate) fn not_stopped(py: Python<'_>, stopped: Vec<Stopped>) -> Vec<(u8, PyErr)> {
    let failed = stopped
        .into_iter()
        .filter_map(|one| one.result.err().map(|error| (one.id.number(), rmd_error(py, &error))));
    failed.collect()
}

/// Torque currents of motors 1 to 4, A.
pub(crate) fn four_currents(py: Python<'_>, amps: [f64; 4]) -> PyResult<SetTorque4> {
    let mut torques = [IqCommand(0); 4];
    for (slot, amps) in torques.iter_mut().zip(amps) {
        *slot = wanted(py, amps)?;
    }
    Ok(SetTorque4(torques))
}

pub(crate) fn motor_ids(py: Python<'_>, ids: Vec<i64>) -> PyResult<MotorSet> {
    ids.into_iter().map(|id| motor_id(py, id)).collect()
}

pub(crate) fn scan_result(py: Python<'_>, found: ScanResult) -> PyResult<Py<PyAny>> {
    let nothing = || py.None();
    let row = match found {
        ScanResult::Motor(id, status) => {
            let status = said(py, "Status", &status, None)?;
            (id.number(), "motor", status, nothing())
        }
        ScanResult::Foreign(id, dialect) => {
            let dialect = dialect.to_string().into_py_any(py)?;
            (id.number(), "foreign", nothing(), dialect)
        }
        ScanResult::Echo(id) => (id.number(), "echo", nothing(), nothing()),
        ScanResult::Shared(id) => (id.number(), "shared", nothing(), nothing()),
    };
    values::scan_result(py, row)
}
