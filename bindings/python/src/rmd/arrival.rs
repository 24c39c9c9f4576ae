//! Following an RMD motor to its target, for both APIs: requests and times in, replies out.

use motorlink::rmd::{
    ArrivalStep, ArrivalWatch, CentiDegrees, Code, Error, MotorId, NotArrived, SetPosition,
    SetPositionLimited, SetSingleTurnPosition, SetSingleTurnPositionLimited, SpeedLimit, Target,
};
use motorlink_proto::rmd::Payload;
use motorlink_proto::time::Micros;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use super::request::{RmdRequest, eight, motor_id, said};
use crate::error::{invalid_value, rmd_error};
use crate::number::{span, wanted};
use crate::sampling::{instant, seconds};

/// Says what to ask a motor until it has arrived.
#[pyclass(module = "motorlink._core")]
pub(crate) struct RmdArrival {
    motor: MotorId,
    target: Target,
    max_speed: Option<SpeedLimit>,
    tolerance: CentiDegrees,
    timeout: Option<Micros>,
    watch: Option<ArrivalWatch>,
}

#[pymethods]
impl RmdArrival {
    /// For a motor and its request to move.
    #[new]
    fn new(
        py: Python<'_>,
        motor: i64,
        request: &RmdRequest,
        tolerance_degrees: f64,
        timeout: Option<f64>,
    ) -> PyResult<Self> {
        let data = request.data();
        let (target, max_speed) = match Code::from(data[0]) {
            Code::SetPositionLimited => {
                let it = SetPositionLimited::decode(&data);
                (Target::MultiTurn(it.angle), Some(it.max_speed))
            }
            Code::SetSingleTurnPosition => {
                (Target::SingleTurn(SetSingleTurnPosition::decode(&data).angle), None)
            }
            Code::SetSingleTurnPositionLimited => {
                let it = SetSingleTurnPositionLimited::decode(&data);
                (Target::SingleTurn(it.angle), Some(it.max_speed))
            }
            _ => (Target::MultiTurn(SetPosition::decode(&data).angle), None),
        };
        let tolerance: CentiDegrees = wanted(py, tolerance_degrees)?;
        if tolerance_degrees < 0.0 {
            return Err(invalid_value(py, "a tolerance is 0 or more; nothing was sent"));
        }
        let timeout = timeout.map(|timeout| span(py, "a timeout", timeout)).transpose()?;
        let (motor, timeout) = (motor_id(py, motor)?, timeout.map(Into::into));
        Ok(RmdArrival { motor, target, max_speed, tolerance, timeout, watch: None })
    }

    /// The next step at this time of the port's clock, s, with what it needs: `ask` and a request,
    /// `confirm`, `wait` and s, `done` and the motion, `silent`.
    fn next(&mut self, py: Python<'_>, now: f64) -> PyResult<(&'static str, Py<PyAny>)> {
        let now = instant(now);
        let Self { target, max_speed, tolerance, timeout, .. } = *self;
        let watch = self
            .watch
            .get_or_insert_with(|| ArrivalWatch::new(now, target, tolerance, timeout, max_speed));
        Ok(match watch.next(now) {
            ArrivalStep::Ask(data) => ("ask", Py::new(py, RmdRequest::for_bytes(data))?.into_any()),
            ArrivalStep::Confirm => ("confirm", py.None()),
            ArrivalStep::Wait(until) => ("wait", seconds(until.since(now)).into_py_any(py)?),
            ArrivalStep::Done(Ok(motion)) => ("done", said(py, "MotionStatus", &motion)?),
            ArrivalStep::Done(Err(NotArrived::Silent { .. })) => ("silent", py.None()),
            ArrivalStep::Done(Err(why)) => {
                return Err(rmd_error(py, &Error::NotArrived { motor: self.motor, why }));
            }
        })
    }

    /// Takes the reply to the last request.
    fn replied(&mut self, py: Python<'_>, now: f64, data: &[u8]) {
        match eight(py, data) {
            Ok(data) => self.watch.iter_mut().for_each(|watch| watch.replied(&data)),
            Err(_) => self.lost(now),
        }
    }

    /// The replies went to their own requests.
    fn confirmed(&mut self, now: f64) {
        self.watch.iter_mut().for_each(|watch| watch.confirmed(instant(now)));
    }

    /// The last reply cannot be trusted.
    fn lost(&mut self, now: f64) {
        self.watch.iter_mut().for_each(|watch| watch.lost(instant(now)));
    }
}
