//! Gear ratios of the motors on a bus.

use motorlink::rmd::{GearRatio, MotorId, MotorSet};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyMapping;

use super::gear::gear;
use super::request::{RmdRequest, motor_id};
use crate::error::invalid_value;

/// The gear of each motor. A motor without one has values of the motor shaft.
#[derive(Clone, Copy)]
pub(crate) struct Gears([Option<GearRatio>; MotorId::COUNT]);

impl Gears {
    /// From the argument `gear_ratio` of `open`: of all motors, or by ID.
    pub(super) fn new(py: Python<'_>, given: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut gears = [None; MotorId::COUNT];
        let Some(given) = given else { return Ok(Gears(gears)) };
        if let Ok(ratio) = given.extract() {
            gears.fill(gear(py, Some(ratio))?);
            return Ok(Gears(gears));
        }
        for (id, ratio) in by_id(given).map_err(|_| wrong_type(given))? {
            gears[motor_id(py, id)?.index()] = gear(py, Some(ratio))?;
        }
        Ok(Gears(gears))
    }

    pub(crate) fn of(&self, id: MotorId) -> Option<GearRatio> {
        self.0[id.index()]
    }

    /// The ratio for Python.
    pub(crate) fn ratio(&self, py: Python<'_>, id: i64) -> PyResult<Option<f64>> {
        Ok(self.of(motor_id(py, id)?).map(GearRatio::ratio))
    }

    /// The motors with a gear.
    pub(super) fn motors(&self) -> MotorSet {
        MotorSet::ALL.filter(|id| self.of(*id).is_some()).collect()
    }

    /// Refuses a request with angles or speeds of another shaft than those of its motor.
    pub(crate) fn check(&self, py: Python<'_>, id: MotorId, request: &RmdRequest) -> PyResult<()> {
        let ratio = |gear: Option<GearRatio>| gear.map_or(1.0, GearRatio::ratio);
        let (own, given) = (ratio(self.of(id)), ratio(request.gear()));
        if own == given || !request.has_motion() {
            return Ok(());
        }
        Err(invalid_value(
            py,
            format_args!(
                "motor {id} has the gear ratio {own}, and this request {given}: make the request with \
                 gear_ratio={own}; nothing was sent"
            ),
        ))
    }
}

fn by_id(given: &Bound<'_, PyAny>) -> PyResult<Vec<(i64, f64)>> {
    given.cast::<PyMapping>()?.items()?.extract()
}

fn wrong_type(given: &Bound<'_, PyAny>) -> PyErr {
    PyTypeError::new_err(format!(
        "gear_ratio is a number, or a dict of numbers by ID, not {given:?}"
    ))
}
