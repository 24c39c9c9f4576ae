//! Following the motor of an ST drive to its target, for both APIs: registers and times in, values out.

use motorlink::st::{
    ArrivalWatch, Error, MotorNumber, NotArrived, PositionMove, Profile, RegisterId, Status,
};
use motorlink_proto::st::ArrivalStep;
use motorlink_proto::time::Micros;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use super::request::motor_number;
use crate::error::{invalid_value, st_error};
use crate::number::span;
use crate::sampling::{instant, seconds};

/// Says which registers to read until a motor has arrived.
#[pyclass(module = "motorlink._core")]
pub(crate) struct StArrival {
    motor: MotorNumber,
    target: PositionMove,
    tolerance_rad: f64,
    timeout: Option<Micros>,
    watch: Option<ArrivalWatch>,
    asked: RegisterId,
}

#[pymethods]
impl StArrival {
    /// For a motor and its move.
    #[new]
    fn new(
        py: Python<'_>,
        motor: i64,
        angle_rad: f32,
        duration_s: f32,
        tolerance_rad: f64,
        timeout: Option<f64>,
    ) -> PyResult<Self> {
        if !(tolerance_rad >= 0.0 && tolerance_rad.is_finite()) {
            return Err(invalid_value(py, "a tolerance is 0 or more; nothing was sent"));
        }
        let Some(motor) = MotorNumber::new(motor_number(py, motor)?) else {
            return Err(invalid_value(
                py,
                "only motors 1 to 7 can be waited for; nothing was sent",
            ));
        };
        let timeout = timeout.map(|timeout| span(py, "a timeout", timeout)).transpose()?;
        let (timeout, target) = (timeout.map(Into::into), PositionMove { angle_rad, duration_s });
        let asked = RegisterId::STATUS;
        Ok(StArrival { motor, target, tolerance_rad, timeout, watch: None, asked })
    }

    /// Refuses a motor that would not carry out a move now, by its STATUS.
    fn check(&self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        let status = Status::from(data.first().copied().unwrap_or_default());
        if ArrivalWatch::can_move(status) {
            return Ok(());
        }
        let why = NotArrived::NotRunning { status, remaining: f64::NAN };
        Err(st_error(py, &Error::NotArrived { motor: self.motor, why }))
    }

    /// The next step at this time of the port's clock, s, with what it needs: `ask` and a register,
    /// `confirm`, `wait` and s, `done` and the position, `silent`.
    fn next(&mut self, py: Python<'_>, now: f64) -> PyResult<(&'static str, Py<PyAny>)> {
        let now = instant(now);
        let Self { target, tolerance_rad, timeout, .. } = *self;
        let watch = self
            .watch
            .get_or_insert_with(|| ArrivalWatch::new(now, target, tolerance_rad, timeout));
        Ok(match watch.next(now) {
            ArrivalStep::Read(register) => {
                self.asked = register;
                ("ask", register.0.into_py_any(py)?)
            }
            ArrivalStep::Confirm => ("confirm", py.None()),
            ArrivalStep::Wait(until) => ("wait", seconds(until.since(now)).into_py_any(py)?),
            ArrivalStep::Done(Ok(position)) => ("done", position.into_py_any(py)?),
            ArrivalStep::Done(Err(NotArrived::Silent { .. })) => ("silent", py.None()),
            ArrivalStep::Done(Err(why)) => {
                return Err(st_error(py, &Error::NotArrived { motor: self.motor, why }));
            }
        })
    }

    /// Takes the bytes of the register that was read.
    fn replied(&mut self, now: f64, data: &[u8]) {
        let (now, register) = (instant(now), self.asked);
        self.watch.iter_mut().for_each(|watch| match register.decode(Profile::Mcsdk54, data) {
            Some(bits) => watch.replied(now, bits),
            None => watch.lost(now),
        });
    }

    /// The replies went to their own requests.
    #[pyo3(signature = (now))]
    fn confirmed(&mut self, now: f64) {
        // The watches of both protocols are called alike.
        let _ = now;
        self.watch.iter_mut().for_each(ArrivalWatch::confirmed);
    }

    /// The last reply cannot be trusted.
    fn lost(&mut self, now: f64) {
        self.watch.iter_mut().for_each(|watch| watch.lost(instant(now)));
    }
}
