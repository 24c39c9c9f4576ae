//! Sampling registers: through data segments if the drive has them, otherwise one by one.

use std::sync::{Mutex, MutexGuard, PoisonError};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink::st::register::Access;
use motorlink::st::{Client, Error, LimitError, Profile, RegisterId, SEGMENT_REGISTERS};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};

use super::profile;
use super::request::{StRequest, motor_number};
use super::scale::{Scale, register};
use crate::error::st_error;
use crate::sampling::{Plan, Rows, Taken, cell};

/// What is sampled of one motor: number, registers, full scale of current in A.
pub(super) type Motor<'py> = (i64, Vec<Bound<'py, PyAny>>, Option<f64>);

/// The registers of one motor.
struct Lane {
    motor: u8,
    registers: Vec<RegisterId>,
    scale: Scale,
    /// The data segment that has the registers.
    segment: Option<u8>,
}

/// The state of a row.
#[derive(Clone, Copy, PartialEq, Eq)]
enum At {
    /// Before the first row: the lane's segment is configured.
    Preparing(usize),
    /// A lane's segment is read. The flag: it was configured again.
    Segment(usize, bool),
    /// A lane's segment is configured again, because the drive lost it.
    Configuring(usize),
    /// A register of a lane is read.
    Single(usize, usize),
    Whole,
}

/// Rows without the line. Call [`request`](Self::request), then [`answered`](Self::answered) or
/// [`refused`](Self::refused), until there are no more requests.
pub(super) struct Reading {
    lanes: Vec<Lane>,
    raw: bool,
    at: At,
    values: Vec<[u8; 8]>,
}

impl Reading {
    /// Plans the reads. Each of `segments` may be configured for one motor.
    pub(super) fn new(
        py: Python<'_>,
        profile: Profile,
        motors: Vec<Motor<'_>>,
        segments: Vec<u8>,
        raw: bool,
    ) -> PyResult<Self> {
        let mut segments = segments.into_iter();
        let mut lanes = Vec::with_capacity(motors.len());
        for (motor, names, full_scale_amps) in motors {
            let scale = Scale::new(py, profile.name(), full_scale_amps)?;
            let registers: PyResult<Vec<_>> = names.iter().map(register).collect();
            let (motor, registers) = (motor_number(py, motor)?, registers?);
            let segment = segments.next().filter(|_| is_segment(profile, &registers));
            lanes.push(Lane { motor, registers, scale, segment });
        }
        let mut reading = Reading { lanes, raw, at: At::Whole, values: Vec::new() };
        reading.at = reading.preparing(0);
        Ok(reading)
    }

    /// Begins a row.
    fn begin(&mut self) {
        self.values.clear();
        self.at = self.lane(0);
    }

    /// The next request of the row, or of the preparation before the first row.
    fn request(&self) -> Option<(u8, StRequest)> {
        let (lane, configures) = match self.at {
            At::Preparing(lane) | At::Configuring(lane) => (lane, true),
            At::Segment(lane, _) | At::Single(lane, _) => (lane, false),
            At::Whole => return None,
        };
        let Lane { motor, registers, scale, segment } = &self.lanes[lane];
        let request = match (self.at, *segment) {
            (At::Single(_, n), _) => StRequest::reading(*scale, registers[n], self.raw),
            (_, Some(segment)) if configures => StRequest::choosing(segment, registers),
            (_, Some(segment)) => StRequest::sampling(*scale, segment, registers, self.raw),
            (_, None) => return None,
        };
        Some((*motor, request))
    }

    /// The request was acknowledged with these values.
    fn answered(&mut self, values: impl IntoIterator<Item = [u8; 8]>) {
        self.values.extend(values);
        self.at = match self.at {
            At::Preparing(lane) => self.preparing(lane + 1),
            At::Configuring(lane) => At::Segment(lane, true),
            At::Single(lane, n) if n + 1 < self.lanes[lane].registers.len() => {
                At::Single(lane, n + 1)
            }
            At::Segment(lane, _) | At::Single(lane, _) => self.lane(lane + 1),
            At::Whole => At::Whole,
        };
    }

    /// The drive refused the request. Returns whether the row continues: register by register if
    /// the drive has no segments, with a segment configured again if the drive was restarted.
    fn refused(&mut self) -> bool {
        self.at = match self.at {
            At::Preparing(lane) => {
                self.lanes[lane].segment = None;
                self.preparing(lane + 1)
            }
            At::Configuring(lane) => {
                self.lanes[lane].segment = None;
                self.lane(lane)
            }
            At::Segment(lane, false) => At::Configuring(lane),
            At::Segment(_, true) | At::Single(..) | At::Whole => return false,
        };
        true
    }

    /// The next lane to prepare, from this one.
    fn preparing(&self, from: usize) -> At {
        let next = (from..self.lanes.len()).find(|lane| self.lanes[*lane].segment.is_some());
        next.map_or(At::Whole, At::Preparing)
    }

    /// The beginning of a lane.
    fn lane(&self, lane: usize) -> At {
        match self.lanes.get(lane) {
            Some(Lane { segment: Some(_), .. }) => At::Segment(lane, false),
            Some(Lane { registers, .. }) if registers.is_empty() => self.lane(lane + 1),
            Some(_) => At::Single(lane, 0),
            None => At::Whole,
        }
    }

    /// Sends the requests and takes their replies.
    fn carry_out(&mut self, client: &Client) -> Result<(), Error> {
        while let Some((motor, request)) = self.request() {
            let read = |payload: &[u8]| {
                let answer = request.understand(payload)?;
                let plausible = request.plausible(client.port(), motor, &answer);
                Some((plausible, request.cells(answer)?))
            };
            let read = client.exchange(motor, &request.request(), read);
            match read.and_then(|(plausible, values)| plausible.map(|()| values)) {
                Ok(values) => self.answered(values),
                Err(error) if may_lack_segment(&error) && self.refused() => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Whether a drive that lost its segment or has none, or a port that was opened again, causes this error.
fn may_lack_segment(error: &Error) -> bool {
    let is_not_configured =
        matches!(error, Error::Limit { exceeded: LimitError::NotConfigured { .. }, .. });
    error.is_refusal() || is_not_configured
}

/// Whether these registers need a segment, and can have one.
fn is_segment(profile: Profile, registers: &[RegisterId]) -> bool {
    let only_there =
        |register: &RegisterId| register.shape().is_some_and(|shape| shape.access == Access::Dac);
    let known = registers.iter().all(|register| register.shape().is_some());
    // In the other profile the same frame codes command the motor.
    let possible = profile == Profile::Spec && known && registers.len() <= SEGMENT_REGISTERS;
    possible && (registers.len() > 1 || registers.iter().any(only_there))
}

/// Rows of registers. A blocking client calls [`StSampling::run`]. An event loop sends one request
/// after the other.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StSampling(Mutex<(Rows, Reading)>);

impl StSampling {
    fn lock(&self) -> MutexGuard<'_, (Rows, Reading)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Samples until the end, an error, or `most` rows. Returns the new rows in each case. With
    /// `skip` a line that fails costs only the row. So does a signal handler that uses it.
    pub(super) fn run(
        &self,
        client: &Client,
        clock: &Clock,
        look: impl Fn(Python<'_>) -> PyResult<()>,
        skip: bool,
        most: Option<u64>,
    ) -> (Taken, PyResult<()>) {
        let (rows, reading) = &mut *self.lock();
        let raised = |error: Error| Python::attach(|py| st_error(py, &error));
        let prepared = reading.carry_out(client).map_err(raised);
        let outcome = prepared.and_then(|()| {
            rows.run(clock, &look, most, |rows| {
                reading.begin();
                match reading.carry_out(client) {
                    Ok(()) => rows.push(&reading.values),
                    Err(error) if skip && error.is_line_failure() => {}
                    Err(Error::Port(PortError::Overtaken { .. })) => Python::attach(&look)?,
                    Err(error) => return Err(raised(error)),
                }
                Ok(())
            })
        });
        (rows.take(), outcome)
    }
}

#[pymethods]
impl StSampling {
    /// Registers of motors `(motor, registers, full_scale_amps)`, each motor in one of `segments`
    /// if possible.
    #[new]
    fn new(
        py: Python<'_>,
        profile: &str,
        motors: Vec<Motor<'_>>,
        segments: Vec<u8>,
        rate: f64,
        seconds: Option<f64>,
        raw: bool,
    ) -> PyResult<Self> {
        let rows = Rows::new(Plan::new(py, rate, seconds)?);
        let reading = Reading::new(py, profile::named(py, profile)?, motors, segments, raw)?;
        Ok(StSampling(Mutex::new((rows, reading))))
    }

    /// The wait at this time of the event loop, s. 0 begins a row, `None` is the end.
    fn after(&self, py: Python<'_>, now: f64) -> PyResult<Option<f64>> {
        let (rows, reading) = &mut *self.lock();
        let wait = rows.after_seconds(py, now)?;
        if wait == Some(0.0) {
            reading.begin();
        }
        Ok(wait)
    }

    /// The next request and its motor; `None` if the row is complete.
    fn request(&self) -> Option<(u8, StRequest)> {
        self.lock().1.request()
    }

    /// Takes the value of that request.
    fn answered(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let reading = &mut self.lock().1;
        let cells = |value: Bound<'_, PyAny>| match reading.raw {
            true => value.extract().map(|digits| cell(true, digits, 0.0)),
            false => value.extract().map(|value| cell(false, 0, value)),
        };
        let cells: PyResult<Vec<_>> = match value.cast::<PyDict>() {
            Ok(values) => values.values().iter().map(cells).collect(),
            Err(_) if value.is_none() => Ok(Vec::new()),
            Err(_) => cells(value.clone()).map(|cell| vec![cell]),
        };
        reading.answered(cells?);
        Ok(())
    }

    /// The drive refused that request; returns whether the row continues.
    fn refused(&self) -> bool {
        self.lock().1.refused()
    }

    /// Ends the row.
    fn push(&self) {
        let (rows, reading) = &mut *self.lock();
        rows.push(&reading.values);
    }

    /// The new rows, each a time in s and values of eight bytes, and the skipped instants.
    fn take<'py>(&self, py: Python<'py>) -> (Bound<'py, PyByteArray>, u64) {
        self.lock().0.take().into_python(py)
    }
}
