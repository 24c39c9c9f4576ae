//! Requests from frames, and their values by name.

use motorlink_proto::st::{Frame, Parse, Request};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use super::reply::Reply;
use crate::error::invalid_value;

/// The single frame in these bytes.
pub(super) fn parse<'a>(py: Python<'_>, frame: &'a [u8]) -> PyResult<Frame<'a>> {
    match Frame::parse(frame) {
        Parse::Frame(parsed, size) if size == frame.len() => Ok(parsed),
        Parse::Frame(_, size) => {
            let more = frame.len() - size;
            Err(invalid_value(py, format_args!("the frame ends {more} bytes before its bytes do")))
        }
        Parse::More => Err(invalid_value(py, "the frame is not complete")),
        Parse::Bad(why) => {
            Err(invalid_value(py, format_args!("these bytes are not a frame: {why:?}")))
        }
    }
}

/// The error of a request that does not fit a frame.
pub(super) fn too_long(py: Python<'_>) -> PyErr {
    invalid_value(py, "the request does not fit a frame: a payload has at most 128 bytes")
}

/// What the reply to a request from a frame becomes. Its numbers are digits.
pub(super) fn reply(request: Request<'_>) -> Reply {
    match request {
        Request::GetRegister(register) => Reply::Number { register, raw: true },
        Request::GetBoardInfo => Reply::BoardInfo,
        Request::GetFirmwareVersion => Reply::FirmwareVersion,
        Request::GetRevupData(_) => Reply::Revup,
        Request::GetSegment(_) | Request::GetProfilerInfo(_) => Reply::Bytes,
        _ => Reply::Nothing,
    }
}

/// The raw protocol values of a request, by name.
pub(super) fn fields<'py>(py: Python<'py>, request: Request<'_>) -> PyResult<Bound<'py, PyDict>> {
    let fields = PyDict::new(py);
    let set = |name: &str, value: Py<PyAny>| fields.set_item(name, value);
    match request {
        Request::SetRegister { register, value } => {
            set("register", register.0.into_py_any(py)?)?;
            set("value", PyBytes::new(py, value).into_py_any(py)?)?;
        }
        Request::GetRegister(register) => set("register", register.0.into_py_any(py)?)?,
        Request::ExecuteCommand(command) => set("command", command.number().into_py_any(py)?)?,
        Request::GetBoardInfo | Request::GetFirmwareVersion => {}
        Request::SetRamp(ramp) => {
            set("speed_rpm", ramp.speed_rpm.into_py_any(py)?)?;
            set("duration_ms", ramp.duration_ms.into_py_any(py)?)?;
        }
        Request::GetRevupData(phase) => set("phase", phase.into_py_any(py)?)?,
        Request::SetRevupData(phase, data) => {
            set("phase", phase.into_py_any(py)?)?;
            set("speed_rpm", data.speed_rpm.into_py_any(py)?)?;
            set("torque_s16a", data.torque_s16a.into_py_any(py)?)?;
            set("duration_ms", data.duration_ms.into_py_any(py)?)?;
        }
        Request::SetCurrentReference(reference) => {
            set("iq_s16a", reference.iq_s16a.into_py_any(py)?)?;
            set("id_s16a", reference.id_s16a.into_py_any(py)?)?;
        }
        Request::GetProfilerInfo(steps) => {
            set("steps", PyBytes::new(py, steps).into_py_any(py)?)?;
        }
        Request::GetSegment(segment) => set("segment", segment.into_py_any(py)?)?,
        Request::ConfigureSegment { segment, registers } => {
            set("segment", segment.into_py_any(py)?)?;
            set("registers", PyBytes::new(py, registers).into_py_any(py)?)?;
        }
        Request::SetTorqueRamp(ramp) => {
            set("torque_s16a", ramp.torque_s16a.into_py_any(py)?)?;
            set("duration_ms", ramp.duration_ms.into_py_any(py)?)?;
        }
        Request::SetPosition(target) => {
            set("angle_rad", target.angle_rad.into_py_any(py)?)?;
            set("duration_s", target.duration_s.into_py_any(py)?)?;
        }
    }
    Ok(fields)
}
