//! ST's Motor Control Protocol.

mod arrival;
mod client;
mod frame;
mod options;
mod profile;
mod reply;
mod request;
mod sample;
mod scale;
mod scan;
mod starting;
mod verified;

pub(crate) use arrival::st_arrival;
pub(crate) use client::{StClient, frame_code, not_stopped};
pub(crate) use options::StOptions;
pub(crate) use profile::named as profile_named;
pub(crate) use reply::Answer;
pub(crate) use request::{StRequest, motor_number, no_such_motor};
pub(crate) use sample::{StSampling, Wanted as StWanted};
pub(crate) use scale::Scale;
pub(crate) use scan::{st_scan_baud, st_scan_rates};
pub(crate) use starting::StStarting;
pub(crate) use verified::StVerifiedWrite;

use motorlink::st::register::{Feature, Features, Writing};
use motorlink::st::{Flags, RegisterId};
use pyo3::prelude::*;

use crate::error::{invalid_value, unknown_register};
use crate::values;
use scale::register;

/// A register by name or number, with its unit for a motor of this full scale.
#[pyfunction]
#[pyo3(signature = (name, profile = "spec", full_scale_amps = None))]
pub(crate) fn st_register(
    py: Python<'_>,
    name: &Bound<'_, PyAny>,
    profile: &str,
    full_scale_amps: Option<f64>,
) -> PyResult<Py<PyAny>> {
    let scale = Scale::new(py, profile, full_scale_amps)?;
    let register = register(name)?;
    let (Some(shape), Some(text)) = (register.shape(), register.text()) else {
        let id = register.0;
        return Err(unknown_register(py, format_args!("register {id:#04x} is unknown")));
    };
    let built = Features::NONE.with(shape.feature);
    values::register_info(
        py,
        (
            register.0,
            text.name,
            scale.unit(register),
            shape.ty(scale.profile).name(),
            shape.access.name(),
            text.doc,
            shape.feature.name(),
            shape.read_size(scale.profile, built).is_some(),
            matches!(shape.writing(scale.profile, built), Writing::Takes(_)),
        ),
    )
}

/// The number of a motor, 1 to 7.
#[pyfunction]
pub(crate) fn st_motor(py: Python<'_>, number: i64) -> PyResult<u8> {
    match motor_number(py, number)? {
        0 => Err(invalid_value(
            py,
            "motor 0 does not exist: motor numbers are 1 to 7. In a frame, 0 means the motor of the \
             previous request; give 1 for a drive with one motor",
        )),
        number => Ok(number),
    }
}

/// The name of a register, or its hexadecimal number if it has none.
#[pyfunction]
pub(crate) fn st_register_name(#[pyo3(from_py_with = register)] name: RegisterId) -> String {
    name.to_string()
}

/// Names of the registers that drives of a profile may have, in the order of their numbers.
#[pyfunction]
#[pyo3(signature = (profile = "spec"))]
pub(crate) fn st_registers(py: Python<'_>, profile: &str) -> PyResult<Vec<&'static str>> {
    let profile = profile::named(py, profile)?;
    let every = Feature::ALL.iter().fold(Features::NONE, |all, &feature| all.with(feature));
    let there = |register: &RegisterId| {
        register.shape().is_some_and(|shape| {
            shape.read_size(profile, every).is_some()
                || matches!(shape.writing(profile, every), Writing::Takes(_))
                || shape.shows_on_dac(every)
        })
    };
    let known = RegisterId::all().filter(there);
    Ok(known.filter_map(|register| register.text().map(|text| text.name)).collect())
}

/// The faults of a FLAGS value as text.
#[pyfunction]
pub(crate) fn st_flags_text(bits: u32) -> String {
    Flags(bits).to_string()
}
