//! The RMD protocol over CAN, V1.62.

mod arrival;
mod client;
mod gear;
mod gears;
mod options;
mod request;
mod sample;

pub(crate) use arrival::rmd_arrival;
pub(crate) use client::{RmdClient, four_currents, motor_ids, not_stopped, scan_result};
pub(crate) use gear::rmd_encoder_degrees;
pub(crate) use gears::Gears;
pub(crate) use options::{LimitChange, RmdOptions};
pub(crate) use request::{RmdRequest, motor_id, rmd_encode, rmd_full_turn_tolerance};
pub(crate) use sample::{RmdSampling, Wanted as RmdWanted, rmd_quantities};

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Code, Direction, Errors, Field, MotorId, Payload, SetTorque4, TORQUE4_ID, describe,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::invalid_value;

/// The motor ID, if it is 1 to 32.
#[pyfunction]
pub(crate) fn rmd_motor(py: Python<'_>, id: i64) -> PyResult<u8> {
    Ok(motor_id(py, id)?.number())
}

/// A frame as text and values. `reply`: the motor sent it. The frame does not show this.
#[pyfunction]
#[pyo3(signature = (can_id, data, *, reply))]
pub(crate) fn rmd_decode(
    py: Python<'_>,
    can_id: u32,
    data: &[u8],
    reply: bool,
) -> PyResult<Py<PyAny>> {
    let data = request::eight(py, data)?;
    let id = u16::try_from(can_id).ok().filter(|id| *id < 0x800);
    let id =
        id.ok_or_else(|| invalid_value(py, format_args!("{can_id:#x} has more than 11 bits")))?;
    let motor = MotorId::from_can_id(can_id);
    let code = Code::from(data[0]);
    let (name, fields): (_, &[Field]) = match (motor, code.info()) {
        (None, _) if id == TORQUE4_ID && !reply => (format!("{id:#x}"), SetTorque4::FIELDS),
        (None, _) => {
            return Err(invalid_value(
                py,
                format_args!("{id:#05x} is not an identifier of this protocol"),
            ));
        }
        (Some(_), Some(row)) => (row.code.to_string(), if reply { row.reply } else { row.request }),
        (Some(_), None) => (code.to_string(), &[]),
    };
    let (values, digits) = (PyDict::new(py), PyDict::new(py));
    for field in fields {
        let raw = field.raw(&data);
        digits.set_item(field.name, raw)?;
        values.set_item(field.name_with_unit().to_string(), field.scale.value(raw))?;
    }
    let direction = if reply { Direction::DriveToHost } else { Direction::HostToDrive };
    let text = describe(CanFrame::new(id, data), direction).to_string();
    crate::values::frame(py, (motor.map(MotorId::number), name, values, digits, text))
}

/// The bits of an error byte as text.
#[pyfunction]
pub(crate) fn rmd_errors_text(bits: u8) -> String {
    Errors(bits).to_string()
}
