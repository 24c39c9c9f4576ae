//! Requests that come as frames, and what they carry by name.

use motorlink_proto::st::{Frame, Parse, Request};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use super::reply::Reply;
use crate::error::bad_value;

/// The one frame that these bytes are.
pub(super) fn parse<'a>(py: Python<'_>, frame: &'a [u8]) -> PyResult<Frame<'a>> {
    match Frame::parse(frame) {
        Parse::Frame(parsed, size) if size == frame.len() => Ok(parsed),
        Parse::Frame(_, size) => {
            let more = frame.len() - size;
            Err(bad_value(py, format_args!("the frame ends {more} bytes before its bytes do")))
        }
        Parse::More => Err(bad_value(py, "the frame is not complete")),
        Parse::Bad(why) => Err(bad_value(py, format_args!("this is no frame: {why:?}"))),
    }
}

/// The error of a request that does not fit a frame.
pub(super) fn too_long(py: Python<'_>) -> PyErr {
    bad_value(py, "the request does not fit a frame: a payload has at most 128 bytes")
}

/// A request apart from its list of bytes, and that list.
pub(super) fn owned(request: Request<'_>) -> (Request<'static>, Vec<u8>) {
    let (request, bytes): (Request<'static>, &[u8]) = match request {
        Request::SetRegister { register, value } => {
            (Request::SetRegister { register, value: &[] }, value)
        }
        Request::ProfilerInfo(steps) => (Request::ProfilerInfo(&[]), steps),
        Request::ConfigDynStruct { segment, registers } => {
            (Request::ConfigDynStruct { segment, registers: &[] }, registers)
        }
        Request::GetRegister(register) => (Request::GetRegister(register), &[]),
        Request::Execute(command) => (Request::Execute(command), &[]),
        Request::BoardInfo => (Request::BoardInfo, &[]),
        Request::Ramp(ramp) => (Request::Ramp(ramp), &[]),
        Request::RevupData(phase) => (Request::RevupData(phase), &[]),
        Request::SetRevupData(phase, data) => (Request::SetRevupData(phase, data), &[]),
        Request::CurrentReference(both) => (Request::CurrentReference(both), &[]),
        Request::FirmwareVersion => (Request::FirmwareVersion, &[]),
        Request::DataElement(segment) => (Request::DataElement(segment), &[]),
        Request::TorqueRamp(ramp) => (Request::TorqueRamp(ramp), &[]),
        Request::Position(target) => (Request::Position(target), &[]),
    };
    (request, bytes.to_vec())
}

/// What a request from a frame is answered with; its numbers are digits.
pub(super) fn reply(request: Request<'_>) -> Reply {
    match request {
        Request::GetRegister(register) => Reply::Number { register, raw: true },
        Request::BoardInfo => Reply::Info,
        Request::FirmwareVersion => Reply::FirmwareVersion,
        Request::RevupData(_) => Reply::Revup,
        Request::DataElement(_) | Request::ProfilerInfo(_) => Reply::Bytes,
        _ => Reply::Nothing,
    }
}

/// The values of a request as they travel, by name.
pub(super) fn fields<'py>(py: Python<'py>, request: Request<'_>) -> PyResult<Bound<'py, PyDict>> {
    let fields = PyDict::new(py);
    let set = |name: &str, value: Py<PyAny>| fields.set_item(name, value);
    match request {
        Request::SetRegister { register, value } => {
            set("register", register.0.into_py_any(py)?)?;
            set("value", PyBytes::new(py, value).into_py_any(py)?)?;
        }
        Request::GetRegister(register) => set("register", register.0.into_py_any(py)?)?,
        Request::Execute(command) => set("command", command.number().into_py_any(py)?)?,
        Request::BoardInfo | Request::FirmwareVersion => {}
        Request::Ramp(ramp) => {
            set("speed_rpm", ramp.speed_rpm.into_py_any(py)?)?;
            set("duration_ms", ramp.duration_ms.into_py_any(py)?)?;
        }
        Request::RevupData(phase) => set("phase", phase.into_py_any(py)?)?,
        Request::SetRevupData(phase, data) => {
            set("phase", phase.into_py_any(py)?)?;
            set("speed_rpm", data.speed_rpm.into_py_any(py)?)?;
            set("torque_s16a", data.torque_s16a.into_py_any(py)?)?;
            set("duration_ms", data.duration_ms.into_py_any(py)?)?;
        }
        Request::CurrentReference(reference) => {
            set("iq_s16a", reference.iq_s16a.into_py_any(py)?)?;
            set("id_s16a", reference.id_s16a.into_py_any(py)?)?;
        }
        Request::ProfilerInfo(steps) => {
            set("steps", PyBytes::new(py, steps).into_py_any(py)?)?;
        }
        Request::DataElement(segment) => set("segment", segment.into_py_any(py)?)?,
        Request::ConfigDynStruct { segment, registers } => {
            set("segment", segment.into_py_any(py)?)?;
            set("registers", PyBytes::new(py, registers).into_py_any(py)?)?;
        }
        Request::TorqueRamp(ramp) => {
            set("torque_s16a", ramp.torque_s16a.into_py_any(py)?)?;
            set("duration_ms", ramp.duration_ms.into_py_any(py)?)?;
        }
        Request::Position(target) => {
            set("angle_rad", target.angle_rad.into_py_any(py)?)?;
            set("duration_s", target.duration_s.into_py_any(py)?)?;
        }
    }
    Ok(fields)
}
