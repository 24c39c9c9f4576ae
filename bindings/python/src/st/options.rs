//! Options of a line with an ST drive, for blocking clients and for event loops.

use motorlink::st::{Limits, Options, Recovery};
use pyo3::prelude::*;

use super::scale::Scale;
use crate::error::invalid_value;
use crate::number::{limit, span};

/// The checked arguments of `open`.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StOptions(pub(crate) Options);

#[pymethods]
impl StOptions {
    #[new]
    #[pyo3(signature = (
        *, profile, timeout, recovery, speed_limit_rpm, current_limit, full_scale_amps,
    ))]
    fn new(
        py: Python<'_>,
        profile: &str,
        timeout: f64,
        recovery: &str,
        speed_limit_rpm: Option<f64>,
        current_limit: Option<f64>,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::new(py, profile, full_scale_amps)?;
        let limits = limits(py, scale, speed_limit_rpm, current_limit)?;
        let mut options = Options { profile: scale.profile, limits, ..Options::default() };
        options.timeout = span(py, "a timeout", timeout)?;
        options.recovery = match recovery {
            "drain" => Recovery::Drain,
            "pad" => Recovery::Pad,
            "none" => Recovery::None,
            other => {
                let known = "give `drain`, `pad` or `none`";
                return Err(invalid_value(py, format_args!("unknown recovery `{other}`: {known}")));
            }
        };
        Ok(StOptions(options))
    }
}

/// Limits in rpm and in the unit of currents. A limit is rounded towards 0.
fn limits(
    py: Python<'_>,
    scale: Scale,
    speed: Option<f64>,
    current: Option<f64>,
) -> PyResult<Limits> {
    let (ampere, unit) = scale.current();
    let speed_rpm = speed.map(|speed| limit(py, speed, 1.0, "rpm")).transpose()?;
    let current_s16a = current.map(|current| limit(py, current, ampere, unit)).transpose()?;
    Ok(Limits { speed_rpm, current_s16a })
}
