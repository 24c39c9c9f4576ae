//! Reads the reply to a request in two steps. The first one needs no interpreter.

use motorlink_proto::st::{
    BoardInfo, ControlMode, FirmwareVersion, Flags, Implausible, Profile, RegisterId, RevupPhase,
    Status, segment_values,
};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use super::scale::Scale;
use crate::values;

/// What the payload of the acknowledge becomes.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Reply {
    Nothing,
    Number { register: RegisterId, raw: bool },
    Status,
    Flags,
    ControlMode,
    BoardInfo,
    FirmwareVersion,
    Revup,
    Segment { registers: Vec<RegisterId>, raw: bool },
    Bytes,
}

/// A reply that fits its request, made without an interpreter.
pub(crate) enum Answer {
    Nothing,
    Bits(i32),
    BoardInfo([u8; 3], String),
    FirmwareVersion(String, String),
    Revup(RevupPhase),
    Values(Vec<i32>),
    Bytes(Vec<u8>),
}

impl Reply {
    /// Reads the payload of a positive acknowledge; `None` if it does not fit the request.
    pub(super) fn understand(&self, profile: Profile, payload: &[u8]) -> Option<Answer> {
        Some(match self {
            Reply::Nothing => Answer::Nothing,
            Reply::Number { register, .. } => Answer::Bits(register.decode(profile, payload)?),
            Reply::Status => Answer::Bits(RegisterId::STATUS.decode(profile, payload)?),
            Reply::Flags => Answer::Bits(RegisterId::FLAGS.decode(profile, payload)?),
            Reply::ControlMode => Answer::Bits(RegisterId::CONTROL_MODE.decode(profile, payload)?),
            Reply::BoardInfo => {
                let info = BoardInfo::decode(payload)?;
                Answer::BoardInfo(info.version, info.name.to_owned())
            }
            Reply::FirmwareVersion => {
                let version = FirmwareVersion::decode(payload);
                Answer::FirmwareVersion(version.name.to_owned(), version.version.to_owned())
            }
            Reply::Revup => Answer::Revup(RevupPhase::decode(payload)?),
            Reply::Segment { registers, .. } => {
                Answer::Values(segment_values(registers, payload)?.collect())
            }
            Reply::Bytes => Answer::Bytes(payload.to_vec()),
        })
    }

    /// Checks that the profile may be right for the values, unless they are digits.
    pub(super) fn plausible(&self, scale: &Scale, answer: &Answer) -> Result<(), Implausible> {
        match (answer, self) {
            (Answer::Bits(bits), Reply::Number { register, raw: false }) => {
                scale.plausible(*register, *bits)
            }
            (Answer::Values(values), Reply::Segment { registers, raw: false }) => {
                let mut values = registers.iter().zip(values);
                values.try_for_each(|(register, bits)| scale.plausible(*register, *bits))
            }
            _ => Ok(()),
        }
    }

    /// The value for Python.
    pub(super) fn value(
        &self,
        py: Python<'_>,
        scale: &Scale,
        answer: Answer,
    ) -> PyResult<Py<PyAny>> {
        match (answer, self) {
            (Answer::Nothing, _) => Ok(py.None()),
            (Answer::Bits(bits), Reply::Number { register, raw }) => {
                scale.value(py, *register, bits, *raw)
            }
            (Answer::Bits(bits), Reply::Status) => {
                let state = Status::from(bits as u8);
                values::status(py, (state.to_string(), state.number(), state.doc()))
            }
            (Answer::Bits(bits), Reply::ControlMode) => {
                let mode = ControlMode::from(bits as u8);
                values::control_mode(py, (mode.to_string(), mode.number(), mode.doc()))
            }
            (Answer::Bits(bits), _) => {
                let flags = Flags(bits as u32);
                let names = |bits| PyTuple::new(py, faults(bits));
                values::flags(py, (names(flags.occurred())?, names(flags.present())?, flags.0))
            }
            (Answer::BoardInfo(version, name), _) => {
                values::board_info(py, (PyTuple::new(py, version)?, name))
            }
            (Answer::FirmwareVersion(name, version), _) => {
                values::firmware_version(py, (name, version))
            }
            (Answer::Revup(phase), _) => {
                let current = scale.amps(py, phase.torque_s16a.into())?;
                let seconds = f64::from(phase.duration_ms) / 1e3;
                values::revup_phase(py, (phase.speed_rpm, current, seconds))
            }
            (Answer::Values(bits), Reply::Segment { registers, raw }) => {
                let named = PyDict::new(py);
                for (register, bits) in registers.iter().zip(bits) {
                    named
                        .set_item(register.to_string(), scale.value(py, *register, bits, *raw)?)?;
                }
                named.into_py_any(py)
            }
            (Answer::Values(bits), _) => bits.into_py_any(py),
            (Answer::Bytes(bytes), _) => PyBytes::new(py, &bytes).into_py_any(py),
        }
    }
}

/// Names of the faults in one half of FLAGS; the number for a bit without a name.
fn faults(half: u16) -> Vec<String> {
    let bits = (0..16).map(|n| 1u16 << n).filter(|bit| half & bit != 0);
    let name = |bit| Flags::NAMES.iter().find(|(known, ..)| *known == bit).map(|row| row.1);
    bits.map(|bit| name(bit).map_or_else(|| format!("{bit:#06x}"), str::to_owned)).collect()
}
