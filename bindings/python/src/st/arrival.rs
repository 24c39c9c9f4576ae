//! Following the motor of an ST drive to its target.

use motorlink::st::{
    ARRIVAL_TOLERANCE_RAD, ArrivalWatch, Error, MotorNumber, PositionMove, Profile,
};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use super::request::motor_number;
use crate::arrival::{Arrival, options};
use crate::error::{invalid_value, st_error};

/// Follows a motor in this move.
#[pyfunction]
pub(crate) fn st_arrival(
    py: Python<'_>,
    motor: i64,
    angle_rad: f32,
    duration_s: f32,
    tolerance_rad: Option<f64>,
    timeout: Option<f64>,
) -> PyResult<Arrival> {
    let (tolerance_rad, timeout) = options(py, tolerance_rad, timeout)?;
    let Some(motor) = MotorNumber::new(motor_number(py, motor)?) else {
        return Err(invalid_value(py, "only motors 1 to 7 can be waited for; nothing was sent"));
    };
    let target = PositionMove { angle_rad, duration_s };
    let tolerance_rad = tolerance_rad.unwrap_or(ARRIVAL_TOLERANCE_RAD);
    Ok(Arrival::new(
        ArrivalWatch::new(target, tolerance_rad, timeout),
        |py, register| register.0.into_py_any(py),
        |register, data| register.decode(Profile::Mcsdk54, data),
        |py, position_rad| position_rad.into_py_any(py),
        move |py, why| st_error(py, &Error::NotArrived { motor, why }),
    ))
}
