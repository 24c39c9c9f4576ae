//! The effect of a start, for both APIs: values of registers in, errors out.

use motorlink::st::{Error, Profile, RegisterId, Starting, Target};
use motorlink_proto::st::Request;
use pyo3::prelude::*;

use super::request::motor_number;
use crate::error::{invalid_value, st_error};

/// Says which registers to read after an acknowledged START_MOTOR.
#[pyclass(module = "motorlink._core")]
pub(crate) struct StStarting {
    motor: u8,
    starting: Starting,
    is_done: bool,
}

#[pymethods]
impl StStarting {
    /// For a motor, after START_MOTOR was acknowledged.
    #[new]
    fn new(py: Python<'_>, motor: i64) -> PyResult<Self> {
        let motor = motor_number(py, motor)?;
        Ok(StStarting { motor, starting: Starting::Status, is_done: false })
    }

    /// The register to read; `None` if the motor starts.
    fn register(&self) -> Option<u8> {
        match self.starting.request() {
            Request::GetRegister(register) if !self.is_done => Some(register.0),
            _ => None,
        }
    }

    /// Takes the bytes of the register. Raises if the motor does not start.
    fn replied(&mut self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        let register = self.register().map(RegisterId);
        let bits = register.and_then(|register| register.decode(Profile::Spec, data));
        let Some(bits) = bits else {
            return Err(invalid_value(py, "the reply has no value of the register"));
        };
        match self.starting.replied(bits) {
            Some(Err(why)) => {
                Err(st_error(py, &Error::NotStarted { motor: Target(self.motor), why }))
            }
            Some(Ok(_)) => {
                self.is_done = true;
                Ok(())
            }
            None => Ok(()),
        }
    }
}
