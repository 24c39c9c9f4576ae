//! Sampling values of motors, all of them in the same cycles.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink::rmd::{Client, Error, GearRatio, MotorId};
use motorlink_proto::rmd::{Code, Field};
use motorlink_telemetry::signal::Quantity;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use super::gear::{behind, gear};
use super::request::{RmdRequest, motor_id};
use crate::error::{invalid_value, rmd_error};
use crate::sampling::{Plan, Rows, Taken, cell};

/// The quantities of one motor.
struct Lane {
    id: MotorId,
    gear: Option<GearRatio>,
    /// The command that reads each quantity, and where it is in the reply.
    quantities: Vec<(Code, &'static Field)>,
}

/// The requests of a row, and its values in the replies.
struct Questions {
    lanes: Vec<Lane>,
    /// One request per motor in each cycle, until all requests are sent.
    cycles: Vec<Vec<(MotorId, [u8; 8])>>,
    raw: bool,
}

/// A motor's ID, its quantities and its gear ratio.
type Wanted = (i64, Vec<String>, Option<f64>);

/// The replies of a row: motor, command, reply.
type Replies = Vec<(MotorId, Code, [u8; 8])>;

impl Questions {
    /// The requests for the quantities of motors.
    fn new(py: Python<'_>, motors: Vec<Wanted>, raw: bool) -> PyResult<Self> {
        let mut lanes = Vec::with_capacity(motors.len());
        for (id, names, gear_ratio) in motors {
            let named = |name: &String| Quantity::named(name).map(Quantity::read);
            let quantities: Result<_, _> = names.iter().map(named).collect();
            let quantities = quantities.map_err(|unknown| invalid_value(py, unknown))?;
            let (id, gear) = (motor_id(py, id)?, gear(py, gear_ratio)?);
            lanes.push(Lane { id, gear, quantities });
        }
        let mut cycles: Vec<Vec<(MotorId, [u8; 8])>> = Vec::new();
        for lane in &lanes {
            let mut codes: Vec<Code> = Vec::new();
            for (code, _) in &lane.quantities {
                if !codes.contains(code) {
                    codes.push(*code);
                }
            }
            cycles.resize_with(cycles.len().max(codes.len()), Vec::new);
            for (cycle, code) in cycles.iter_mut().zip(codes) {
                // The request of a read is its code.
                cycle.push((lane.id, [code.number(), 0, 0, 0, 0, 0, 0, 0]));
            }
        }
        Ok(Questions { lanes, cycles, raw })
    }

    fn values(&self, replies: &Replies) -> Vec<[u8; 8]> {
        let mut values = Vec::new();
        for lane in &self.lanes {
            for (code, field) in &lane.quantities {
                let reply = replies.iter().find(|(id, of, _)| *id == lane.id && of == code);
                // Each request has a reply, otherwise the row has failed.
                let digits = reply.map_or(0, |(.., reply)| field.raw(reply));
                let value = behind(lane.gear, field.scale).value(digits);
                values.push(cell(self.raw, digits, value));
            }
        }
        values
    }
}

fn replies(bus: &Client, questions: &Questions) -> Result<Replies, Error> {
    let mut replies = Replies::new();
    for requests in &questions.cycles {
        let mut failed = None;
        bus.cycle(requests, |id, outcome| match outcome {
            Ok(reply) => {
                let asked = requests.iter().find(|(of, _)| *of == id);
                replies.extend(asked.map(|(_, request)| (id, Code::from(request[0]), reply)));
            }
            Err(error) => failed = Some(error),
        })?;
        if let Some(error) = failed {
            return Err(error);
        }
    }
    Ok(replies)
}

/// Rows of quantities. A blocking client calls [`RmdSampling::run`]. An event loop sends one cycle
/// after the other.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdSampling {
    rows: Mutex<Rows>,
    questions: Questions,
}

impl RmdSampling {
    fn lock(&self) -> MutexGuard<'_, Rows> {
        self.rows.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows in each case. With
    /// `skip` a motor that does not reply costs only the row. So does a signal handler that uses
    /// the bus.
    pub(super) fn run(
        &self,
        bus: &Client,
        clock: &Clock,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        skip: bool,
        most: Option<u64>,
    ) -> (Taken, PyResult<()>) {
        let mut rows = self.lock();
        let outcome = rows.run(clock, &look, most, |rows| {
            match replies(bus, &self.questions) {
                Ok(replies) => rows.push(&self.questions.values(&replies)),
                Err(error) if skip && error.is_line_failure() => {}
                Err(Error::Port(PortError::Overtaken { .. })) => Python::attach(&look)?,
                Err(error) => return Err(Python::attach(|py| rmd_error(py, &error))),
            }
            Ok(())
        });
        (rows.take(), outcome)
    }
}

#[pymethods]
impl RmdSampling {
    /// Quantities of motors.
    #[new]
    fn new(
        py: Python<'_>,
        motors: Vec<Wanted>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<Self> {
        let rows = Mutex::new(Rows::new(Plan::new(py, rate, seconds)?));
        Ok(RmdSampling { rows, questions: Questions::new(py, motors, raw)? })
    }

    /// The wait at this time of the event loop, s. 0 begins a row, `None` is the end.
    fn after(&self, py: Python<'_>, now: f64) -> PyResult<Option<f64>> {
        self.lock().after_seconds(py, now)
    }

    /// The cycles of a row: requests by ID. Their replies are bytes.
    #[getter]
    fn cycles(&self) -> Vec<BTreeMap<u8, RmdRequest>> {
        let named =
            |&(id, request): &(MotorId, [u8; 8])| (id.number(), RmdRequest::for_bytes(request));
        self.questions.cycles.iter().map(|cycle| cycle.iter().map(named).collect()).collect()
    }

    /// Ends the row with the replies of its cycles.
    fn push(&self, py: Python<'_>, answers: Vec<BTreeMap<i64, [u8; 8]>>) -> PyResult<()> {
        let mut replies = Replies::new();
        for (cycle, answers) in self.questions.cycles.iter().zip(answers) {
            for (id, reply) in answers {
                let id = motor_id(py, id)?;
                let asked = cycle.iter().find(|(of, _)| *of == id);
                replies.extend(asked.map(|(_, request)| (id, Code::from(request[0]), reply)));
            }
        }
        self.lock().push(&self.questions.values(&replies));
        Ok(())
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
