//! A bench as a port.

use std::sync::Arc;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink};
use motorlink_link::fault::{FaultError, Faults};
use motorlink_testbench::Bench;
use pyo3::prelude::*;

use crate::error::invalid_value;

/// A port to open.
#[derive(FromPyObject)]
pub(crate) enum Port<'py> {
    /// A port by its name.
    Name(String),
    /// A port of a bench.
    Sim(PyRef<'py, SimPort>),
}

/// The line and the bus of a bench, with faults.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct SimPort {
    pub(super) bench: Arc<Bench>,
    pub(super) faults: Faults,
}

impl SimPort {
    /// The name in messages.
    pub(crate) const NAME: &'static str = "the bench";

    /// A serial line to the ST drive.
    pub(crate) fn line(&self, py: Python<'_>) -> PyResult<Box<dyn ByteLink>> {
        Ok(self.bench.bytes(&self.faults(py, Faults::on_serial)?))
    }

    /// A CAN bus with the RMD motors.
    pub(crate) fn can(&self, py: Python<'_>) -> PyResult<Box<dyn CanLink>> {
        Ok(self.bench.can(&self.faults(py, Faults::on_can)?))
    }

    /// Its time.
    pub(crate) fn clock(&self) -> Clock {
        self.bench.clock().clone()
    }

    fn faults(
        &self,
        py: Python<'_>,
        usable: fn(Faults) -> Result<Faults, FaultError>,
    ) -> PyResult<Faults> {
        usable(self.faults).map_err(|error| invalid_value(py, error))
    }
}
