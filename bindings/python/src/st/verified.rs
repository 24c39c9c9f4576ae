//! A write that is read back, by an event loop.

use std::sync::{Mutex, PoisonError};

use motorlink::st::{Error, MotorNumber, RegisterId};
use motorlink_proto::st::{Request, Unverified, VerifiedWrite, Verifying};
use pyo3::prelude::*;

use super::profile;
use super::request::{StRequest, motor_number};
use super::scale::Scale;
use crate::error::st_error;

/// A verified write: what to ask, one request after the other.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct StVerifiedWrite {
    motor: MotorNumber,
    register: RegisterId,
    verifying: Mutex<Verifying>,
}

#[pymethods]
impl StVerifiedWrite {
    /// For the write `request`, at most `attempts` times.
    #[new]
    fn new(
        py: Python<'_>,
        motor: i64,
        request: &StRequest,
        attempts: u8,
        profile: &str,
    ) -> PyResult<Self> {
        let number = motor_number(py, motor)?;
        let motor =
            MotorNumber::new(number).ok_or_else(|| st_error(py, &Error::NoSuchMotor(number)))?;
        let (register, bits) = request.verifiable(py)?;
        let write = VerifiedWrite::new(profile::named(py, profile)?, register, bits);
        let write = write.map_err(|why| unverified(py, motor, register, why))?;
        Ok(StVerifiedWrite { motor, register, verifying: Mutex::new(write.begin(attempts)) })
    }

    /// The next request.
    fn request(&self) -> StRequest {
        let verifying = self.verifying.lock().unwrap_or_else(PoisonError::into_inner);
        match verifying.request() {
            Request::SetRegister { register, value } => StRequest::writing(register, value),
            _ => StRequest::reading(Scale::plain(), self.register, true),
        }
    }

    /// Takes the value of that request. Returns the number of attempts when it is done.
    fn answered(&self, py: Python<'_>, digits: Option<i64>) -> PyResult<Option<u8>> {
        // The low half has the register's bits, also for negative values.
        self.step(py, Ok(digits.map(|digits| digits as i32)))
    }

    /// Takes the error of that request. It is raised after the last attempt.
    fn failed(&self, error: Bound<'_, PyAny>) -> PyResult<Option<u8>> {
        self.step(error.py(), Err(PyErr::from_value(error.clone())))
    }
}

impl StVerifiedWrite {
    fn step(&self, py: Python<'_>, outcome: PyResult<Option<i32>>) -> PyResult<Option<u8>> {
        let mut verifying = self.verifying.lock().unwrap_or_else(PoisonError::into_inner);
        let ended = verifying.step(outcome, |_| false).transpose();
        ended.map_err(|why| unverified(py, self.motor, self.register, why))
    }
}

fn unverified(
    py: Python<'_>,
    motor: MotorNumber,
    register: RegisterId,
    why: Unverified<PyErr>,
) -> PyErr {
    let error = Error::unverified(motor, register, why);
    error.map_or_else(|exchange| exchange, |error| st_error(py, &error))
}
