//! Following an RMD motor to its target.

use motorlink::rmd::{
    ARRIVAL_TOLERANCE, ArrivalWatch, CentiDegrees, Code, Error, Quantity, SetPosition,
    SetPositionLimited, SetSingleTurnPosition, SetSingleTurnPositionLimited, Target,
};
use motorlink_proto::rmd::Payload;
use pyo3::prelude::*;

use super::gear::behind;
use super::request::{RmdRequest, motor_id, said};
use crate::arrival::{Arrival, options};
use crate::error::{invalid_value, rmd_error};

/// Follows a motor after this request to move.
#[pyfunction]
pub(crate) fn rmd_arrival(
    py: Python<'_>,
    motor: i64,
    request: &RmdRequest,
    tolerance_degrees: Option<f64>,
    timeout: Option<f64>,
) -> PyResult<Arrival> {
    let data = request.data();
    let (target, max_speed) = match Code::from(data[0]) {
        Code::SetPositionLimited => {
            let it = SetPositionLimited::decode(&data);
            (Target::MultiTurn(it.angle), Some(it.max_speed))
        }
        Code::SetSingleTurnPosition => {
            let it = SetSingleTurnPosition::decode(&data);
            (Target::SingleTurn { angle: it.angle, direction: it.direction }, None)
        }
        Code::SetSingleTurnPositionLimited => {
            let it = SetSingleTurnPositionLimited::decode(&data);
            let target = Target::SingleTurn { angle: it.angle, direction: it.direction };
            (target, Some(it.max_speed))
        }
        _ => (Target::MultiTurn(SetPosition::decode(&data).angle), None),
    };
    let (degrees, timeout) = options(py, tolerance_degrees, timeout)?;
    let gear = request.gear();
    let digits = degrees.map(|degrees| behind(gear, CentiDegrees::UNIT).wanted(degrees));
    let digits = digits
        .transpose()
        .map_err(|why| invalid_value(py, format_args!("{why}; nothing was sent")))?;
    let tolerance = digits.map_or(ARRIVAL_TOLERANCE, CentiDegrees::from_digits);
    let motor = motor_id(py, motor)?;
    Ok(Arrival::new(
        ArrivalWatch::new(target, tolerance, timeout, max_speed),
        |py, request| Ok(Py::new(py, RmdRequest::for_bytes(request))?.into_any()),
        |_, data| data.try_into().ok(),
        move |py, arrived| said(py, "MotionStatus", &arrived.motion, gear),
        move |py, why| rmd_error(py, &Error::NotArrived { motor, why }),
    ))
}
