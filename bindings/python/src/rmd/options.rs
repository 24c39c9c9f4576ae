//! Options of a CAN bus with RMD motors, for blocking clients and for event loops.

use motorlink::rmd::{CentiDegrees, IqCommand, Limits, Options, SpeedLimit};
use pyo3::prelude::*;

use crate::number::{limit, span};

/// The checked arguments of `open`.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdOptions(pub(crate) Options);

#[pymethods]
impl RmdOptions {
    #[new]
    #[pyo3(signature = (
        *, timeout, quarantine, current_limit_amps, speed_limit_dps, angle_limit_degrees,
    ))]
    fn new(
        py: Python<'_>,
        timeout: f64,
        quarantine: f64,
        current_limit_amps: Option<f64>,
        speed_limit_dps: Option<f64>,
        angle_limit_degrees: Option<f64>,
    ) -> PyResult<Self> {
        Ok(RmdOptions(Options {
            timeout: span(py, "a timeout", timeout)?,
            quarantine: span(py, "a quarantine", quarantine)?,
            limits: limits(py, current_limit_amps, speed_limit_dps, angle_limit_degrees)?,
            ..Options::default()
        }))
    }
}

/// Limits in the units of the fields. A limit is rounded towards 0.
pub(crate) fn limits(
    py: Python<'_>,
    current_limit_amps: Option<f64>,
    speed_limit_dps: Option<f64>,
    angle_limit_degrees: Option<f64>,
) -> PyResult<Limits> {
    let (ampere, degree) = (IqCommand::SCALE, CentiDegrees::SCALE);
    let current = current_limit_amps.map(|amps| limit(py, amps, ampere, IqCommand::SYMBOL));
    let speed = speed_limit_dps.map(|dps| limit(py, dps, SpeedLimit::SCALE, SpeedLimit::SYMBOL));
    let angle = angle_limit_degrees.map(|degrees| limit(py, degrees, degree, CentiDegrees::SYMBOL));
    Ok(Limits {
        current: current.transpose()?.map(IqCommand),
        speed: speed.transpose()?.map(SpeedLimit),
        angle: angle.transpose()?.map(CentiDegrees),
    })
}
