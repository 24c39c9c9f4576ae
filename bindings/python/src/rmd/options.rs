//! Options of a CAN bus with RMD motors, for blocking clients and for event loops.

use motorlink::rmd::{
    CentiDegrees, GearRatio, IqCommand, Limits, MotorId, Options, Quantity, SpeedLimit,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::gear::behind;
use super::gears::Gears;
use crate::number::{limit, span};

/// The checked arguments of `open`.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RmdOptions {
    pub(crate) options: Options,
    pub(crate) gears: Gears,
    /// The limits of motors with a gear.
    pub(crate) geared: Vec<(MotorId, Limits)>,
}

#[pymethods]
impl RmdOptions {
    #[new]
    #[pyo3(signature = (
        *, timeout, quarantine, current_limit_amps, speed_limit_dps, angle_limit_degrees, gear_ratio,
    ))]
    fn new(
        py: Python<'_>,
        timeout: f64,
        quarantine: f64,
        current_limit_amps: Option<f64>,
        speed_limit_dps: Option<f64>,
        angle_limit_degrees: Option<f64>,
        gear_ratio: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let limits =
            |gear| limits(py, current_limit_amps, speed_limit_dps, angle_limit_degrees, gear);
        let options = Options {
            timeout: span(py, "a timeout", timeout)?,
            quarantine: span(py, "a quarantine", quarantine)?,
            limits: limits(None)?,
            ..Options::default()
        };
        let gears = Gears::new(py, gear_ratio)?;
        let geared: PyResult<_> =
            gears.motors().map(|id| Ok((id, limits(gears.of(id))?))).collect();
        Ok(RmdOptions { options, gears, geared: geared? })
    }
}

/// Limits in the units of the fields, of a motor with this gear. A limit is rounded towards 0.
fn limits(
    py: Python<'_>,
    current_limit_amps: Option<f64>,
    speed_limit_dps: Option<f64>,
    angle_limit_degrees: Option<f64>,
    gear: Option<GearRatio>,
) -> PyResult<Limits> {
    let ampere = IqCommand::SCALE;
    let (speed_digit, degree) =
        (behind(gear, SpeedLimit::UNIT).digit, behind(gear, CentiDegrees::UNIT).digit);
    let current = current_limit_amps.map(|amps| limit(py, amps, ampere, IqCommand::SYMBOL));
    let speed = speed_limit_dps.map(|dps| limit(py, dps, speed_digit, SpeedLimit::SYMBOL));
    let angle = angle_limit_degrees.map(|degrees| limit(py, degrees, degree, CentiDegrees::SYMBOL));
    Ok(Limits {
        current: current.transpose()?.map(IqCommand),
        speed: speed.transpose()?.map(SpeedLimit),
        angle: angle.transpose()?.map(CentiDegrees),
    })
}

/// New values of some limits.
pub(crate) struct LimitChange {
    limits: Limits,
    is_current_given: bool,
    is_speed_given: bool,
    is_angle_given: bool,
}

impl LimitChange {
    /// From the arguments with the names of [`RmdOptions`] that are given, for a motor with this gear.
    pub(crate) fn new(
        py: Python<'_>,
        given: Option<&Bound<'_, PyDict>>,
        gear: Option<GearRatio>,
    ) -> PyResult<Self> {
        let names = ["current_limit_amps", "speed_limit_dps", "angle_limit_degrees"];
        let mut values: [Option<Option<f64>>; 3] = [None; 3];
        for (name, value) in given.into_iter().flatten() {
            let name: String = name.extract()?;
            let place = names.iter().position(|known| *known == name);
            let unknown = || PyTypeError::new_err(format!("unknown limit `{name}`"));
            values[place.ok_or_else(unknown)?] = Some(value.extract()?);
        }
        let [current, speed, angle] = values;
        Ok(LimitChange {
            limits: limits(py, current.flatten(), speed.flatten(), angle.flatten(), gear)?,
            is_current_given: current.is_some(),
            is_speed_given: speed.is_some(),
            is_angle_given: angle.is_some(),
        })
    }

    /// The changed limits.
    pub(crate) fn of(&self, mut limits: Limits) -> Limits {
        if self.is_current_given {
            limits.current = self.limits.current;
        }
        if self.is_speed_given {
            limits.speed = self.limits.speed;
        }
        if self.is_angle_given {
            limits.angle = self.limits.angle;
        }
        limits
    }
}
